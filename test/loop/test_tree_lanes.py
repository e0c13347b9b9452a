# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs of a tree in parallel lanes: every lane is bitwise identical to a single run."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
import pytest

ROOT = Path(__file__).resolve().parents[2]
HELPER = ROOT / 'test' / 'helpers' / 'tree_in_lanes.py'


def differences(*arguments: Path | str) -> str:
    """Return what the helper prints; formulas run as plain Python, with the same bits."""
    done = subprocess.run(
        [sys.executable, HELPER, *arguments],
        env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
        stdout=subprocess.PIPE, text=True, timeout=600.0, check=True,
    )  # fmt: skip
    return done.stdout


def test_tree_lanes_small_robot_equal_single_runs() -> None:
    assert differences() == ''


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
def test_tree_lanes_tiago_equal_single_runs() -> None:
    assert differences(ROOT / 'config' / 'tiago.yaml', '0.01') == ''
