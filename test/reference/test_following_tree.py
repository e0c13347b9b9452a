# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Base of a tree that follows a path of the end effector: heading, pose or a point of it."""

from __future__ import annotations

import math
from pathlib import Path

from helpers.small_tree import parameters as small_tree
from helpers.small_tree import URDF
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.reference.following_base import _trailed, follow_tip
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots
from masmc_ros.reference.pose_path import PosePoints, Speeds
from masmc_ros.reference.trajectory import parameters, Trajectory
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.robot.tree.following import _rotations, Followed
from masmc_ros.robot.tree.postures import frame_of, placed
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism, TreeMechanism
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

NOSE = """<link name="nose"/><joint name="nose_joint" type="fixed"><parent link="base_link"/>
<child link="nose"/><origin xyz="0.25 0.05 0.1" rpy="0 0 0"/></joint></robot>"""
WHEELS = ('wheel_right_joint', 'wheel_left_joint')


def robot_with(*task: str, base: str = 'differential') -> Robot:
    values = small_tree(URDF.replace('</robot>', NOSE)) | {'robot.task': task}
    if base != 'differential':
        values |= {'robot.base': base, 'robot.wheels': (), 'robot.held_joints': WHEELS}
    mechanism = tree_mechanism(values)
    return robot_of({p.name: p.default for p in mechanism.parameters} | values)


def followed_of(robot: Robot) -> Followed:
    assert isinstance(robot.mechanism, TreeMechanism)
    assert robot.mechanism.followed is not None
    return robot.mechanism.followed


WITH_HEADING = robot_with('position', 'heading')
WITH_POINT = robot_with('position', 'planar nose')
WITH_BASE = robot_with('position', 'base', base='omnidirectional')
WITH_POSE = robot_with('pose', 'base', base='omnidirectional')


