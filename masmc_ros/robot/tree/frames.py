# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Transforms of the link frames of a URDF: one for each joint, and one for the base."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.tree.spatial import inner, Rotation, Vector
from masmc_ros.robot.tree.task.rotation_vector import vector_of
import numpy as np
from numpy.typing import NDArray

Quaternion = tuple[float, float, float, float]

_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

STANDS, TURNS, SLIDES, BASE = 0, 1, 2, 3
"""Motion of a frame in its parent."""


class Frames(NamedTuple):
    """Poses of frames in their parents with joints at zero, and their motion."""

    origin: Array
    """(F, 7) translation in m, quaternion x, y, z, w."""
    axis: Array
    """(F, 3) unit axis in the frame."""
    motion: NDArray[np.int64]
    """(F) one of STANDS, TURNS, SLIDES, BASE."""
    place: NDArray[np.int64]
    """(F) index of the position that moves it."""
    multiplier: Array
    """(F) motion per that position, 1 unless its joint mimics another one."""


def pose(rotation: Rotation, offset: Sequence[float]) -> Array:
    """Return a row of `Frames.origin`."""
    phi = vector_of(rotation)
    angle = float(np.sqrt(inner(phi, phi)))
    sine, cosine = sin_cos(0.5 * angle)
    part = sine / angle if angle else 0.0
    return np.array([*offset, phi[0] * part, phi[1] * part, phi[2] * part, cosine])


@formula
def _combined(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the product of two quaternions x, y, z, w."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@formula
def _turned(q: Quaternion, v: Vector) -> Vector:
    """Return a vector turned by a quaternion."""
    rotated = _combined(_combined(q, (v[0], v[1], v[2], 0.0)), (-q[0], -q[1], -q[2], q[3]))
    return rotated[0], rotated[1], rotated[2]


@kernel
def transforms(frames: Frames, position: Array) -> Array:
    """
    Return translations in m and quaternions x, y, z, w of all frames in their parents.

    Parameters
    ----------
    frames
        Frames, F in number.
    position
        (n, positions): x, y and yaw of the base, then wheels and joints.

    Returns
    -------
        (n, F, 7).

    """
    n, count = len(position), len(frames.motion)
    out = np.empty((n, count, 7))
    for k in range(n):
        for i in range(count):
            origin, motion = frames.origin[i], frames.motion[i]
            for j in range(7):
                out[k, i, j] = origin[j]
            q = (origin[3], origin[4], origin[5], origin[6])
            along = (frames.axis[i, 0], frames.axis[i, 1], frames.axis[i, 2])
            if motion == BASE:
                out[k, i, 0], out[k, i, 1] = position[k, 0], position[k, 1]
                out[k, i, 5], out[k, i, 6] = sin_cos(0.5 * position[k, 2])
            elif motion == TURNS:
                s, c = sin_cos(0.5 * (frames.multiplier[i] * position[k, frames.place[i]]))
                q = _combined(q, (s * along[0], s * along[1], s * along[2], c))
                for j in range(4):
                    out[k, i, 3 + j] = q[j]
            elif motion == SLIDES:
                far = frames.multiplier[i] * position[k, frames.place[i]]
                moved = _turned(q, (far * along[0], far * along[1], far * along[2]))
                for j in range(3):
                    out[k, i, j] += moved[j]
    return out


def world_of(pairs: Sequence[tuple[str, str]], transforms: Array) -> list[tuple[Array, Array]]:
    """
    Return rotation (3, 3) and origin (3) in the world of every child.

    Parameters
    ----------
    pairs
        Parent and child of the frames, parents first.
    transforms
        (F, 7) of one position, as `transforms` returns them.

    """
    known = {pairs[0][0]: (np.eye(3), np.zeros(3))}
    poses = []
    for (parent, child), row in zip(pairs, transforms, strict=True):
        r, p = known[parent]
        quaternion = tuple(row[3:].tolist())
        own = np.array([_turned(quaternion, unit) for unit in _UNITS]).T
        known[child] = r @ own, p + r @ row[:3]
        poses.append(known[child])
    return poses
