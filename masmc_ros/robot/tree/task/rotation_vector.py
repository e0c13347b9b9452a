# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Rotations by their rotation vectors: phi, the axis times the angle in rad, in the world's frame.

A path of orientations is three coordinates that move smoothly, as positions do; the rotation is
R = exp(phi^). The angular velocity is omega = J_l(phi) phidot, where J_l is the left Jacobian of
SO(3) (Chirikjian, "Stochastic Models, Information Theory, and Lie Groups", 2012). It is singular
only at angles of whole turns. A path may therefore continue beyond half a turn.
"""

from __future__ import annotations

import math

from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.portable_math import angle_of, sin_cos
from masmc_ros.robot.tree.spatial import add, cross, inner, Rotation, scale, Vector

_SERIES = 0.25
"""Square of the angle below which quotients by it are computed by their series."""


@formula
def _nested(q: float, a: float, b: float, c: float, d: float) -> float:
    return 1.0 - q / a * (1.0 - q / b * (1.0 - q / c * (1.0 - q / d)))


@formula
def _coefficients(square: float) -> tuple[float, float, float, float, float]:
    """
    Return sin t / t, a = (1 - cos t) / t^2, b = (t - sin t) / t^3, a' / t and b' / t.

    `square` is t^2; the primes are derivatives by t.
    """
    if square < _SERIES:
        q = square
        s = 1.0 - q / 6.0 * _nested(q, 20.0, 42.0, 72.0, 110.0)
        a = 0.5 * (1.0 - q / 12.0 * _nested(q, 30.0, 56.0, 90.0, 132.0))
        b = (1.0 - q / 20.0 * _nested(q, 42.0, 72.0, 110.0, 156.0)) / 6.0
        da = -1.0 / 12.0 + q * (
            1.0 / 180.0 - q * (1.0 / 6720.0 - q * (1.0 / 453600.0 - q / 47900160.0))
        )
        db = -1.0 / 60.0 + q * (
            1.0 / 1260.0 - q * (1.0 / 60480.0 - q * (1.0 / 4989600.0 - q / 622702080.0))
        )
        return s, a, b, da, db
    t = math.sqrt(square)
    sine, cosine = sin_cos(t)
    s = sine / t
    a = (1.0 - cosine) / square
    b = (1.0 - s) / square
    return s, a, b, (s - 2.0 * a) / square, (a - 3.0 * b) / square


@formula
def rotation_of(phi: Vector) -> Rotation:
    """Return exp(phi^)."""
    x, y, z = phi
    s, a, _, _, _ = _coefficients(inner(phi, phi))
    return (
        1.0 - a * (y * y + z * z),
        a * (x * y) - s * z,
        a * (z * x) + s * y,
        a * (x * y) + s * z,
        1.0 - a * (z * z + x * x),
        a * (y * z) - s * x,
        a * (z * x) - s * y,
        a * (y * z) + s * x,
        1.0 - a * (x * x + y * y),
    )


@formula
def angular_motion(phi: Vector, rate: Vector, acceleration: Vector) -> tuple[Vector, Vector]:
    """Return angular velocity and acceleration of exp(phi^) in the world's frame."""
    _, a, b, da, db = _coefficients(inner(phi, phi))
    along = inner(phi, rate)
    once = cross(phi, rate)
    twice = cross(phi, once)
    omega = add(rate, add(scale(once, a), scale(twice, b)))
    again = cross(phi, acceleration)
    alpha = add(acceleration, add(scale(again, a), scale(cross(phi, again), b)))
    alpha = add(alpha, add(scale(once, da * along), scale(twice, db * along)))
    return omega, add(alpha, scale(cross(rate, once), b))


@formula
def vector_of(r: Rotation) -> Vector:
    """Return the rotation vector of a rotation by at most half a turn."""
    twist = (0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1]))
    sine = math.sqrt(inner(twist, twist))
    cosine = 0.5 * (r[0] + r[4] + r[8] - 1.0)
    if sine > 0.1 or cosine > 0.0:
        t = angle_of(sine, cosine)
        return scale(twist, t / sine if sine > 0.0 else 1.0)
    # Close to half a turn the sine is inaccurate for the axis, but R + R' is not: the column of
    # R + I - (1 + cos t) I + ... with the largest diagonal.
    i = 0 if r[0] >= r[4] and r[0] >= r[8] else (1 if r[4] >= r[8] else 2)
    column = (
        (r[0] - cosine, 0.5 * (r[1] + r[3]), 0.5 * (r[2] + r[6]))
        if i == 0
        else (
            (0.5 * (r[1] + r[3]), r[4] - cosine, 0.5 * (r[5] + r[7]))
            if i == 1
            else (0.5 * (r[2] + r[6]), 0.5 * (r[5] + r[7]), r[8] - cosine)
        )
    )
    axis = scale(column, 1.0 / math.sqrt(inner(column, column)))
    axis = axis if inner(axis, twist) >= 0.0 else scale(axis, -1.0)
    return scale(axis, angle_of(sine, cosine))


@formula
def orientation_error(r: Rotation, desired: Rotation) -> Vector:
    """Return half the sum of R_d x R by columns: axis from R_d to R, times the angle's sine."""
    return (
        0.5
        * (
            (desired[3] * r[6] - desired[6] * r[3])
            + (desired[4] * r[7] - desired[7] * r[4])
            + (desired[5] * r[8] - desired[8] * r[5])
        ),
        0.5
        * (
            (desired[6] * r[0] - desired[0] * r[6])
            + (desired[7] * r[1] - desired[1] * r[7])
            + (desired[8] * r[2] - desired[2] * r[8])
        ),
        0.5
        * (
            (desired[0] * r[3] - desired[3] * r[0])
            + (desired[1] * r[4] - desired[4] * r[1])
            + (desired[2] * r[5] - desired[5] * r[2])
        ),
    )


@formula
def spun(r: Rotation, omega: Vector) -> Rotation:
    """Return the derivative omega^ R of a rotation that turns with omega in the world's frame."""
    first = cross(omega, (r[0], r[3], r[6]))
    second = cross(omega, (r[1], r[4], r[7]))
    third = cross(omega, (r[2], r[5], r[8]))
    return (
        first[0], second[0], third[0],
        first[1], second[1], third[1],
        first[2], second[2], third[2],
    )  # fmt: skip


@formula
def orientation_error_rate(
    r: Rotation, omega: Vector, desired: Rotation, desired_omega: Vector
) -> Vector:
    """Return the derivative of `orientation_error` by time."""
    return add(
        orientation_error(spun(r, omega), desired),
        orientation_error(r, spun(desired, desired_omega)),
    )
