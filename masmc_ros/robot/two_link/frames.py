# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Transforms of the robot's frames.

The model is planar and has no heights. This module defines them: the wheels are on the plane z = 0
of `odom`, and the links of the arm are on the platform, one above the other. `base_link` is on the
ground below the middle O of the axle. `link_1` has its origin in the base F of the arm, `link_2`
in the elbow, and `end_effector` in E. Their x and y are those of (1).
"""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.two_link.geometry import Geometry
from masmc_ros.robot.two_link.paper_robot import FRAMES
import numpy as np
from numpy.typing import ArrayLike

PLATFORM_TOP = 3.0
"""Height of the platform's upper side as a multiple of the wheels' radius."""

_THICKNESS = 0.1
"""Thickness of the links as a part of the shorter one's length."""


def link_thickness(geometry: Geometry) -> float:
    """Return the thickness of the arm's links in m, which the model does not know."""
    return _THICKNESS * min(geometry.link_1, geometry.link_2)


def frame_origins(lengths: ArrayLike) -> Array:
    """
    Return the position of each frame of FRAMES in its parent, (6, 3) in m, for lengths (5).

    Row 0 is zero: `base_link` moves in `odom`.
    """
    geometry = Geometry(*np.asarray(lengths, dtype=np.float64).tolist())
    radius, thickness = geometry.wheel_radius, link_thickness(geometry)
    origins = np.zeros((len(FRAMES), 3))
    origins[1] = 0.0, -geometry.half_track, radius
    origins[2] = 0.0, geometry.half_track, radius
    origins[3] = geometry.arm_base, 0.0, PLATFORM_TOP * radius + 0.5 * thickness
    origins[4] = geometry.link_1, 0.0, thickness
    origins[5] = geometry.link_2, 0.0, 0.0
    return origins


@kernel
def frame_transforms(origins: Array, position: Array) -> Array:
    """
    Return the transforms (n, 6, 7) of states, in the order of FRAMES.

    Parameters
    ----------
    origins
        (6, 3) as `frame_origins` returns them.
    position
        (n, 7) in the order of joint_states, m and rad.

    Returns
    -------
        Translation x, y, z in m and rotation as a quaternion x, y, z, w, child in parent.

    """
    out = np.empty((len(position), 6, 7))
    for k in range(len(position)):
        row = position[k]
        for i in range(6):
            for j in range(3):
                out[k, i, j] = origins[i, j]
            for j in range(3, 7):
                out[k, i, j] = 0.0
        out[k, 0, 0] = row[0]
        out[k, 0, 1] = row[1]
        out[k, 0, 5], out[k, 0, 6] = sin_cos(0.5 * row[2])
        # The wheels turn about y, the arm's joints about z.
        out[k, 1, 4], out[k, 1, 6] = sin_cos(0.5 * row[3])
        out[k, 2, 4], out[k, 2, 6] = sin_cos(0.5 * row[4])
        out[k, 3, 5], out[k, 3, 6] = sin_cos(0.5 * row[5])
        out[k, 4, 5], out[k, 4, 6] = sin_cos(0.5 * row[6])
        out[k, 5, 6] = 1.0
    return out
