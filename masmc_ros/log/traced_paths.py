# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Desired and actual path of the robot's first point, for viewers.

Live nodes and computed logs use the same functions, so their messages are bitwise identical. The
paths have the height of the point if the task contains it, otherwise that of the point's frame.
A robot whose task is not a position has no paths.
"""

from __future__ import annotations

from collections import deque

from masmc_ros.aliases import Array, Integers
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.path import path_message
from masmc_ros.reference.reference import SampledTrajectory
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.declaration import ODOM_FRAME
from masmc_ros.robot.robot import Robot
import numpy as np

MOST_POSES = 1000
"""Maximum number of poses in a path."""

POSE_PERIOD = 0.05
"""Time between two poses of the actual path in s."""

_SENT_PERIOD = 0.5
"""Time between two messages of the actual path in s."""

_Pose = tuple[int, float, float, float]
"""Stamp in ns and position in m."""


def thinned(last: int, most: int = MOST_POSES) -> Integers:
    """Return at most `most` equidistant ticks of 0 ... last, both ends included."""
    step = -(-last // (most - 1))
    return np.array([*range(0, last, max(1, step)), last], dtype=np.int64)


class _TracedPath:
    """Latest poses of the first point."""

    def __init__(
        self, timing: Timing, robot: Robot, frame_prefix: str = '', frame: str = ''
    ) -> None:
        """
        Initialise the path.

        Parameters
        ----------
        timing
            control grid.
        robot
            the robot.
        frame_prefix
            prefix of the names of its frames.
        frame
            frame of the path; empty: that of odometry.

        """
        self._timing, self._robot = timing, robot
        self._height = robot.height
        # Axes of the task that are x and y, or x, y and z, of the first point that is a position.
        self._axes = next((point.axes for point in robot.mechanism.places), None)
        self._frame = frame or frame_prefix + ODOM_FRAME
        self._stride, self._sent_stride = (
            max(1, round(period / timing.period)) for period in (POSE_PERIOD, _SENT_PERIOD)
        )
        self._poses: deque[_Pose] = deque(maxlen=MOST_POSES)

    def _positions(self, task: Array, axes: slice) -> Array:
        """Return the positions (n, 3) of the point in m from task coordinates (n, ...)."""
        positions = np.full((len(task), 3), self._height)
        positions[:, :axes.stop - axes.start] = task[:, axes]
        return positions

    def _add(self, stamp_ns: int, x: float, y: float, z: float) -> None:
        """Add a pose; after a reset of time it replaces later ones."""
        while self._poses and self._poses[-1][0] >= stamp_ns:
            self._poses.pop()
        self._poses.append((stamp_ns, x, y, z))

    def _message(self, stamp_ns: int) -> bytes:
        stamps = np.array([pose[0] for pose in self._poses], dtype=np.int64)
        points = np.array([pose[1:] for pose in self._poses]).reshape(-1, 3)
        return path_message(self._frame, stamp_ns, stamps, points)


class DesiredPath(_TracedPath):
    """Path of the point by the trajectory."""

    def whole(
        self, trajectory: Trajectory | SampledTrajectory, origin_ns: int = 0
    ) -> bytes | None:
        """
        Return the whole path as a message; None for an endless one, or without a position task.

        Parameters
        ----------
        trajectory
            the trajectory.
        origin_ns
            stamp of its start in ns.

        """
        if self._timing.last is None or self._axes is None:
            return None
        ticks = thinned(self._timing.last)
        points = self._positions(trajectory.positions(ticks), self._axes)
        stamps = origin_ns + np.array([self._timing.stamp(tick) for tick in ticks.tolist()])
        return path_message(self._frame, int(stamps[0]), stamps, points)

    def piece(self, stamp_ns: int, starts_ns: int, samples: Array) -> bytes | None:
        """
        Add samples of a trajectory, and return its latest piece as a message, if there is one.

        Parameters
        ----------
        stamp_ns
            stamp of the message, the robot's time, in ns.
        starts_ns
            stamp of the first sample in ns.
        samples
            (n, 3 axes) at consecutive ticks.

        """
        if self._axes is None:
            return None
        points = self._positions(samples[::self._stride], self._axes).tolist()
        for number, point in enumerate(points):
            self._add(starts_ns + self._timing.stamp(number * self._stride), *point)
        return self._message(stamp_ns)


class ActualPath(_TracedPath):
    """Path of the point in the past."""

    def takes(self, tick: int) -> bool:
        """Return True if the path has a pose of this tick; others need not be added."""
        is_due = tick % self._stride == 0 or self._is_sent(tick)
        return is_due and self._axes is not None

    def add(self, tick: int, position: Array) -> bytes | None:
        """
        Add the state of a tick that the path takes.

        Parameters
        ----------
        tick
            number of the tick; after a smaller one than before, the path continues from there.
        position
            joint positions in the order of joint_states.

        Returns
        -------
            The path as a message with the tick's stamp, if one is due.

        """
        assert self._axes is not None  # see `takes`
        stamp = self._timing.stamp(tick)
        task = self._robot.task_positions(position[None])
        self._add(stamp, *self._positions(task, self._axes)[0].tolist())
        return self._message(stamp) if self._is_sent(tick) else None

    def _is_sent(self, tick: int) -> bool:
        """Return True if a message is due at a tick."""
        return tick % self._sent_stride == 0 or tick == self._timing.last
