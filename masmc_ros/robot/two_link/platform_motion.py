# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The platform's pose and twist as odometry reports them."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.scratch import clear
from masmc_ros.numerics.portable_math import sin_cos
import numpy as np
from numpy.typing import NDArray


@kernel
def base_motion(
    position: Array, velocity: Array
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return poses (n, 7) and twists (n, 6) of states, positions and velocities (n, 7).

    Pose: x, y, z of `base_link` in `odom` in m and a quaternion x, y, z, w. Twist in
    `base_link`: linear in m/s, angular in rad/s.
    """
    n = len(position)
    pose, twist = np.empty((n, 7)), np.empty((n, 6))
    clear(pose)
    clear(twist)
    for k in range(n):
        pose[k, 0] = position[k, 0]
        pose[k, 1] = position[k, 1]
        pose[k, 5], pose[k, 6] = sin_cos(0.5 * position[k, 2])
        s, c = sin_cos(position[k, 2])
        twist[k, 0] = velocity[k, 0] * c + velocity[k, 1] * s
        twist[k, 5] = velocity[k, 2]
    return pose, twist
