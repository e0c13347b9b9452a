# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Simulation, log, reader and report of URDF robots; TIAGo on its path."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.small_tree import hand_at_start, parameters, START, write_scenario
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.tree.frames import world_of
from masmc_ros.robot.tree.link_inertia import pseudo_inertia
from masmc_ros.robot.tree.task.outputs import OUTPUTS
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

TIAGO = Path(__file__).resolve().parents[2] / 'config' / 'tiago.yaml'
TICKS = 40


@pytest.mark.slow
def test_tree_frames_hand_equals_task_position() -> None:
    values = parameters()
    mechanism = tree_mechanism(values)
    robot = robot_of({p.name: p.default for p in mechanism.parameters} | values)
    position = np.array([[0.3, -0.2, 0.5, 1.0, 2.0, *START[2:]]])
    frames = robot.frame_transforms(position)[0]
    places = world_of(mechanism.frames, frames)
    hand = [child for _, child in mechanism.frames].index('hand')
    assert places[hand][1] == pytest.approx(robot.task_positions(position)[0, :3], abs=1e-14)
    assert np.linalg.norm(frames[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.slow
def test_tree_run_urdf_deleted_is_reported_and_exported(tmp_path: Path) -> None:
    """The processes are interpreted; the URDF is deleted before the log is read."""
    path = write_scenario(tmp_path, hand_at_start(), 1e-3 * TICKS)
    environment = {**child_environment(), 'NUMBA_DISABLE_JIT': '1'}
    run = [sys.executable, '-m', 'masmc_ros.cli.main']
    log = tmp_path / 'run.mcap'
    subprocess.run(
        [*run, 'simulate', path, '--output', log], env=environment, check=True, timeout=300.0
    )
    (tmp_path / 'small.urdf').unlink()
    logged = read_run(log)
    assert len(logged.times) == TICKS + 1
    assert logged.joint_names[3:] == (
        'wheel_right_joint', 'wheel_left_joint', 'turret_joint', 'lift_joint', 'upper_joint',
        'fore_joint', 'hand_joint',
    )  # fmt: skip
    error = logged.telemetry['error'].values
    assert np.abs(error).max() < 1e-4
    subprocess.run(
        [*run, 'report', log, '--output', tmp_path / 'report'],
        env=environment, check=True, timeout=300.0,
    )  # fmt: skip
    page = (tmp_path / 'report' / 'report.html').read_text(encoding='utf-8')
    assert 'hand_joint' in page
    # The robot is drawn in its path.
    assert 'No parameters of the robot' not in page
    subprocess.run(
        [*run, 'export', log, '--output', tmp_path / 'export'],
        env=environment, check=True, timeout=300.0,
    )  # fmt: skip
    table = (tmp_path / 'export' / 'run.csv').read_text(encoding='utf-8')
    for name in ('position_lift_joint_m', 'command_lift_joint_N', 'error_rx_tip_rad'):
        assert name in table.splitlines()[0].split(',')


@pytest.mark.slow
@pytest.mark.parametrize('task', ['position', 'planar', 'base'])
def test_tree_run_partial_pose_task_is_tracked(task: str, tmp_path: Path) -> None:
    path = write_scenario(tmp_path, hand_at_start(), 1e-3 * TICKS, task)
    log = tmp_path / 'run.mcap'
    subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'simulate', path, '--output', log],
        env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'}, check=True, timeout=300.0,
    )  # fmt: skip
    error = read_run(log).telemetry['error'].values
    assert error.shape == (TICKS + 1, len(OUTPUTS[task]))
    assert np.abs(error).max() < 1e-4


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
def test_tiago_half_of_true_masses_tracks_path() -> None:
    simulation = Simulation(load_scenario(str(TIAGO), ('duration=20',)))
    parts = list(simulation.run(block=5000))
    error = np.concatenate([part.error for part in parts])[10_000:]
    position, orientation = (
        1e3 * np.sqrt((part**2).sum(axis=1).mean()) for part in (error[:, :3], error[:, 3:])
    )
    assert position < 0.01
    assert orientation < 0.03
    assert not any(part.singular.any() for part in parts)
    theta = np.concatenate([part.estimate[::50] for part in parts])
    bodies = theta.reshape(-1, 10)
    bodies = bodies[np.abs(bodies).sum(axis=1) > 0.0]
    least = [np.linalg.eigvalsh(pseudo_inertia(body))[0] for body in bodies]
    assert min(least) > 0.0
    # The estimates have left the nominal model.
    assert np.abs(theta[-1] - theta[0]).max() > 0.1
