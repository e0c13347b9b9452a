# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Base pose from odometry, for joint states without base joints."""

from __future__ import annotations

import math
from typing import Protocol

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
import numpy as np

OLDEST_POSE_NS = 100_000_000
"""Largest age in ns of odometry that is extrapolated to a joint state."""

_LENGTH_ERROR = 1e-3
"""Largest error of a quaternion's length."""

MOST_TILT = 5.0
"""
Largest tilt in degrees of a base on an uneven floor.

The projection onto the plane shortens a distance by 1 - cos(5 degrees) = 0.4 %. Ramps and bumps
tilt a base by a few degrees; a larger tilt is a wrong quaternion or a robot that fell over.
"""

_JUMP = 0.01
"""Distance in m and angle in rad by which a pose jumps; smaller steps belong to its noise."""

Pose = tuple[float, float, float]
"""x and y in m, and yaw in rad."""


class Motion(Protocol):
    """Measured motion of the base, such as `robot.dead_reckoning.DeadReckoning`."""

    def motion(self, start_ns: int, end_ns: int) -> Pose | None:
        """Return the motion between two stamps in the frame at the first; None if unknown."""


class BasePose:
    """
    Latest odometry, extrapolated to the stamps of the joint states.

    Odometry has a lower rate than joint states and is older. In between, the motion is that of the
    wheels if their encoders are known, otherwise the twist is assumed constant and the base
    continues along an arc of a circle. Yaw is unwrapped and never steps by a whole turn. A
    correction moves the frame of the odometry in that of the pose, such as `map`.

    Attributes
    ----------
    stamp_ns
        the stamp of the latest odometry in ns, None before the first.
    has_jumped
        True after a jump of odometry or correction, until the user sets it to False.

    """

    def __init__(self, reckoning: Motion | None = None) -> None:
        """Initialise without a pose; `reckoning` for the motion by wheels."""
        self.stamp_ns: int | None = None
        self.has_jumped = False
        self._reckoning = reckoning
        self._pose: Pose = (0.0, 0.0, 0.0)
        self._twist: Pose = (0.0, 0.0, 0.0)
        self._correction: Pose | None = None
        self._moved_ns: int | None = None

    def update(self, stamp_ns: int, pose: Array, twist: Array) -> None:
        """
        Store a pose (7: position in m, quaternion x, y, z, w) and a twist (6) in `base_link`.

        Raises
        ------
        InputError
            If a number is not finite, or the quaternion does not have length 1 or tilts the
            base. The stored pose is then unmodified.

        """
        if not np.isfinite(twist).all():
            raise InputError('odom: a number of the pose or of the twist is not finite')
        x, y, yaw = planar_pose(pose, 'odom')
        if self.stamp_ns is not None:
            yaw = self._pose[2] + math.remainder(yaw - self._pose[2], 2.0 * math.pi)
            age = stamp_ns - self.stamp_ns
            expected = self._extrapolated(stamp_ns)
            if 0 < age <= OLDEST_POSE_NS:
                self.has_jumped |= _is_apart(expected, (x, y, yaw))
        self.stamp_ns = stamp_ns
        self._pose = x, y, yaw
        self._twist = float(twist[0]), float(twist[1]), float(twist[5])

    def correct(self, transform: Array) -> None:
        """Store the transform (7) of the odometry's frame; raise InputError like `update`."""
        x, y, yaw = planar_pose(transform, 'tf')
        before = self._correction
        if before is not None:
            yaw = before[2] + math.remainder(yaw - before[2], 2.0 * math.pi)
        one, self._correction = self._corrected(self._pose), (x, y, yaw)
        if before is not None:
            self.has_jumped |= _is_apart(one, self._corrected(self._pose))

    def write(
        self, stamp_ns: int, position: Array, velocity: Array
    ) -> None:
        """Write x, y, yaw and their rates in the world at a stamp into the first three."""
        x, y, yaw = self._corrected(self._extrapolated(stamp_ns))
        position[0], position[1], position[2] = x, y, yaw
        forward, left, turn = self._twist
        c, s = math.cos(yaw), math.sin(yaw)
        velocity[0] = c * forward - s * left
        velocity[1] = s * forward + c * left
        velocity[2] = turn

    def write_motion(
        self, stamp_ns: int, position: Array, velocity: Array
    ) -> None:
        """Write way and velocity of an omnidirectional base, in its own frame, after the pose."""
        time = max(0.0, (stamp_ns - (self._moved_ns or stamp_ns)) * 1e-9)
        self._moved_ns = stamp_ns
        velocity[3:6] = self._twist
        position[3:6] += time * velocity[3:6]

    def _extrapolated(self, stamp_ns: int) -> Pose:
        start = self.stamp_ns or 0
        motion = None if self._reckoning is None else self._reckoning.motion(start, stamp_ns)
        if motion is None:
            motion = _arc(self._twist, (stamp_ns - start) * 1e-9)
        return _composed(self._pose, motion)

    def _corrected(self, pose: Pose) -> Pose:
        return pose if self._correction is None else _composed(self._correction, pose)


def planar_pose(pose: Array, topic: str) -> Pose:
    """Return x, y and yaw of a pose (7), without its small tilt; raise InputError otherwise."""
    if not np.isfinite(pose).all():
        raise InputError(f'{topic}: a number of the pose or of the twist is not finite')
    x, y, z, w = pose[3:].tolist()
    text = f'{topic}: quaternion [{x:g}, {y:g}, {z:g}, {w:g}]'
    if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) > _LENGTH_ERROR:
        raise InputError(f'{text} has not length 1')
    tilt = math.degrees(2.0 * math.asin(min(1.0, math.hypot(x, y))))
    if tilt > MOST_TILT:
        raise InputError(
            f'{text} tilts the platform by {tilt:.3g} degrees; expected at most {MOST_TILT:g}'
        )
    return float(pose[0]), float(pose[1]), 2.0 * math.atan2(z, w)


def _arc(twist: Pose, time: float) -> Pose:
    """Return the motion with a constant twist for a time in s."""
    forward, left, turn = twist
    half = 0.5 * turn * time
    # The chord has the direction of the middle of the arc, and its length times sinc.
    chord = time * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    c, s = math.cos(half), math.sin(half)
    return chord * (c * forward - s * left), chord * (s * forward + c * left), 2.0 * half


def _composed(pose: Pose, motion: Pose) -> Pose:
    """Return a pose after a motion in its own frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y, yaw = motion
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y, pose[2] + yaw


def _is_apart(one: Pose, other: Pose) -> bool:
    """Return True if two poses differ by a jump."""
    turn = math.remainder(one[2] - other[2], 2.0 * math.pi)
    return max(math.dist(one[:2], other[:2]), abs(turn)) > _JUMP
