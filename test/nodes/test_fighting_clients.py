# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Clients that compete for the reference of a run, and are killed."""

from __future__ import annotations

from benchmarks.fighting_clients import fight
import pytest


@pytest.mark.slow
def test_clients_that_fight_leave_no_tick_without_reference(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """No tick lacks one, it never jumps, the error stays bounded, and the log is recomputed."""
    assert fight(12.0, seed=3, period=0.01, pacing='lockstep'), capsys.readouterr().out
