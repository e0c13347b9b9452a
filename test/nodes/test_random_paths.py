# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Random paths of all kinds in a closed loop in virtual time.

MASMC_PATHS sets their number; 10000 take 80 s.
"""

from __future__ import annotations

import os
import time
from typing import Any

from helpers.core_loop import CoreLoop, node_values
from masmc_ros.errors import InputError
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import PosePoints
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.reference.twist_path import TwistPoints
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

COUNT = int(os.environ.get('MASMC_PATHS', '160'))
PERIOD = 0.005
LATENCY = 0.01
LARGEST_ERROR = 0.2
"""Distance in m of E and F from their reference, also where the platform turns round."""

SETTLED = 800
"""Ticks of the start; the first path starts after them."""


class Followed(CoreLoop):
    """Closed loop whose reference continues with paths."""

    def __init__(self, values: dict[str, dict[str, Any]]) -> None:
        """Initialise the loop from checked values by node."""
        super().__init__(values)
        robot = self.controller.robot
        self.paths = ReceivedPaths(self.trajectory, robot, self.timing, values['trajectory'])
        # The trajectory of the parameters is part of the paths.
        self.trajectory = self.paths  # type: ignore[assignment]  # only `sample` is used
        self.used: list[Array] = []
        self.reached: list[Array] = []

    def take(self, request: PathRequest) -> None:
        """Start a path a lead after the current tick, and send its samples; may raise."""
        self.paths.wait(request, unsent=self._sent, tick=self.tick, origin_ns=0)
        deadline = time.monotonic() + 60.0
        while self.paths.is_loading:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        first = self.paths.start(self.tick, self.plant.position.copy())
        assert first is not None
        self._sent = first
        self.send_reference()

    def follow(self, seconds: float) -> None:
        """Advance, and keep the samples of the reference that were used."""
        for _ in range(round(seconds / self.period)):
            self.step()
            self.used.append(np.array(self.core.windows.at(self.timing.stamp(self.tick - 1))))
            self.reached.append(self.plant.true_position.copy())


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
    of_base = bool(kind == 5)
    angles = draw.uniform(-np.pi, np.pi, count)
    quaternions = np.column_stack([
        np.zeros((count, 2)), np.sin(0.5 * angles), np.cos(0.5 * angles)
    ])
    places = np.column_stack([
        position[:2] + draw.uniform(-1.0, 1.0, (count, 2)), np.zeros(count)
    ])
    return PathRequest('poses', PosePoints(of_base, places, quaternions, None), None)


@pytest.mark.parametrize('scale', [0.5, 2.0])
def test_random_paths_reference_is_smooth_and_followed(scale: float) -> None:
    values = node_values(
        {'control_period': PERIOD, 'duration': 0.0},
        plant={'command_delay': LATENCY},
        trajectory={'horizon': 1.0},
        controller={
            'law': 'rasmc', 'switching': 'implicit', 'observer_gain': 0.55, 'latency': LATENCY,
            'model_scale': scale, 'runaway_detection': False,
        },
    )
    loop = Followed(values)
    robot = loop.controller.robot
    eight = Trajectory({**values['trajectory'], 'type': 'figure_eight'}, PERIOD, robot)
    draw = np.random.default_rng(7)
    loop.follow(SETTLED * PERIOD)
    rejected = 0
    for number in range(COUNT // 2):
        try:
            loop.take(request(draw, loop, eight))
        except InputError as error:
            rejected += 1
            assert '\n' not in str(error)
        loop.follow(draw.uniform(0.1, 1.5))
        assert loop.state == 'active', (number, loop.reports[-3:])
    samples, positions = np.array(loop.used), np.array(loop.reached)
    assert np.isfinite(samples).all()
    assert rejected < 0.05 * COUNT
    x, velocity, _ = np.split(samples, 3, axis=1)
    step = np.diff(x, axis=0) - 0.5 * PERIOD * (velocity[1:] + velocity[:-1])
    assert np.abs(step).max() < 1e-5
    # A position is that after the period.
    error = robot.task_positions(positions)[:-1] - x[1:]
    assert np.linalg.norm(error[SETTLED:].reshape(-1, 2, 2), axis=2).max() < LARGEST_ERROR
