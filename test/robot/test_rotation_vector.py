# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Rotation vectors against the exponential series of matrices, and against differences."""

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
    # Where series give way to quotients.
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
    """Return exp of a matrix by its series, of a small part of it, squared."""
    small, term, total = matrix / 64.0, np.eye(3), np.eye(3)
    for k in range(1, 20):
        term = term @ small / k
        total = total + term
    for _ in range(6):
        total = total @ total
    return total


def rotation(phi: Array) -> Array:
    """Return the rotation of a vector as a matrix."""
    return np.reshape(rotation_of(tuple(phi.tolist())), (3, 3))


def derivative(of: Callable[[float], Array]) -> Array:
    """Return the derivative at zero, by differences of fourth order."""
    return (8.0 * (of(H) - of(-H)) - (of(2.0 * H) - of(-2.0 * H))) / (12.0 * H)


@PROPERTY
@given(AXIS, between(0.0, 6.0))
def test_the_rotation_is_the_exponential(axis: tuple[float, float, float], angle: float) -> None:
    phi = vector(axis, angle)
    assert rotation(phi) == pytest.approx(exponential(hat(phi)), abs=1e-13)


@PROPERTY
@given(AXIS, ANGLE)
def test_the_vector_of_a_rotation_is_its_own(
    axis: tuple[float, float, float], angle: float
) -> None:
    turned = rotation(vector(axis, angle))
    found = np.array(vector_of(tuple(turned.ravel().tolist())))
    assert np.linalg.norm(found) <= math.pi + 1e-12
    assert rotation(found) == pytest.approx(turned, abs=1e-13)
    if angle < 3.14:
        assert found == pytest.approx(vector(axis, angle), abs=1e-12)


@PROPERTY
@given(AXIS, between(0.0, 5.0), RATE, RATE)
def test_angular_velocity_and_acceleration_are_derivatives(
    axis: tuple[float, float, float],
    angle: float,
    rate: tuple[float, float, float],
    acceleration: tuple[float, float, float],
) -> None:
    phi, first, second = vector(axis, angle), np.array(rate), np.array(acceleration)

    def at(time: float) -> tuple[Array, Array]:
        return phi + time * first + 0.5 * time * time * second, first + time * second

    def velocity(time: float) -> Array:
        where, speed = (tuple(each.tolist()) for each in at(time))
        return np.array(angular_motion(where, speed, acceleration)[0])

    omega, alpha = angular_motion(tuple(phi.tolist()), rate, acceleration)
    spin = derivative(lambda time: rotation(at(time)[0])) @ rotation(phi).T
    assert hat(np.array(omega)) == pytest.approx(spin, abs=1e-9)
    assert np.array(alpha) == pytest.approx(derivative(velocity), abs=1e-9)


@PROPERTY
@given(AXIS, between(0.0, 3.0), AXIS, ANGLE, RATE, RATE)
def test_the_orientation_error_is_an_axis_times_the_sine_of_the_angle(
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
    found = orientation_error_rate(
        tuple(actual.ravel().tolist()), omega, tuple(desired.ravel().tolist()), desired_omega
    )
    assert np.array(found) == pytest.approx(derivative(error), abs=1e-9)
