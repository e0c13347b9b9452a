# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Rigid bodies as tuples: vectors (3), rotations (9, row by row) and pseudo-inertias (10).

A rotation R maps components in the child's frame to those in the parent's. The pseudo-inertia of a
body consists of its moments of mass about the origin of its frame, in SI units. These are mass,
first moments x, y, z, and second moments xx, yy, zz, xy, yz, zx. Second moments are integrals of
x x dm; a moment of inertia is the sum of two of them. As the 4 x 4 matrix
P = [[Sigma, h], [h', m]] it is positive definite for every physical body (Wensing, Kim and
Slotine, 2018).
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float, float, float, float, float, float]
Moments = tuple[float, float, float, float, float, float, float, float, float, float]

VECTOR: Vector = (0.0, 0.0, 0.0)
"""Zero vector; as an argument it defines the number of entries."""

ROTATION: Rotation = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
"""No rotation."""

MOMENTS: Moments = (0.0,) * 10
"""No mass."""

PER_BODY = len(MOMENTS)
"""Numbers per body in theta."""


@formula
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@formula
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@formula
def scale(a: Vector, by: float) -> Vector:
    """Return a by."""
    return a[0] * by, a[1] * by, a[2] * by


@formula
def inner(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@formula
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@formula
def rotate(r: Rotation, v: Vector) -> Vector:
    """Return R v."""
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2],
    )


@formula
def rotate_back(r: Rotation, v: Vector) -> Vector:
    """Return R' v."""
    return (
        r[0] * v[0] + r[3] * v[1] + r[6] * v[2],
        r[1] * v[0] + r[4] * v[1] + r[7] * v[2],
        r[2] * v[0] + r[5] * v[1] + r[8] * v[2],
    )


@formula
def product(a: Rotation, b: Rotation) -> Rotation:
    """Return A B; the factors may be any matrices."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@formula
def turn(axis: Vector, sine: float, cosine: float) -> Rotation:
    """Return the rotation about a unit axis, I + sin K + (1 - cos) K K (Rodrigues)."""
    x, y, z = axis
    versine = 1.0 - cosine
    return (
        cosine + versine * (x * x),
        versine * (x * y) - sine * z,
        versine * (z * x) + sine * y,
        versine * (x * y) + sine * z,
        cosine + versine * (y * y),
        versine * (y * z) - sine * x,
        versine * (z * x) - sine * y,
        versine * (y * z) + sine * x,
        cosine + versine * (z * z),
    )


@formula
def moments_in_parent(r: Rotation, p: Vector, inertial_parameters: Moments) -> Moments:
    """Return the moments about the parent's origin of a body at p, turned by R: T P T'."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    h = rotate(r, (x, y, z))
    second = product(product(r, (xx, xy, zx, xy, yy, yz, zx, yz, zz)), transpose(r))
    return (
        mass,
        h[0] + mass * p[0],
        h[1] + mass * p[1],
        h[2] + mass * p[2],
        second[0] + 2.0 * (h[0] * p[0]) + mass * (p[0] * p[0]),
        second[4] + 2.0 * (h[1] * p[1]) + mass * (p[1] * p[1]),
        second[8] + 2.0 * (h[2] * p[2]) + mass * (p[2] * p[2]),
        second[1] + (h[0] * p[1] + h[1] * p[0]) + mass * (p[0] * p[1]),
        second[5] + (h[1] * p[2] + h[2] * p[1]) + mass * (p[1] * p[2]),
        second[2] + (h[2] * p[0] + h[0] * p[2]) + mass * (p[2] * p[0]),
    )


@formula
def transpose(a: Rotation) -> Rotation:
    """Return A'."""
    return a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]


@formula
def velocity_map(spin: Vector, other: Vector, turn_rate: Vector) -> Rotation:
    """
    Return A with A x + c the reference acceleration of the body's point x.

    A = alpha^ + w_omega^ omega^: `turn_rate` is alpha, `spin` w_omega, `other` the true omega.
    """
    dot = inner(spin, other)
    return (
        other[0] * spin[0] - dot,
        other[0] * spin[1] - turn_rate[2],
        other[0] * spin[2] + turn_rate[1],
        other[1] * spin[0] + turn_rate[2],
        other[1] * spin[1] - dot,
        other[1] * spin[2] - turn_rate[0],
        other[2] * spin[0] - turn_rate[1],
        other[2] * spin[1] + turn_rate[0],
        other[2] * spin[2] - dot,
    )


@formula
def wrench(a: Rotation, c: Vector, inertial_parameters: Moments) -> tuple[Vector, Vector]:
    """Return moment about the origin and force that give a body's points A x + c: [A c] P."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    h = (x, y, z)
    n = product(a, (xx, xy, zx, xy, yy, yz, zx, yz, zz))
    moment = (
        (n[7] - n[5]) + (c[2] * y - c[1] * z),
        (n[2] - n[6]) + (c[0] * z - c[2] * x),
        (n[3] - n[1]) + (c[1] * x - c[0] * y),
    )
    return moment, add(rotate(a, h), scale(c, mass))


@formula
def momentum(
    inertial_parameters: Moments, turn_rate: Vector, speed: Vector
) -> tuple[Vector, Vector]:
    """Return a body's angular momentum about the origin and its momentum, of a velocity."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    w, h = turn_rate, (x, y, z)
    spin = (
        (yy + zz) * w[0] - xy * w[1] - zx * w[2],
        (zz + xx) * w[1] - yz * w[2] - xy * w[0],
        (xx + yy) * w[2] - zx * w[0] - yz * w[1],
    )
    return add(spin, cross(h, speed)), add(scale(speed, mass), cross(w, h))


@formula
def power_gradient(a: Rotation, c: Vector, turn_rate: Vector, speed: Vector) -> Moments:
    """Return the derivative by the moments of the power of that wrench in a velocity."""
    w, v = turn_rate, speed
    # [w^ v]' [A c]: the columns of w^ times A, those of w^ times c, v times A, v . c.
    m = product((0.0, w[2], -w[1], -w[2], 0.0, w[0], w[1], -w[0], 0.0), a)
    across = cross(c, w)
    along = rotate_back(a, v)
    return (
        inner(v, c),
        across[0] + along[0],
        across[1] + along[1],
        across[2] + along[2],
        m[0],
        m[4],
        m[8],
        m[1] + m[3],
        m[5] + m[7],
        m[2] + m[6],
    )
