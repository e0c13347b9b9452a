# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks of several outputs: the paper's robot as a tree, joints, a hand and a base."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers.child_environment import child_environment
from helpers.log_contents import read_log
from helpers.small_tree import START, URDF
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.simulation import Simulation
from masmc_ros.messages.topics import ACTUAL_PATH_TOPIC, DESIRED_PATH_TOPIC
from masmc_ros.robot.robot import robot_description
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

pytestmark = pytest.mark.slow

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
CLI = [sys.executable, '-m', 'masmc_ros.cli.main']
INTERPRETED = {**child_environment(), 'NUMBA_DISABLE_JIT': '1'}
TICKS = 300
LAST = 50
SIGMA = 10.0
WHEELS = ['wheel_right_joint', 'wheel_left_joint']


def signals(file: Path, *settings: str) -> dict[str, NDArray[Any]]:
    """Return the signals of a computed run, by name."""
    parts = list(Simulation(load_scenario(str(file), settings)).run())
    names = ('position', 'error', 'surface', 'raw_torque', 'torque')
    return {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}


@pytest.mark.slow
@pytest.mark.parametrize('switching', ['tanh', 'implicit'])
def test_tree_run_paper_robot_equals_closed_form(
    switching: str, tmp_path: Path
) -> None:
    """
    The task is that of two points, E and F.

    The model is the true one: the spin of wheels is no parameter of a tree. The wheels have the
    smallest diametral inertia of a body; the closed form requires neither.
    """
    settings = (
        'duration=2.0', 'controller.law=smc', f'controller.switching={switching}',
        'controller.observer_gain=0.5', 'controller.model_scale=1.0',
    )  # fmt: skip
    closed = (*settings, 'robot.wheel_yaw_inertia=0.0001')
    urdf = tmp_path / 'paper.urdf'
    urdf.write_text(robot_description(load_scenario(str(PAPER), closed)['plant']))
    file = yaml.safe_load(PAPER.read_text(encoding='utf-8'))
    file['/**']['ros__parameters']['robot'] = {
        'urdf': str(urdf),
        'base': 'differential',
        'wheels': WHEELS,
        'task': ['planar end_effector', 'planar link_1'],
        'armature': 0.0,
        'damping': 0.0,
        'least_pivot': 1.0e-9,
    }
    tree = tmp_path / 'tree.yaml'
    tree.write_text(yaml.safe_dump(file))
    expected, actual = signals(PAPER, *closed), signals(tree, *settings)
    # The robot moves; a test of a robot at rest would prove nothing.
    assert np.ptp(expected['position'], axis=0).min() > 0.01
    for name, values in expected.items():
        assert actual[name] == pytest.approx(values, abs=1e-8 * np.abs(values).max()), name


def scenario(folder: Path, task: list[str], offset: list[float], away: float = 0.0) -> Path:
    """
    Write a scenario of the small robot into a folder.

    The joints start `away` from their posture. The controller does not wait until they have
    reached it.
    """
    (folder / 'small.urdf').write_text(URDF, encoding='utf-8')
    is_omnidirectional = 'base' in task
    base: dict[str, Any] = {'base': 'differential', 'wheels': WHEELS}
    if is_omnidirectional:
        base = {'base': 'omnidirectional', 'held_joints': WHEELS}
    drives = [0.0] * (3 if is_omnidirectional else 2)
    robot = {'urdf': str(folder / 'small.urdf'), 'task': task, 'posture': list(START[2:]), **base}
    nodes = {
        '/**': {'robot': robot, 'control_period': 0.001, 'duration': 1e-3 * TICKS},
        'plant': {'initial_joints': [*drives, *(at + away for at in START[2:])]},
        'trajectory': {'line_sine': {'offset': offset}} if offset else {},
        'controller': {
            'law': 'smc', 'model_scale': 1.0, 'approach_speed': 0.0, 'sigma': SIGMA,
            'k_s1': 200.0, 'k_s2': 200.0,
        },
    }  # fmt: skip
    path = folder / 'small.yaml'
    path.write_text(
        yaml.safe_dump({name: {'ros__parameters': values} for name, values in nodes.items()})
    )
    return path


@pytest.mark.parametrize(
    ('task', 'offset'),
    [
        (['joints'], []),
        (['joints', 'planar turret'], [*START[2:], 0.15, 0.0]),
        (['position', 'heading'], [0.6, 0.15, 0.4, 0.1]),
        (['base', 'joints'], [0.05, 0.05, 0.1, *START[2:]]),
    ],
)
def test_tree_task_errors_decay_with_sigma(
    task: list[str], offset: list[float], tmp_path: Path
) -> None:
    log = tmp_path / 'run.mcap'
    file = scenario(tmp_path, task, offset, away=0.1)
    subprocess.run(
        [*CLI, 'simulate', file, '--output', log], env=INTERPRETED, check=True, timeout=300.0
    )
    error = read_run(log).telemetry['error'].values
    first = np.linalg.norm(error[0])
    assert first > 0.1
    # After this time all joints are on the surface, where errors decay with sigma.
    reached = np.linalg.norm(error[TICKS - LAST])
    decay = np.exp(-SIGMA * 1e-3 * LAST)
    assert np.linalg.norm(error[-1]) == pytest.approx(decay * reached, rel=0.05)


def test_joint_task_run_is_logged_reported_and_exported(tmp_path: Path) -> None:
    """Without a configured path the reference is the posture."""
    log = tmp_path / 'run.mcap'
    file = scenario(tmp_path, ['joints'], [])
    output = subprocess.run(
        [*CLI, 'simulate', file, '--output', log],
        env=INTERPRETED, check=True, timeout=300.0, capture_output=True, text=True,
    ).stdout  # fmt: skip
    assert '(mrad)' in output
    run = read_run(log)
    assert np.abs(run.telemetry['error'].values).max() < 1e-4
    # A task of joints has no position and therefore no path.
    messages = read_log(log).messages
    assert not messages[ACTUAL_PATH_TOPIC]
    assert not messages[DESIRED_PATH_TOPIC]
    for command in ('report', 'export'):
        subprocess.run(
            [*CLI, command, log, '--output', tmp_path / command],
            env=INTERPRETED, check=True, timeout=300.0,
        )  # fmt: skip
    names = {path.name for path in (tmp_path / 'report').iterdir()}
    assert {'report.html', 'run_turret_joint.png', 'run_lift_joint.png', 'comparison.png'} <= names
    metrics = (tmp_path / 'report' / 'metrics.csv').read_text(encoding='utf-8')
    head = metrics.splitlines()[0].split(',')
    assert {'turret_joint_rms (rad)', 'lift_joint_rms (m)'} <= set(head)
    table = (tmp_path / 'export' / 'run.csv').read_text(encoding='utf-8').splitlines()[0]
    assert {'error_lift_joint_m', 'reference_position_hand_joint_rad'} <= set(table.split(','))