@st.composite
def tip_paths(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return times (n) and positions (n, 3) of a path of the hand."""
    count = draw(st.integers(2, 5))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(3.0, 8.0, count))
    return times, rng.uniform([-2.0, -2.0, 0.4], [2.0, 2.0, 0.8], (count, 3))


def knots_of(robot: Robot, times: Array, tips: Array) -> Array:
    knots = np.zeros((len(times), 3 * len(robot.mechanism.axes)))
    knots[:, :tips.shape[1]] = tips
    smooth_knots(times, knots)
    return knots


@settings(max_examples=20)
@given(path=tip_paths())
def test_base_on_two_wheels_never_moves_sideways(path: tuple[Array, Array]) -> None:
    times, tips = path
    knots = knots_of(WITH_HEADING, times, tips)
    fine = sample_knots(times, knots, np.linspace(times[0], times[-1], 4000))
    seen: list[Array] = []

    def trail(path: Array, start: Array | None, least: float, most: float) -> Array:
        seen.append(_trailed(path, start, least, most))
        return seen[-1]

    axes = WITH_HEADING.mechanism.formulas.base_axes(fine[:, :4], None, trail)
    followed, yaw = followed_of(WITH_HEADING), axes[:, 0]
    s, c = np.sin(yaw), np.cos(yaw)
    # The carrier moves along the line to the end effector, which is straight ahead of it.
    moved = np.diff(seen[0], axis=0)
    assert np.abs(c[1:] * moved[:, 1] - s[1:] * moved[:, 0]).max() < 1e-12
    x, y = followed.centre
    base = seen[0] - np.column_stack([c * x - s * y, s * x + c * y])
    step, turn = np.diff(base, axis=0), np.diff(yaw)
    middle = yaw[:-1] + 0.5 * turn
    sideways = np.cos(middle) * step[:, 1] - np.sin(middle) * step[:, 0]
    # What remains is the chord of a turn.
    length = np.linalg.norm(moved, axis=1) + abs(y) * np.abs(turn)
    assert (np.abs(sideways) <= 0.51 * np.abs(turn) * length + 1e-12).all()
    # The end effector stays where it is in the posture, seen from the base.
    way = fine[:, :2] - base
    across = -s * way[:, 0] + c * way[:, 1]
    angle = np.arctan2(across - y, c * way[:, 0] + s * way[:, 1])
    assert np.abs(angle - followed.bearing).max() < 1e-9


@settings(max_examples=20)
@given(path=tip_paths())
def test_tree_keeps_the_tip_in_comfortable_reach(path: tuple[Array, Array]) -> None:
    times, tips = path
    for robot in (WITH_BASE, WITH_POINT, WITH_HEADING):
        knots = knots_of(robot, times, tips)
        union, whole = follow_tip(robot, times, knots)
        at = np.unique(np.concatenate([np.linspace(times[0], times[-1], 500), times]))
        samples, before = sample_knots(union, whole, at), sample_knots(times, knots, at)
        axes = len(robot.mechanism.axes)
        assert np.abs(samples[:, :3] - before[:, :3]).max() < 1e-12
        carrier = robot.mechanism.carrier
        assert carrier is not None
        rates = samples[:, axes + carrier.first:axes + carrier.first + carrier.size]
        assert not rates[[0, -1]].any()
        change = np.diff(samples[:, carrier.axes], axis=0)
        change -= 0.5 * np.diff(at)[:, None] * (rates[1:] + rates[:-1])
        assert np.abs(change).max() < 2e-3 * max(1.0, np.abs(rates).max())
        if robot is WITH_BASE:
            least, most = robot.mechanism.formulas.comfortable_reach(robot.geometry)
            distance = np.linalg.norm(samples[:, :2] - samples[:, 3:5], axis=1)
            assert distance.min() > least - 0.1 * (most - least)
            assert distance.max() < most + 0.1 * (most - least)


def test_comfortable_reach_is_around_the_posture_and_in_reach() -> None:
    mechanism = WITH_BASE.mechanism
    assert isinstance(mechanism, TreeMechanism)
    least, most = mechanism.formulas.comfortable_reach(WITH_BASE.geometry)
    posture = np.array(mechanism.made_of['robot.posture'])
    frame = mechanism.robot.frames['hand']
    _, origins = frame_of(placed(mechanism.robot, posture[None]), frame)
    at_posture = math.hypot(*origins[0, :2])
    assert 0.5 * (least + most) == pytest.approx(at_posture)
    # Upper arm and forearm are 0.3 and 0.25 m long, 0.2 m from the axis of the turret.
    assert 0.05 < least < at_posture - 0.02
    assert at_posture + 0.02 < most < 0.1 + 0.2 + 0.3 + 0.25


@pytest.mark.parametrize('turn', [0.0, 0.8, -1.5])
def test_path_of_the_posture_starts_with_the_base_there(turn: float) -> None:
    """Of an omnidirectional base with the orientation of its hand."""
    robot, followed = WITH_POSE, followed_of(WITH_POSE)
    mechanism = robot.mechanism
    assert isinstance(mechanism, TreeMechanism)
    posture = np.array(mechanism.made_of['robot.posture'])
    position = np.concatenate([[0.4, -0.3, turn, 0.0, 0.0, 0.0], posture])
    start = robot.task_positions(position[None])
    times = np.array([0.0, 4.0, 9.0])
    tips = np.repeat(start[:, :6], 3, axis=0)
    tips[1:, :3] += [[0.6, 0.5, 0.1], [-0.2, 0.9, 0.0]]
    _, whole = follow_tip(robot, times, knots_of(robot, times, tips))
    assert np.abs(whole[0, 6:9] - [0.4, -0.3, turn]).max() < 1e-9
    # With a constant orientation of the hand, the base keeps its heading.
    assert np.abs(whole[:, 8] - turn).max() < 1e-9
    place = whole[-1, :2] - followed.distance * np.array(
        [math.cos(turn + followed.bearing), math.sin(turn + followed.bearing)]
    )
    _, most = mechanism.formulas.comfortable_reach(robot.geometry)
    assert np.linalg.norm(whole[-1, 6:8] - place) < 1.01 * (most - followed.distance)


@pytest.mark.parametrize('robot', [WITH_HEADING, WITH_POINT, WITH_BASE, WITH_POSE])
def test_goal_from_a_message_starts_at_the_current_base(robot: Robot) -> None:
    mechanism = robot.mechanism
    assert isinstance(mechanism, TreeMechanism)
    posture = np.array(mechanism.made_of['robot.posture'])
    drives = len(mechanism.joints) - len(posture)
    position = np.concatenate([[0.2, 0.1, 0.4], np.zeros(drives), posture])
    x = robot.task_positions(position[None])[0]
    before = np.concatenate([x, np.zeros(2 * len(x))])
    goal = PosePoints(
        of_base=False,
        positions=x[None, :3] + [1.5, -1.0, 0.05],
        quaternions=np.array([[0.0, 0.0, 0.0, 1.0]]),
        times=None,
    )
    speeds = Speeds(0.25, 0.5)
    path = goal.task_path(robot, before, speeds, base_follows=True)
    own = mechanism.carrier.axes if mechanism.carrier else slice(0)
    first, last = path.sample(np.array([0.0, path.end]))
    assert np.abs(first[:len(x)] - x).max() < 1e-6
    assert np.abs(last[own] - x[own]).max() > 0.1
    held = goal.task_path(robot, before, speeds).sample(np.array([path.end]))[0]
    assert (held[own] == x[own]).all()


def test_points_and_file_without_the_heading_are_completed(tmp_path: Path) -> None:
    mechanism = WITH_HEADING.mechanism
    x, y, z, _ = (axis.name for axis in mechanism.axes)
    file = tmp_path / 'tips.csv'
    file.write_text(f'time_s,{x},{y},{z}\n0,0.6,0.1,0.6\n6,1.5,0.8,0.5\n')
    values = {p.name: p.default for p in parameters(mechanism)}
    of_file = Trajectory({**values, 'type': 'file', 'file.path': str(file)}, 0.01, WITH_HEADING)
    points = {
        'type': 'waypoints',
        'waypoints.base_follows': True,
        'waypoints.times': (0.0, 6.0),
        'waypoints.points': (0.6, 0.1, 0.6, 1.5, 0.8, 0.5),
    }
    of_points = Trajectory({**values, **points}, 0.01, WITH_HEADING)
    assert np.abs(of_file.sample(0, 700) - of_points.sample(0, 700)).max() < 1e-12
    assert of_file.note.startswith(f'the path lacks {mechanism.axes[3].name}, so the base follows')


def test_waypoints_with_quaternions_leave_out_the_base() -> None:
    mechanism = WITH_POSE.mechanism
    values = {p.name: p.default for p in parameters(mechanism)}
    half = math.sqrt(0.5)
    points = {
        'type': 'waypoints',
        'waypoints.base_follows': True,
        'waypoints.times': (0.0, 6.0),
        'waypoints.points': (0.6, 0.1, 0.6, 1.5, 0.8, 0.5),
        'waypoints.quaternions': (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half),
    }
    samples = Trajectory({**values, **points}, 0.01, WITH_POSE).sample(0, 601)
    assert np.abs(samples[-1, :6] - [1.5, 0.8, 0.5, 0.0, 0.0, 0.5 * math.pi]).max() < 1e-9
    # The base turns with the hand.
    assert samples[-1, 8] - samples[0, 8] == pytest.approx(0.5 * math.pi)


@pytest.mark.parametrize(
    ('task', 'base'),
    [
        (('pose',), 'differential'),
        (('heading', 'pose'), 'differential'),
        (('position', 'position nose'), 'differential'),
        (('joints',), 'differential'),
        (('position', 'joints'), 'fixed'),
    ],
)
def test_other_tasks_leave_no_base_out(task: tuple[str, ...], base: str) -> None:
    assert robot_with(*task, base=base).mechanism.carrier is None


def test_rotations_are_those_of_their_vectors() -> None:
    vectors = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * math.pi], [math.pi, 0.0, 0.0]])
    expected = [np.eye(3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], np.diag([1.0, -1.0, -1.0])]
    assert np.abs(_rotations(vectors) - np.array(expected)).max() < 1e-15
