# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Base pose between two odometry messages, in another frame, and after jumps."""

from __future__ import annotations

from itertools import pairwise
import math
from pathlib import Path

from helpers.robots import PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.transforms import transforms_of, TransformsCdr
from masmc_ros.robot.base_pose import BasePose, planar_pose
from masmc_ros.robot.dead_reckoning import DeadReckoning
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.kinematics import base_motion
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
ANGLE, PLACE = st.floats(-3.0, 3.0), st.floats(-2.0, 2.0)


def pose_of(x: float, y: float, yaw: float) -> NDArray[np.float64]:
    return np.array([x, y, 0.0, 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)])


def errors_of_late_odometry(*, by_wheels: bool) -> float:
    """Return the largest error in m of poses from odometry at 50 Hz that is 20 ms old."""
    values = load_scenario(PAPER, ('plant.disturbance.amplitude=[0.5, -0.5, 0.0, 0.0]',))['plant']
    robot = robot_of(values)
    plant = SimulatedRobot(robot, 0.001, values)
    wheels = DeadReckoning(robot) if by_wheels else None
    base, largest = BasePose(wheels), 0.0
    past = [(0, plant.position.copy(), plant.velocity.copy())]
    for k in range(1, 1500):
        plant.advance(np.array([1.0 * math.sin(0.02 * k), 1.5, 0.0, 0.0]))
        stamp = k * 1_000_000
        if wheels is not None:
            wheels.add(stamp, plant.position)
        past.append((stamp, plant.position.copy(), plant.velocity.copy()))
        if k >= 20 and k % 20 == 0:
            sent, position, velocity = past[k - 20]
            pose, twist = base_motion(position[None], velocity[None])
            base.update(sent, pose[0], twist[0])
        if k >= 60:
            written, rates = np.zeros(7), np.zeros(7)
            base.write(stamp, written, rates)
            largest = max(largest, float(np.hypot(*(written - plant.position)[:2])))
    assert not base.has_jumped
    return largest


def test_base_pose_by_wheels_is_exact_by_twist_it_is_not() -> None:
    assert errors_of_late_odometry(by_wheels=True) < 5e-6
    assert errors_of_late_odometry(by_wheels=False) > 1e-4


@PROPERTY
@given(PLACE, PLACE, ANGLE, PLACE, PLACE, ANGLE)
def test_correction_moves_pose_into_its_frame(
    x: float, y: float, yaw: float, a: float, b: float, turn: float
) -> None:
    base = BasePose()
    base.correct(pose_of(a, b, turn))
    base.update(0, pose_of(x, y, yaw), np.zeros(6))
    position, velocity = np.zeros(7), np.zeros(7)
    base.write(0, position, velocity)
    c, s = math.cos(turn), math.sin(turn)
    expected = [a + c * x - s * y, b + s * x + c * y]
    assert position[:2] == pytest.approx(expected, abs=1e-9)
    assert math.remainder(position[2] - yaw - turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(('distance', 'jumps'), [(0.002, False), (0.05, True)])
def test_jump_of_odometry_or_correction_is_reported(distance: float, jumps: bool) -> None:
    for is_correction in (False, True):
        base = BasePose()
        base.correct(pose_of(0.0, 0.0, 0.0))
        base.update(0, pose_of(0.0, 0.0, 0.0), np.array([1.0, 0, 0, 0, 0, 0.5]))
        base.update(20_000_000, pose_of(0.02, 0.0001, 0.01), np.array([1.0, 0, 0, 0, 0, 0.5]))
        assert not base.has_jumped
        if is_correction:
            base.correct(pose_of(0.0, distance, 0.0))
        else:
            base.update(40_000_000, pose_of(0.04, distance, 0.02), np.zeros(6))
        assert base.has_jumped == jumps


@PROPERTY
@given(st.lists(st.text(min_size=1, max_size=9), min_size=2, max_size=4, unique=True))
def test_transforms_of_message_are_those_written(names: list[str]) -> None:
    frames = tuple(pairwise(names))
    transforms = np.random.default_rng(len(names)).normal(size=(len(frames), 7))
    raw = TransformsCdr('', frames).fill(123_456_789, transforms)
    read = list(transforms_of(raw))
    assert [(parent, child) for parent, child, _ in read] == list(frames)
    np.testing.assert_array_equal([numbers for *_, numbers in read], transforms)


@pytest.mark.parametrize(('degrees', 'is_valid'), [(0.2, True), (4.9, True), (5.1, False)])
def test_planar_pose_small_tilt_accepted(degrees: float, is_valid: bool) -> None:
    """The yaw of a tilted base is that of the plane."""
    half, yaw = math.radians(degrees) / 2, 0.7
    c, s = math.cos(yaw / 2), math.sin(yaw / 2)
    # A rotation about z, then a pitch in the frame of the base.
    quaternion = -s * math.sin(half), c * math.sin(half), s * math.cos(half), c * math.cos(half)
    pose = np.array([1.0, 2.0, 0.1, *quaternion])
    if not is_valid:
        with pytest.raises(InputError, match='expected at most 5'):
            planar_pose(pose, 'odom')
        return
    assert planar_pose(pose, 'odom') == pytest.approx((1.0, 2.0, yaw), abs=1e-9)
