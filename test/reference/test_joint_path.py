# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Paths of joints and poses: interpolation, task coordinates, limits, and joining."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

from helpers.small_tree import parameters, START
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.reference.joined import JoinedMotion
from masmc_ros.reference.joint_path import JointPath, JointPoints, JointState, JointTask
from masmc_ros.reference.pose_path import PosePoints, Speeds, TaskPath
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

PAPER = str(Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml')
YAW = 2
STEP = 1e-4
SPEEDS = Speeds(0.25, 0.5)


@cache
def robot(name: str) -> Robot:
    """Return the paper's robot, or a tree on two wheels; its task is a pose, or joints."""
    if name == 'paper':
        return robot_of(load_scenario(PAPER)['trajectory'])
    values = parameters() | ({'robot.task': ('joints',)} if name == 'joints' else {})
    defaults = {p.name: p.default for p in tree_mechanism(values).parameters}
    return robot_of(defaults | values)


def start_of(name: str) -> Array:
    """Return positions of the joints without a singularity."""
    driven = (0.0, 0.0, 0.8, -1.5) if name == 'paper' else START
    return np.array([0.3, -0.2, 0.9, *driven])


def points_of(name: str, kind: int, seed: int) -> JointPoints:
    """Return random points of base and arm: positions, with velocities, with accelerations."""
    random = np.random.default_rng(seed)
    start = start_of(name)
    columns = np.array([0, 1, 2, *range(5, len(start))])
    shape = 4, len(columns)
    velocities = random.uniform(-0.3, 0.3, shape)
    velocities[-1] = 0.0
    return JointPoints(
        columns,
        np.cumsum(random.uniform(0.5, 2.0, 4)),
        start[columns] + random.uniform(-0.3, 0.3, shape),
        velocities if kind > 0 else None,
        random.uniform(-0.3, 0.3, shape) if kind > 1 else None,
    )


def path_of(name: str, kind: int, seed: int) -> tuple[JointPath, JointPoints]:
    points = points_of(name, kind, seed)
    points.check()
    return JointPath(points, JointState.at_rest(start_of(name)), YAW), points


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(['paper', 'tree']), st.integers(0, 2), st.integers(0, 1000))
def test_joint_task_derivatives_are_finite_differences(name: str, kind: int, seed: int) -> None:
    path, points = path_of(name, kind, seed)
    task = robot(name).task_positions(start_of(name)[None])[0]
    motion = JointTask(path, robot(name), task)
    axes = len(task)
    # Accelerations of cubics step at the points.
    times = np.concatenate([
        np.linspace(first + 0.01, end - 0.01, 30)
        for first, end in pairwise([0.0, *points.times])
    ])
    samples, before, after = (motion.sample(times + step) for step in (0.0, -STEP, STEP))
    difference = (after - before) / (2.0 * STEP)
    assert np.abs(difference[:, :axes] - samples[:, axes:2 * axes]).max() < 1e-5
    assert np.abs(difference[:, axes:2 * axes] - samples[:, 2 * axes:]).max() < 1e-4
    joints = path.sample(times)[:, :len(start_of(name))]
    expected = robot(name).task_positions(np.ascontiguousarray(joints))
    error = robot(name).task_errors(np.ascontiguousarray(joints), samples[:, :axes])
    assert np.abs(error).max() < 1e-9
    assert np.abs(expected - samples[:, :axes])[:, :2].max() < 1e-9


@pytest.mark.parametrize('kind', [0, 1, 2])
def test_joint_path_has_points_at_their_times(kind: int) -> None:
    path, points = path_of('tree', kind, 5)
    columns, count = points.columns, len(start_of('tree'))
    samples = path.sample(points.times)
    positions, velocities = samples[:, columns], samples[:, count + columns]
    assert np.abs(positions - points.positions).max() < 1e-12
    if points.velocities is not None:
        assert np.abs(velocities - points.velocities).max() < 1e-12
    if points.accelerations is not None:
        # The last one is that of the hold.
        accelerations = samples[:-1, 2 * count + columns]
        assert np.abs(accelerations - points.accelerations[:-1]).max() < 1e-12
    held = path.sample(np.array([path.end + 1.0]))[0]
    assert (held[columns] == points.positions[-1]).all()
    assert not held[count:].any()
    others = np.setdiff1d(np.arange(count), columns)
    assert (samples[:, others] == start_of('tree')[others]).all()


def test_joint_task_of_joints_is_the_path_itself() -> None:
    path, _ = path_of('tree', 1, 2)
    motion = JointTask(path, robot('joints'), start_of('tree')[5:])
    times = np.linspace(0.0, path.end, 50)
    samples = motion.sample(times).reshape(50, 3, -1)
    assert (samples == path.sample(times).reshape(50, 3, -1)[:, :, 5:]).all()


def test_joint_path_with_velocities_is_cubic() -> None:
    path, points = path_of('tree', 1, 3)
    for first, end in pairwise([0.0, *points.times]):
        positions = path.sample(np.linspace(first, end - 1e-9, 9))[:, points.columns]
        assert np.abs(np.diff(positions, 4, axis=0)).max() < 1e-8
        assert np.abs(np.diff(positions, 3, axis=0)).max() > 1e-4


def test_joint_path_yaw_takes_the_short_way() -> None:
    start = start_of('paper')
    start[YAW] = 3.0
    points = JointPoints(np.array([YAW]), np.array([1.0, 2.0]), np.array([[-3.0], [-2.5]]))
    path = JointPath(points, JointState.at_rest(start), YAW)
    assert path.state(2.0).position[YAW] == pytest.approx(2.0 * np.pi - 2.5)


LIMITS = [
    ({'positions': [[3.5]]}, 'outside of its range; expected -3 to 3'),
    ({'times': [0.1]}, 'above its limit of 3; expected times longer by the factor'),
]


