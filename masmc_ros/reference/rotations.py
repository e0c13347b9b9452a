# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Rotation vectors of quaternions, and vectors that continue others.

A rotation has many vectors, which differ by whole turns about its axis; q and -q are one rotation.
A path has the vector next to that before, so it takes the shorter way and never unwinds.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.portable_math import angle_of
from masmc_ros.robot.declaration import Mechanism, Point
import numpy as np

_TURN = 2.0 * math.pi

_NO_AXIS = 1e-9
"""Angle in rad below which a rotation has no axis."""

_UNIT = 1e-2
"""Largest deviation of the length of a quaternion from 1."""


def orientation_of(mechanism: Mechanism) -> Point | None:
    """Return the task axes that are a rotation vector; None if the task has none."""
    rotations = (p for p in mechanism.points if p.is_rotation and p.size == 3)
    return next(rotations, None)


def continued_vectors(quaternions: Array, start: Array, noun: str) -> Array:
    """
    Return rotation vectors (n, 3) of quaternions, each next to that before.

    Parameters
    ----------
    quaternions
        Orientations (n, 4) as x, y, z, w.
    start
        Rotation vector (3) that the first one is next to.
    noun
        Name of a row in errors.

    Raises
    ------
    InputError
        If a quaternion is not of unit length.

    """
    check_unit(quaternions, noun)
    return all_continued(rotation_vectors(np.ascontiguousarray(quaternions)), start)


def check_unit(quaternions: Array, noun: str) -> None:
    """Raise InputError for quaternions (n, 4) without unit length; `noun` names a row."""
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = ~(np.abs(lengths - 1.0) < _UNIT)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f'{noun} {row + 1} has a quaternion of length {lengths[row]:.3g}; expected 1, such as '
            'x 0, y 0, z 0, w 1'
        )


@kernel
def rotation_vectors(quaternions: Array) -> Array:
    """Return the vectors (n, 3) of at most half a turn of quaternions (n, 4) as x, y, z, w."""
    vectors = np.empty((len(quaternions), 3))
    for row in range(len(quaternions)):
        x, y, z, w = quaternions[row]
        sign = -1.0 if w < 0.0 else 1.0
        sine = math.sqrt(x * x + y * y + z * z)
        length = math.sqrt(sine * sine + w * w)
        # The quotient of a small angle and its sine is 2.
        scale = 2.0 / length
        if sine > _NO_AXIS * length:
            scale = 2.0 * angle_of(sine / length, sign * w / length) / sine
        vectors[row, 0] = sign * scale * x
        vectors[row, 1] = sign * scale * y
        vectors[row, 2] = sign * scale * z
    return vectors


@kernel
def all_continued(vectors: Array, start: Array) -> Array:
    """
    Return vectors (n, 3) of rotations, each next to that before, the first to `start` (3).

    The vectors are overwritten. One of nearly zero length has no axis; it gets that of the vector
    before and whole turns.
    """
    size = len(start)
    last = start.copy()
    for row in range(len(vectors)):
        square, along, reached = 0.0, 0.0, 0.0
        for i in range(size):
            square += vectors[row, i] * vectors[row, i]
            along += vectors[row, i] * last[i]
            reached += last[i] * last[i]
        angle, reached = math.sqrt(square), math.sqrt(reached)
        if angle > _NO_AXIS:
            turns = round((along / angle - angle) / _TURN)
            for i in range(size):
                vectors[row, i] *= 1.0 + turns * _TURN / angle
        elif reached > 0.5 * _TURN:
            turns = round(reached / _TURN)
            for i in range(size):
                vectors[row, i] = last[i] * (turns * _TURN / reached)
        for i in range(size):
            last[i] = vectors[row, i]
    return vectors


def continued_near(vectors: Array, near: Array) -> Array:
    """
    Return the rotation vectors (..., 3) of the same rotations that are next to others.

    Angles about one axis (..., 1) are vectors of one entry. Vectors of nearly zero length have no
    axis; they get that of the others, and whole turns.
    """
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    reached = np.linalg.norm(near, axis=-1, keepdims=True)
    has_axis = angle > _NO_AXIS
    axis = np.where(has_axis, vectors, near) / np.where(has_axis, angle, np.maximum(reached, 1.0))
    turns = np.rint(((near * axis).sum(axis=-1, keepdims=True) - angle) / _TURN)
    result: Array = vectors + turns * _TURN * axis
    return result
