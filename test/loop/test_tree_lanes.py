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


def test_tree_lanes_small_robot_equal_single_runs() -> None:
    done = subprocess.run(
        [sys.executable, HELPER], env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
        stdout=subprocess.PIPE, text=True, timeout=300.0, check=True,
    )  # fmt: skip
    assert done.stdout == ''


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
def test_tree_lanes_tiago_equal_single_runs() -> None:
    done = subprocess.run(
        [sys.executable, HELPER, ROOT / 'config' / 'tiago.yaml', '0.2'], env=child_environment(),
        stdout=subprocess.PIPE, text=True, timeout=2400.0, check=True,
    )  # fmt: skip
    assert done.stdout == ''