@pytest.mark.parametrize(('change', 'expected'), LIMITS, ids=['range', 'speed'])
def test_joint_path_beyond_limits_states_place(change: dict[str, list], expected: str) -> None:
    mechanism = robot('tree').mechanism
    values = {'times': [2.0], 'positions': [[1.5]], **change}
    points = JointPoints(np.array([7]), *(np.array(values[name]) for name in values))
    path = JointPath(points, JointState.at_rest(start_of('tree')), YAW)
    names = [joint.name for joint in mechanism.positions]
    with pytest.raises(InputError, match=f'upper_joint .* s of the path, .*{expected}'):
        path.check_limits(mechanism, names)


def test_joint_path_slower_by_its_factor_is_accepted() -> None:
    mechanism = robot('tree').mechanism
    names = [joint.name for joint in mechanism.positions]
    state = JointState.at_rest(start_of('tree'))

    def path(time: float) -> JointPath:
        return JointPath(JointPoints(np.array([7]), np.array([time]), np.array([[2.0]])), state, 2)

    with pytest.raises(InputError) as caught:
        path(0.3).check_limits(mechanism, names)
    factor = float(str(caught.value).rpartition(' ')[2])
    path(0.3 * factor).check_limits(mechanism, names)
    with pytest.raises(InputError):
        path(0.3 * (factor - 0.005)).check_limits(mechanism, names)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.floats(0.0, 3.0), st.booleans())
def test_joined_motion_starts_as_the_reference(seed: int, offset: float, stops: bool) -> None:
    random = np.random.default_rng(seed)
    path, _ = path_of('tree', 1, seed)
    task = robot('tree').task_positions(start_of('tree')[None])[0]
    start = np.concatenate([task, np.zeros(2 * len(task))]) + random.uniform(-0.2, 0.2, 18)
    motion = TaskPath.braking(start, 1.0) if stops else JointTask(path, robot('tree'), task)
    period = 0.001
    joined = JoinedMotion(motion, start, tick=7, period=period, offset=offset, speed=0.25)
    if stops:
        joined = JoinedMotion(motion, start, tick=7, period=period, speed=0.25)
    assert np.abs(joined.sample(7, 1)[0] - start).max() < 1e-12
    assert joined.time(8) - joined.time(7) == pytest.approx(period)
    whole = joined.sample(7, joined.last + 2 - 7)
    axes = len(task)
    steps = np.diff(whole[:, :axes], axis=0)
    middle = 0.5 * period * (whole[:-1, axes:2 * axes] + whole[1:, axes:2 * axes])
    # Positions and velocities are continuous, also at the points of the path.
    assert np.abs(steps - middle).max() < 1e-5
    assert (joined.sample(joined.last + 1, 1) == motion.sample(np.array([1e6]))).all()
    assert (np.vstack([joined.sample(7, 500), joined.sample(507, 300)]) == whole[:800]).all()


def test_braking_ends_at_rest_without_return() -> None:
    start = np.concatenate([np.zeros(4), [0.3, -0.2, 0.1, 0.0], np.zeros(4)])
    path = TaskPath.braking(start, 1.0)
    samples = path.sample(np.linspace(0.0, 1.0, 101))
    assert (samples[0] == start).all()
    assert np.abs(samples[-1, 4:]).max() < 1e-12
    assert (samples[:, 4] >= -1e-12).all()
    assert (samples[:, 5] <= 1e-12).all()


def pose_points(*, of_base: bool, positions: list[list[float]], yaw: float) -> PosePoints:
    turn = [0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw)]
    return PosePoints(of_base, np.array(positions), np.array([turn] * len(positions)), None)


def test_pose_path_of_base_keeps_speeds() -> None:
    start = start_of('tree')
    poses = pose_points(of_base=True, positions=[[0.5, 0.1, 0], [1.0, 0.5, 0]], yaw=-2.0)
    points = poses.joint_points(JointState.at_rest(start), SPEEDS)
    path = JointPath(points, JointState.at_rest(start), YAW)
    velocities = np.split(path.sample(path.grid()), 3, axis=1)[1]
    linear = np.linalg.norm(velocities[:, :2], axis=1).max()
    angular = np.abs(velocities[:, 2]).max()
    assert max(linear / SPEEDS.linear, angular / SPEEDS.angular) == pytest.approx(1.0, rel=1e-2)
    assert path.state(path.end).position[:3] == pytest.approx([1.0, 0.5, -2.0])


def test_pose_path_of_tip_turns_and_keeps_speeds() -> None:
    chosen = robot('tree')
    start = chosen.task_positions(start_of('tree')[None])[0]
    before = np.concatenate([start, np.zeros(2 * len(start))])
    poses = pose_points(of_base=False, positions=[[0.8, 0.0, 0.6]], yaw=1.0)
    path = poses.task_path(chosen, before, SPEEDS)
    samples = path.sample(np.linspace(0.0, path.end, 500))
    assert samples[0, :6] == pytest.approx(start)
    assert samples[-1, :6] == pytest.approx([0.8, 0.0, 0.6, 0.0, 0.0, 1.0])
    assert np.linalg.norm(samples[:, 6:9], axis=1).max() <= SPEEDS.linear * 1.01
    assert np.linalg.norm(samples[:, 9:], axis=1).max() <= SPEEDS.angular * 1.01


def test_pose_path_to_the_current_pose_holds() -> None:
    start = start_of('paper')
    poses = pose_points(of_base=True, positions=[[0.3, -0.2, 0.0]], yaw=0.9)
    points = poses.joint_points(JointState.at_rest(start), SPEEDS)
    assert points.times == pytest.approx([0.5])
    assert points.positions == pytest.approx(start[None, :3])
