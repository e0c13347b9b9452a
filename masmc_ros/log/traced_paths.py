# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Paths of the robot's first point, for viewers: where it is to go, and where it has been.

Live nodes and computed logs make them with the same functions, so that they are the same
bytes. They lie at the height of its frame. A robot whose task is no place has none.
"""

from __future__ import annotations

from collections import deque

from masmc_ros.loop.timing import Timing
from masmc_ros.messages.path import path_message
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.declaration import ODOM_FRAME
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

MOST_POSES = 1000
"""The largest number of poses in a path."""

POSE_PERIOD = 0.05
"""Time between two poses of the path that was driven, in s."""

_SENT_PERIOD = 0.5
"""Time between two messages of the path that was driven, in s."""


_Pose = tuple[int, float, float, float]
"""Stamp in ns and position in m."""


def thinned(last: int, most: int = MOST_POSES) -> NDArray[np.int64]:
    """Return at most `most` ticks of 0 ... last, equally far apart, both ends among them."""
    step = -(-last // (most - 1))
    return np.array([*range(0, last, max(1, step)), last], dtype=np.int64)


def pose_stride(timing: Timing) -> int:
    """Return how many ticks apart the poses of a path that goes on are."""
    return max(1, round(POSE_PERIOD / timing.period))


class DesiredPath:
    """Where the point is to go, by the trajectory."""

    def __init__(self, timing: Timing, robot: Robot, frame_prefix: str = '') -> None:
        """Take the control grid, the robot and the prefix of the frames' names."""
        self._timing = timing
        self._height, self._axes = robot.height, _axes(robot)
        self._frame = frame_prefix + ODOM_FRAME
        self._recent: deque[_Pose] = deque(maxlen=MOST_POSES)

    def whole(self, trajectory: Trajectory, origin_ns: int = 0) -> bytes | None:
        """
        Return the whole path as a message; None for an endless one, and where there is none.

        Parameters
        ----------
        trajectory
            what is followed.
        origin_ns
            stamp at which it begins, in ns.

        """
        if self._timing.last is None or self._axes is None:
            return None
        ticks = thinned(self._timing.last)
        points = np.full((len(ticks), 3), self._height)
        points[:, :2] = trajectory.positions(ticks)[:, self._axes]
        stamps = origin_ns + np.array([self._timing.stamp(tick) for tick in ticks.tolist()])
        return path_message(self._frame, int(stamps[0]), stamps, points)

    def piece(self, stamp_ns: int, starts_ns: int, samples: NDArray[np.float64]) -> bytes | None:
        """
        Add what is sent of a trajectory, and return its latest piece as a message, if any.

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
        for tick in range(0, len(samples), pose_stride(self._timing)):
            x, y = samples[tick, self._axes].tolist()
            _add(self._recent, (starts_ns + self._timing.stamp(tick), x, y, self._height))
        return _message(self._frame, stamp_ns, self._recent)


class ActualPath:
    """Where the point has been: its latest poses."""

    def __init__(self, timing: Timing, robot: Robot, frame_prefix: str = '') -> None:
        """Take the control grid, the robot and the prefix of the frames' names."""
        self._timing = timing
        self._robot = robot
        self._height, self._axes = robot.height, _axes(robot)
        self._frame = frame_prefix + ODOM_FRAME
        self._stride = pose_stride(timing)
        self._sent_stride = max(1, round(_SENT_PERIOD / timing.period))
        self._poses: deque[_Pose] = deque(maxlen=MOST_POSES)

    def takes(self, tick: int) -> bool:
        """Tell whether the path has a pose of this tick: others need not be added."""
        is_due = tick % self._stride == 0 or tick % self._sent_stride == 0 or self._is_last(tick)
        return is_due and self._axes is not None

    def add(self, tick: int, position: NDArray[np.float64]) -> bytes | None:
        """
        Add the state of a tick that it takes.

        Parameters
        ----------
        tick
            number of the tick; with a smaller one than before the path goes on from there.
        position
            in the order of joint_states.

        Returns
        -------
            The path as a message, with the tick's stamp, where it is due.

        """
        stamp = self._timing.stamp(tick)
        x, y = self._robot.task_positions(position[None])[0, self._axes].tolist()
        _add(self._poses, (stamp, x, y, self._height))
        if tick % self._sent_stride and not self._is_last(tick):
            return None
        return _message(self._frame, stamp, self._poses)

    def _is_last(self, tick: int) -> bool:
        return tick == self._timing.last


def _axes(robot: Robot) -> slice | None:
    """Return which axes of the task are x and y of the first point that is a place."""
    return next((point.axes for point in robot.mechanism.places), None)


def _add(poses: deque[_Pose], pose: _Pose) -> None:
    """Add a pose; where time was set back, instead of those that came later."""
    while poses and poses[-1][0] >= pose[0]:
        poses.pop()
    poses.append(pose)


def _message(frame: str, stamp_ns: int, poses: deque[_Pose]) -> bytes:
    stamps = np.array([pose[0] for pose in poses], dtype=np.int64)
    points = np.array([pose[1:] for pose in poses]).reshape(-1, 3)
    return path_message(frame, stamp_ns, stamps, points)
