# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Platform pose from odometry, for joint states without base joints."""

from __future__ import annotations

import math

from masmc_ros.errors import InputError
import numpy as np
from numpy.typing import NDArray

OLDEST_POSE_NS = 100_000_000
"""Largest age in ns of odometry that is extrapolated to a joint state."""

_FLAT = 1e-3
"""Largest tilt, as the sine of half its angle, and largest error of a quaternion's length."""


class BasePose:
    """
    Latest odometry, extrapolated to the stamps of the joint states.

    Odometry has a lower rate than joint states. In between the twist is assumed constant, so the
    platform continues along an arc of a circle. Yaw is unwrapped and never steps by a whole turn.

    Attributes
    ----------
    stamp_ns
        the stamp of the latest odometry in ns, None before the first.

    """

    def __init__(self) -> None:
        """Initialise without a pose."""
        self.stamp_ns: int | None = None
        self._x = self._y = self._yaw = 0.0
        self._forward = self._left = self._turn = 0.0

    def update(self, stamp_ns: int, pose: NDArray[np.float64], twist: NDArray[np.float64]) -> None:
        """
        Store a pose (7: position in m, quaternion x, y, z, w) and a twist (6) in `base_link`.

        Raises
        ------
        InputError
            If a number is not finite, or the quaternion does not have length 1 or tilts the
            platform. The stored pose is then unmodified.

        """
        if not (np.isfinite(pose).all() and np.isfinite(twist).all()):
            raise InputError('odom: a number of the pose or of the twist is not finite')
        x, y, z, w = pose[3:].tolist()
        if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) > _FLAT:
            raise InputError(f'odom: quaternion [{x:g}, {y:g}, {z:g}, {w:g}] has not length 1')
        if math.hypot(x, y) > _FLAT:
            raise InputError(
                f'odom: quaternion [{x:g}, {y:g}, {z:g}, {w:g}] tilts the platform; it takes a '
                'rotation about z'
            )
        yaw = 2.0 * math.atan2(z, w)
        if self.stamp_ns is not None:
            yaw = self._yaw + math.remainder(yaw - self._yaw, 2.0 * math.pi)
        self.stamp_ns = stamp_ns
        self._x, self._y, self._yaw = float(pose[0]), float(pose[1]), yaw
        self._forward, self._left = float(twist[0]), float(twist[1])
        self._turn = float(twist[5])

    def write(
        self, stamp_ns: int, position: NDArray[np.float64], velocity: NDArray[np.float64]
    ) -> None:
        """Write x_O, y_O, yaw and their rates in the world at a stamp into the first three."""
        time = (stamp_ns - (self.stamp_ns or 0)) * 1e-9
        half = 0.5 * self._turn * time
        # The chord has the direction of the middle of the arc, and its length times sinc.
        chord = time * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        c, s = math.cos(self._yaw + half), math.sin(self._yaw + half)
        position[0] = self._x + chord * (c * self._forward - s * self._left)
        position[1] = self._y + chord * (s * self._forward + c * self._left)
        yaw = self._yaw + 2.0 * half
        c, s = math.cos(yaw), math.sin(yaw)
        position[2] = yaw
        velocity[0] = c * self._forward - s * self._left
        velocity[1] = s * self._forward + c * self._left
        velocity[2] = self._turn
