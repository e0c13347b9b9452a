# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The robot seen from above: platform, wheels and arm to scale."""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.robot.declaration import Outline, Shape
from masmc_ros.robot.two_link.geometry import Geometry
import numpy as np

_WHEEL_WIDTH = 0.35
"""Width relative to a wheel's radius; no parameter has it."""


def outline(lengths: Array, position: Array) -> Outline:
    """Return the drawing of lengths (5) at one position (7) in the order of joint_states."""
    geometry = Geometry(*lengths)
    x, y, yaw = (float(value) for value in position[:3])
    b, r = geometry.half_track, geometry.wheel_radius
    half = max(abs(geometry.arm_base), r)
    wheel = r, _WHEEL_WIDTH * r
    shapes = (
        Shape('body', _place(_rectangle(0.0, half, b), x, y, yaw)),
        Shape('part', _place(_rectangle(b, *wheel), x, y, yaw)),
        Shape('part', _place(_rectangle(-b, *wheel), x, y, yaw)),
        Shape('links', arm_points(geometry, position)),
    )
    return Outline((x, y), shapes, below=b + 2.0 * r, text=2.0 * r)


def arm_points(geometry: Geometry, position: Array) -> Array:
    """Return (3, 2) world positions in m of the arm's base, its elbow and its end."""
    x, y, yaw, _, _, arm_1, arm_2 = (float(value) for value in position)
    lengths = (geometry.arm_base, geometry.link_1, geometry.link_2)
    headings = (yaw, yaw + arm_1, yaw + arm_1 + arm_2)
    steps = [
        (length * math.cos(heading), length * math.sin(heading))
        for length, heading in zip(lengths, headings, strict=True)
    ]
    points: Array = np.array([x, y]) + np.cumsum(steps, axis=0)
    return points


def _rectangle(left: float, half_length: float, half_width: float) -> Array:
    """Return the corners (4, 2) of a rectangle, `left` of the axle's middle by so many m."""
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
    corners: Array = np.array([0.0, left]) + signs * (half_length, half_width)
    return corners


def _place(points: Array, x: float, y: float, yaw: float) -> Array:
    """Move points (n, 2) from the platform's frame into the world."""
    c, s = math.cos(yaw), math.sin(yaw)
    placed: Array = points @ np.array([[c, s], [-s, c]]) + (x, y)
    return placed
