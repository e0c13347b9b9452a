# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Speed and position limits of redundant robots under disturbances."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.run_limits import limits_of
from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.scenario.scenario import load_scenario
import pytest

ROOT = Path(__file__).resolve().parents[2]
HELPER = ROOT / 'test' / 'helpers' / 'run_limits.py'

TIAGO, PRO, PANDA = 'tiago', 'tiago_pro', 'franka_on_omni'
ACCURACY = {TIAGO: 1.6e-6, PRO: 3.0e-6, PANDA: 2.7e-6}
"""Upper bounds of the RMS distance of the first hand from its path in m."""

needs_robots = pytest.mark.skipif(
    find_spec('pinocchio') is None, reason='their URDFs come with the extra robots'
)


def moved_path(name: str, *distance: float) -> str:
    """Return the setting that moves the path of the first hand of a shipped file, in m."""
    offset = list(load_scenario(path_of(name), ())['trajectory']['line_sine.offset'])
    for axis, shift in enumerate(distance):
        offset[axis] += shift
    return f'trajectory.line_sine.offset={offset}'


def path_of(name: str) -> str:
    """Return the path of a shipped file."""
    return str(ROOT / 'config' / f'{name}.yaml')


@pytest.mark.slow
def test_speed_limits_disturbed_small_tree_are_kept(tmp_path: Path) -> None:
    """The disturbance turns wheels and turret against each other, without motion of the hand."""
    path = write_scenario(tmp_path, hand_at_start(), 0.08)
    settings = (
        'robot.speed_limits=[turret_joint 1.0]',
        'controller.model_scale=0.5',
        'plant.disturbance.amplitude=[2.0, -2.0, -10.0, 0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.57, 1.57, 1.57, 1.57, 1.57, 1.57, 1.57]',
    )
    speeds = []
    for rate in ('0.0', '50.0'):
        done = subprocess.run(
            [sys.executable, HELPER, path, *settings, f'robot.drift_rate={rate}'],
            env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
            stdout=subprocess.PIPE, text=True, timeout=300.0, check=True,
        )  # fmt: skip
        speeds.append(float(done.stdout.split()[0]))
    assert speeds[1] < 1.0 < speeds[0]


@pytest.mark.slow
@needs_robots
@pytest.mark.parametrize('name', [TIAGO, PRO, PANDA])
def test_speed_and_position_limits_shipped_run_are_kept(name: str) -> None:
    run = limits_of(path_of(name), ())
    assert run.speed <= 1.0
    assert run.beyond <= 0.0
    assert run.torque <= 1.0
    assert run.error < ACCURACY[name]


@pytest.mark.slow
@needs_robots
@pytest.mark.parametrize('name', [TIAGO, PRO, PANDA])
def test_speed_limits_distant_approach_are_kept(name: str) -> None:
    run = limits_of(path_of(name), (moved_path(name, 0.2, 0.2, -0.1),), approaches=True)
    assert run.speed <= 1.0
    assert run.beyond <= 0.0
    assert run.error < 2.0 * ACCURACY[name]


@pytest.mark.slow
@needs_robots
@pytest.mark.parametrize('name', [TIAGO, PRO, PANDA])
def test_speed_limits_path_out_of_reach_bounds_speeds(name: str) -> None:
    run = limits_of(path_of(name), (moved_path(name, 0.0, 0.0, 1.0),), approaches=True)
    assert run.speed <= 1.2
    assert run.torque <= 1.0
