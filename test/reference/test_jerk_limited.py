# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Jerk-limited motions to set-points and goals: limits, and continuation of any state."""

from __future__ import annotations

from helpers.robots import between, DEFAULT, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.reference.jerk_limited import jerk_limited_knots, SetPoint
from masmc_ros.reference.joint_path import JointPath, JointState
from masmc_ros.reference.minimum_jerk import sample_knots
from masmc_ros.reference.pose_path import HEADING, PosePoints, Speeds
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import NDArray
import pytest

pytest.importorskip('ruckig')

Array = NDArray[np.float64]

SPEEDS = Speeds(0.25, 0.5, acceleration=0.5, jerk=2.0)
ROBOT = robot_of({f'robot.{name}': value for name, value in DEFAULT.items()})
LIMITS = np.array([[0.3, 0.5], [0.6, 0.5], [2.0, 3.0]])
"""Velocity, acceleration and jerk of two coordinates."""
WITHIN = 1.0 + 1e-3
PLACES = st.tuples(*[between(-1.0, 1.0)] * 2)
PARTS = st.tuples(*[between(-0.5, 0.5)] * 2)


@st.composite
def starts(draw: st.DrawFn) -> Array:
    """Draw a state that can stop within the limits of velocity: (position, velocity, acc.)."""
    rates = (np.array(draw(PARTS)) * limit for limit in LIMITS[:2])
    return np.concatenate([draw(PLACES), *rates])


@PROPERTY
@given(starts(), PLACES)
def test_jerk_limited_motion_keeps_limits_from_any_state(
    start: Array, place: tuple[float, float]
) -> None:
    goal = np.array(place)
    times, knots = jerk_limited_knots(start, goal, LIMITS)
    at = np.linspace(0.0, times[-1], 501)
    samples = sample_knots(times, knots, at)
    _, velocity, acceleration = np.split(samples, 3, axis=1)
    assert samples[0].tolist() == start.tolist()
    assert samples[-1].tolist() == [*goal, 0.0, 0.0, 0.0, 0.0]
    assert (np.abs(velocity) <= WITHIN * LIMITS[0] + 1e-9).all()
    assert (np.abs(acceleration) <= WITHIN * LIMITS[1] + 1e-9).all()
    step = at[1]
    if step:
        jerk = np.abs(np.diff(acceleration, axis=0)) / step
        assert (jerk <= LIMITS[2] * WITHIN + 1e-6).all()
        # Each difference differs from the derivative by the change of the next derivative.
        mean = 0.5 * (acceleration[1:] + acceleration[:-1])
        assert np.diff(velocity, axis=0) == pytest.approx(mean * step, abs=3.0 * step**2)


def test_set_point_moves_on_a_straight_line_within_limits() -> None:
    start, goal = np.array([0.3, 0.5, 0.0, 0.0]), np.array([0.7, 0.3, 0.2, 0.0])
    reference = SetPoint({
        'start': start, 'goal': goal, 'speed': (0.2,) * 4, 'acceleration': (0.5,) * 4,
        'jerk': (2.0,) * 4, 'delay': 0.5,
    })  # fmt: skip
    samples = reference.sample(np.linspace(0.0, 4.0, 4001))
    position, velocity = samples[:, :4], samples[:, 4:8]
    assert (samples[:500] == [*start, *[0.0] * 8]).all()
    assert samples[-1] == pytest.approx([*goal, *[0.0] * 8])
    part = (position[:, 0] - start[0]) / (goal[0] - start[0])
    assert position == pytest.approx(start + part[:, None] * (goal - start), abs=1e-9)
    assert np.abs(velocity).max() == pytest.approx(0.2)


def goal_of(*, of_base: bool) -> PosePoints:
    turn = [[0.0, 0.0, np.sin(0.4), np.cos(0.4)]]
    return PosePoints(of_base, np.array([[0.6, 0.7, 0.0]]), np.array(turn), None)


def test_goal_of_end_effector_continues_moving_reference() -> None:
    before = np.array([
        0.3, 0.5, 0.0, 0.0, 0.2, 0.1, 0.2, 0.0, 0.0, -0.1, 0.0, 0.0,
    ])  # fmt: skip
    path = goal_of(of_base=False).task_path(ROBOT, before, SPEEDS)
    samples = path.sample(np.linspace(0.0, path.end, 1000))
    assert samples[0].tolist() == before.tolist()
    assert samples[-1, :2] == pytest.approx([0.6, 0.7])
    assert not samples[-1, 4:].any()
    # F continues forward, and stops.
    assert samples[-1, 2] == pytest.approx(0.05)
    assert samples[-1, 3] == 0.0


def test_goal_of_base_keeps_limits_of_its_joints() -> None:
    state = JointState.at_rest(np.zeros(len(ROBOT.mechanism.positions)))
    points = goal_of(of_base=True).joint_points(state, SPEEDS)
    path = JointPath(points, state, HEADING)
    samples = path.sample(np.linspace(0.0, path.end, 1000)).reshape(1000, 3, -1)
    assert samples[-1, 0, :3] == pytest.approx([0.6, 0.7, 0.8])
    linear = np.linalg.norm(samples[:, :, :2], axis=2).max(axis=0)
    assert linear[1] <= SPEEDS.linear * WITHIN
    assert linear[2] <= SPEEDS.acceleration * WITHIN
    assert np.abs(samples[:, 1, 2]).max() <= SPEEDS.angular * WITHIN
    assert np.abs(samples[:, 2, 2]).max() <= 2.0 * SPEEDS.acceleration * WITHIN
