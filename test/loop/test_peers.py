# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The scripts of `benchmarks/peers.py` compute the closed loop of the package."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks import peers
import pytest


@pytest.mark.parametrize('peer', [peers.in_python, peers.in_numpy, peers.in_scipy])
def test_peer_ends_in_state_of_package(
    peer: Callable[[], peers.State], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers, 'SECONDS', 0.2)
    monkeypatch.setattr(peers, 'RUNS', 3)
    state, expected = peer(), peers.in_package()
    assert peers.deviation(state, expected) < peers.TOLERANCE
    monkeypatch.setattr(peers, 'PUSH', 1.01 * peers.PUSH)
    assert peers.deviation(peer(), expected) > peers.TOLERANCE
