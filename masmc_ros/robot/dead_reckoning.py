# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of the base by the encoders of its wheels."""

from __future__ import annotations

from bisect import bisect_left
import math

from masmc_ros.aliases import Array, Records
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.tuples import elementwise, tail
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.numerics.scalars import minus
from masmc_ros.params.declaration import Values
from masmc_ros.robot import mechanism
from masmc_ros.robot.base_pose import OLDEST_POSE_NS, Pose
from masmc_ros.robot.robot import Robot
import numpy as np


@kernel
def _reckon(body: Records, turned: Array, pose: Array) -> None:
    """Move a pose (3) by a rotation of the joints (joints)."""
    robot = lane_of(body[0], 0)
    model = mechanism.model_of(robot)
    angles = to_vector(turned, robot.rates)
    pose[0], pose[1], pose[2] = mechanism.dead_reckoned(model, (pose[0], pose[1], pose[2]), angles)
    check_workspace(robot)


def has_odometry(values: Values) -> bool:
    """Return True if the wheels of a robot determine its pose: of a base on two wheels."""
    return bool(values.get('robot.base', 'differential') == 'differential')


@kernel
def odometry(
    settings: Records, signals: Records, before: Array, position: Array, velocity: Array
) -> int:
    """
    Write the pose of a base on two wheels and its derivative; return 0.

    The wheels roll without slip; see `mechanism.dead_reckoned`.

    Parameters
    ----------
    settings, signals
        Records of the controller; the signals are not changed.
    before
        Positions (positions) of the last state, with the pose in m and rad.
    position
        Measured positions of wheels and joints at the last entries (positions); the pose is
        written into the first ones.
    velocity
        Their velocities (positions); those of the pose are written.

    """
    row = lane_of(signals[0], 0)
    model = mechanism.model_of(lane_of(settings[0], 0))
    start = to_vector(before, row.position)
    now = tail(to_vector(position, start), row.torque)
    turned = elementwise(minus, now, tail(start, row.torque))
    pose = mechanism.dead_reckoned(model, (before[0], before[1], before[2]), turned)
    position[0], position[1], position[2] = pose
    posture = mechanism.posture(model, to_vector(position, start))
    rates = tail(to_vector(velocity, start), row.torque)
    motion = mechanism.position_rates(model, posture, rates)
    velocity[0], velocity[1], velocity[2] = motion[0], motion[1], motion[2]
    check_workspace(row)
    return 0


class DeadReckoning:
    """Motion of the base by its wheels' encoders over the last tenths of a second."""

    def __init__(self, robot: Robot) -> None:
        """Initialise without a motion."""
        self._body = robot.body
        self._count = len(robot.mechanism.joints)
        self._stamps: list[int] = []
        self._poses: list[Pose] = []
        self._angles = np.zeros(self._count)

    def add(self, stamp_ns: int, position: Array) -> None:
        """Add the positions (positions) of a joint state."""
        angles = position[-self._count:]
        pose = np.zeros(3)
        if self._stamps and stamp_ns > self._stamps[-1]:
            pose[:] = self._poses[-1]
            _reckon(self._body, angles - self._angles, pose)
        else:
            self._stamps.clear()
            self._poses.clear()
        self._angles[:] = angles
        self._stamps.append(stamp_ns)
        self._poses.append((float(pose[0]), float(pose[1]), float(pose[2])))
        # The next odometry may be older than the last one that a state could use.
        if stamp_ns - self._stamps[0] > 4 * OLDEST_POSE_NS:
            old = bisect_left(self._stamps, stamp_ns - 2 * OLDEST_POSE_NS)
            del self._stamps[:old], self._poses[:old]

    def motion(self, start_ns: int, end_ns: int) -> Pose | None:
        """Return the motion between two stamps in the frame at the first; None if unknown."""
        start, end = self._at(start_ns), self._at(end_ns)
        if start is None or end is None:
            return None
        c, s = math.cos(start[2]), math.sin(start[2])
        x, y = end[0] - start[0], end[1] - start[1]
        return c * x + s * y, c * y - s * x, end[2] - start[2]

    def _at(self, stamp_ns: int) -> Pose | None:
        k = bisect_left(self._stamps, stamp_ns)
        if k == len(self._stamps):
            return None
        if self._stamps[k] == stamp_ns:
            return self._poses[k]
        if k == 0:
            return None
        before, after = self._stamps[k - 1:k + 1]
        part = (stamp_ns - before) / (after - before)
        pairs = zip(self._poses[k - 1], self._poses[k], strict=True)
        x, y, yaw = (one + part * (other - one) for one, other in pairs)
        return x, y, yaw
