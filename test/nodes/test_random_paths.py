# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Random paths of all kinds in a closed loop in virtual time.

MASMC_PATHS sets their number; 10000 take ten minutes.
"""

from __future__ import annotations

import os
from typing import Any

from helpers.core_loop import node_values
from helpers.followed import Array, Followed
from helpers.limited_arm import limited_arm
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import PosePoints, TwistPoints
from masmc_ros.reference.trajectory import Trajectory
import numpy as np
from numpy.random import Generator
import pytest

COUNT = int(os.environ.get('MASMC_PATHS', '160'))
PERIOD = 0.005
LATENCY = 0.01
LARGEST_ERROR = 0.2
"""Distance in m of E and F from their reference, also where the platform turns round."""

LARGEST_LAG = 0.4
"""Largest error in m or rad of a robot whose joints keep their limits."""

SETTLED = 800
"""Ticks of the start; the first path starts after them."""


def poses(draw: Generator, position: Array, count: int, *, of_base: bool) -> PathRequest:
    """Return a path of random poses within 1 m of a position of the base."""
    angles = draw.uniform(-np.pi, np.pi, count)
    quaternions = np.column_stack([
        np.zeros((count, 2)), np.sin(0.5 * angles), np.cos(0.5 * angles)
    ])
    places = np.column_stack([
        position[:2] + draw.uniform(-1.0, 1.0, (count, 2)), np.zeros(count)
    ])
    return PathRequest('poses', PosePoints(of_base, places, quaternions, None), None)


def request(draw: Generator, loop: Followed, eight: Trajectory) -> PathRequest:
    """Return a random path near the robot."""
    position = loop.plant.true_position
    kind = draw.integers(8)
    if kind == 0:
        return PathRequest('stop', None, None)
    if kind == 1:
        return PathRequest('velocities', TwistPoints(
            draw.uniform(-0.3, 0.3), 0.0, draw.uniform(-0.6, 0.6)
        ), None)  # fmt: skip
    if kind == 2:
        return PathRequest('type', eight, None)
    count = int(draw.integers(1, 5))
    if kind in (3, 4):
        # Arm joints clear of the singularity, or the base.
        columns, middle, spread = np.array([5, 6]), np.array([0.8, -1.4]), np.array([0.6, 0.5])
        if kind == 4:
            columns, middle, spread = np.arange(3), position[:3], np.array([0.5, 0.5, 0.7])
        times = np.cumsum(draw.uniform(2.0, 5.0, count))
        points = middle + spread * draw.uniform(-1.0, 1.0, (count, len(columns)))
        return PathRequest('joints', JointPoints(columns, times, points, None, None), None)
    return poses(draw, position, count, of_base=bool(kind == 5))


def values_of(
    scale: float,
    shared: dict[str, Any],
    plant: dict[str, Any] | None = None,
    **control: Any,
) -> dict[str, dict[str, Any]]:
    """Return the values of nodes with 10 ms of latency whose masses are assumed `scale` times."""
    return node_values(
        {'control_period': PERIOD, 'duration': 0.0, **shared},
        plant={'command_delay': LATENCY, **(plant or {})},
        trajectory={'horizon': 1.0},
        controller={
            'law': 'rasmc', 'switching': 'implicit', 'observer_gain': 0.55, 'latency': LATENCY,
            'model_scale': scale, 'runaway_detection': False, **control,
        },
    )


@pytest.mark.parametrize('scale', [0.5, 2.0])
def test_random_paths_reference_is_smooth_and_followed(scale: float) -> None:
    values = values_of(scale, {})
    loop = Followed(values)
    robot = loop.controller.robot
    eight = Trajectory({**values['trajectory'], 'type': 'figure_eight'}, PERIOD, robot)
    draw = np.random.default_rng(7)
    loop.follow(SETTLED * PERIOD)
    rejected = loop.take_random(COUNT // 2, lambda: request(draw, loop, eight), draw, 1.5)
    assert rejected < 0.05 * COUNT
    error = loop.errors()[SETTLED:]
    assert np.linalg.norm(error.reshape(-1, 2, 2), axis=2).max() < LARGEST_ERROR


RANGES, SPEED, EFFORTS = np.array([[-1.2, 1.0], [0.3, 2.2]]), 1.0, (16.0, 3.0)
"""Limits of an arm in rad, rad/s and N·m; gravity takes up to 12 and 1.5 N·m."""

ARM = slice(6, 8)
"""Coordinates of the arm, after those of the base and of its three drives."""


def request_in_limits(draw: Generator, loop: Followed, line: Trajectory) -> PathRequest:
    """Return a random path of an omnidirectional base and an arm, up to the limits of the arm."""
    position = loop.plant.true_position
    kind = draw.integers(8)
    if kind == 0:
        return PathRequest('stop', None, None)
    if kind == 1:
        speeds = draw.uniform(-0.3, 0.3, 2)
        return PathRequest('velocities', TwistPoints(*speeds, draw.uniform(-0.6, 0.6)), None)
    if kind == 2:
        return PathRequest('type', line, None)
    count = int(draw.integers(1, 5))
    if kind == 3:
        return poses(draw, position, count, of_base=True)
    # The whole range and a little more, and times down to the speed limit and a little below.
    lower, upper = RANGES.T
    points = 0.5 * (lower + upper) + 0.51 * (upper - lower) * draw.uniform(-1.0, 1.0, (count, 2))
    columns = np.arange(ARM.start, ARM.stop)
    if kind == 4:
        # Base and arm in one message.
        columns = np.append(np.arange(3), columns)
        places = position[:3] + draw.uniform(-0.3, 0.3, (count, 3))
        points = np.column_stack([places, points])
    way = np.abs(np.diff(points, axis=0, prepend=position[None, columns])).max(axis=1)
    times = np.cumsum((0.1 + 1.9 * way / SPEED) * draw.uniform(0.95, 1.5, count))
    return PathRequest('joints', JointPoints(columns, times, points, None, None), None)


@pytest.mark.slow
@pytest.mark.parametrize('scale', [0.5, 2.0])
def test_random_paths_stay_within_limits(scale: float) -> None:
    urdf = limited_arm(tuple(RANGES[0]), tuple(RANGES[1]), SPEED, EFFORTS)
    values = values_of(
        scale,
        {
            'robot.urdf': urdf, 'robot.base': 'omnidirectional', 'robot.task': ('joints', 'base'),
            'robot.posture': (0.0, 1.0),
        },
        {'initial_joints': (0.0, 0.0, 0.0, 0.0, 1.0)},
        joint_limits='enforce',
    )  # fmt: skip
    loop = Followed(values)
    line = Trajectory(values['trajectory'], PERIOD, loop.controller.robot)
    draw = np.random.default_rng(8)
    loop.follow(SETTLED * PERIOD)
    rejected = loop.take_random(COUNT // 2, lambda: request_in_limits(draw, loop, line), draw, 4.0)
    # Most paths are possible, and some are not.
    assert 0 < rejected < 0.4 * COUNT
    position, speed, torque = map(np.array, (loop.reached, loop.speeds, loop.torques))
    assert (position[:, ARM] >= RANGES[:, 0]).all()
    assert (position[:, ARM] <= RANGES[:, 1]).all()
    assert (np.abs(speed[:, -2:]) <= SPEED).all()
    assert (np.abs(torque[:, -2:]) <= EFFORTS).all()
    # Of the base in m, of angles in rad. While a path joins the one before, it may be faster
    # than a joint, which then lags.
    error = loop.errors()[SETTLED:]
    (heading,) = (point.axes for point in loop.controller.mechanism.points if point.is_rotation)
    error[:, heading] = np.remainder(error[:, heading] + np.pi, 2.0 * np.pi) - np.pi
    assert np.abs(error).max() < LARGEST_LAG
