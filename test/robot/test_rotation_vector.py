# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Rotation vectors against the matrix exponential and against finite differences."""

from __future__ import annotations

from collections.abc import Callable
import math

from helpers.robots import between, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.robot.tree.task.rotation_vector import (
    angular_motion,
    orientation_error,
    orientation_error_rate,
    rotation_of,
    vector_of,
)
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

AXIS = st.builds(
    lambda z, around: (
        math.sqrt(1.0 - z * z) * math.cos(around), math.sqrt(1.0 - z * z) * math.sin(around), z
    ),
    between(-1.0, 1.0),
    between(-math.pi, math.pi),
)  # fmt: skip
ANGLE = st.one_of(
    between(0.0, math.pi),
    between(0.0, 1e-6),
    st.builds(lambda short: math.pi - short, between(0.0, 1e-6)),
    # Series are replaced by quotients at this angle.
    st.builds(lambda off: 0.5 + off, between(-1e-9, 1e-9)),
)
RATE = st.tuples(*[between(-3.0, 3.0)] * 3)
H = 1e-4


def vector(axis: tuple[float, float, float], angle: float) -> Array:
    """Return a rotation vector."""
    return angle * np.array(axis)


def hat(v: Array) -> Array:
    """Return the matrix of a cross product."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def exponential(matrix: Array) -> Array:
    """Return exp of a matrix by scaling, series and squaring."""
    small, term, total = matrix / 64.0, np.eye(3), np.eye(3)
    for k in range(1, 20):
        term = term @ small / k
        total = total + term
    for _ in range(6):
        total = total @ total
    return total


def rotation(phi: Array) -> Array:
    """Return the rotation matrix of a rotation vector."""
    return np.reshape(rotation_of(tuple(phi.tolist())), (3, 3))


def derivative(function: Callable[[float], Array]) -> Array:
    """Return the derivative at zero, by differences of fourth order."""
    inner, outer = function(H) - function(-H), function(2.0 * H) - function(-2.0 * H)
    return (8.0 * inner - outer) / (12.0 * H)


@PROPERTY
@given(AXIS, between(0.0, 6.0))
def test_rotation_equals_matrix_exponential(
    axis: tuple[float, float, float], angle: float
) -> None:
    phi = vector(axis, angle)
    assert rotation(phi) == pytest.approx(exponential(hat(phi)), abs=1e-13)


@PROPERTY
@given(AXIS, ANGLE)
def test_rotation_vector_of_rotation_is_recovered(
    axis: tuple[float, float, float], angle: float
) -> None:
    turned = rotation(vector(axis, angle))
    recovered = np.array(vector_of(tuple(turned.ravel().tolist())))
    assert np.linalg.norm(recovered) <= math.pi + 1e-12
    assert rotation(recovered) == pytest.approx(turned, abs=1e-13)
    if angle < 3.14:
        assert recovered == pytest.approx(vector(axis, angle), abs=1e-12)


@PROPERTY
@given(AXIS, between(0.0, 5.0), RATE, RATE)
def test_angular_motion_equals_derivatives_of_rotation(
    axis: tuple[float, float, float],
    angle: float,
    rate: tuple[float, float, float],
    acceleration: tuple[float, float, float],
) -> None:
    phi, first, second = vector(axis, angle), np.array(rate), np.array(acceleration)

    def at(time: float) -> tuple[Array, Array]:
        return phi + time * first + 0.5 * time * time * second, first + time * second

    def velocity(time: float) -> Array:
        where, speed = (tuple(entry.tolist()) for entry in at(time))
        return np.array(angular_motion(where, speed, acceleration)[0])

    omega, alpha = angular_motion(tuple(phi.tolist()), rate, acceleration)
    spin = derivative(lambda time: rotation(at(time)[0])) @ rotation(phi).T
    assert hat(np.array(omega)) == pytest.approx(spin, abs=1e-9)
    assert np.array(alpha) == pytest.approx(derivative(velocity), abs=1e-9)


@PROPERTY
@given(AXIS, between(0.0, 3.0), AXIS, ANGLE, RATE, RATE)
def test_orientation_error_is_axis_times_sine_of_angle(
    axis: tuple[float, float, float],
    angle: float,
    around: tuple[float, float, float],
    off: float,
    omega: tuple[float, float, float],
    desired_omega: tuple[float, float, float],
) -> None:
    desired = rotation(vector(axis, angle))
    actual = rotation(vector(around, off)) @ desired

    def error(time: float) -> Array:
        turned = exponential(time * hat(np.array(omega))) @ actual
        wanted = exponential(time * hat(np.array(desired_omega))) @ desired
        return np.array(
            orientation_error(tuple(turned.ravel().tolist()), tuple(wanted.ravel().tolist()))
        )

    assert error(0.0) == pytest.approx(math.sin(off) * np.array(around), abs=1e-13)
    error_rate = orientation_error_rate(
        tuple(actual.ravel().tolist()), omega, tuple(desired.ravel().tolist()), desired_omega
    )
    assert np.array(error_rate) == pytest.approx(derivative(error), abs=1e-9)
