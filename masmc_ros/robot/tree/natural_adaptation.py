# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Natural adaptation of inertial parameters, which preserves physical consistency.

The law is Pdot = -P L P / gamma, with the pseudo-inertia P and the gradient L as a symmetric
matrix (`spatial.power_gradient`). Its Lyapunov function is the Bregman divergence of -log det, and
one gain suits bodies of all sizes (Lee, Kwon and Park 2018). Sampled, with P = C C' and
X = T C' L C / gamma,

    P+ = C (1 + X + X^2 / 2)^-1 C'

is of second order in T, and positive definite for any X. Matrices are in the order 1, x, y, z.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Numbers
from masmc_ros.jit.arrays import array_of, read_down, to_vector, write_down
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import clear, copy_into, scratch
from masmc_ros.jit.tuples import dot, elementwise, matrix_times
from masmc_ros.numerics.portable_math import AT_ONCE
from masmc_ros.numerics.scalars import times
from masmc_ros.robot.tree.friction import adapt_friction
from masmc_ros.robot.tree.spatial import MOMENTS, Moments, PER_BODY
from masmc_ros.robot.tree.tree_model import bodies_of, TreeModel

Row = tuple[float, float, float, float]
Rows = tuple[Row, Row, Row, Row]

_LONGEST = 1.0
"""Norm of X above which a step is shortened: the series follows exp(X) up to there."""

_LEAST = 1.0e-13
"""Part of a diagonal entry above which a pivot exceeds rounding errors."""


_GRADIENT, _NOMINAL, _STEP = PER_BODY, 2 * PER_BODY, 3 * PER_BODY
"""First rows of gradients, nominal parameters and steps, after the parameters of bodies."""


@kernel
def adapted(
    model: TreeModel,
    theta: Numbers,
    nominal: Numbers,
    gradient: Numbers,
    gamma: Numbers,
    period: float,
    upper: float,
) -> Numbers:
    """
    Return the parameters of all bodies and of friction after a step of natural adaptation.

    Vectors have ten numbers per body; its gain is the entry of `gamma` for its mass. Mass and size
    are limited to `upper` times their nominal values.
    """
    before, gains = array_of(theta), array_of(gamma)
    nominal_values, gradients = array_of(nominal), array_of(gradient)
    bodies = bodies_of(model)
    out, columns = scratch(len(before)), scratch(_STEP + 1, AT_ONCE)
    copy_into(out, before)
    clear(columns)
    for first in range(0, bodies, AT_ONCE):
        some = min(AT_ONCE, bodies - first)
        for k in range(some):
            at = PER_BODY * (first + k)
            for i in range(PER_BODY):
                columns[i, k] = before[at + i]
                columns[_GRADIENT + i, k] = gradients[at + i]
                columns[_NOMINAL + i, k] = nominal_values[at + i]
            columns[_STEP, k] = period / gains[at]
        # The loop always computes all columns, because a vector takes the time of one number.
        for k in range(AT_ONCE):
            moved = natural_step(
                read_down(columns, 0, k, MOMENTS),
                read_down(columns, _GRADIENT, k, MOMENTS),
                columns[_STEP, k],
            )
            moved = bounded(moved, read_down(columns, _NOMINAL, k, MOMENTS), upper)
            write_down(columns, 0, k, moved)
        for k in range(some):
            for i in range(PER_BODY):
                out[PER_BODY * (first + k) + i] = columns[i, k]
    adapt_friction(model, out, gradients, gains, period)
    return to_vector(out, theta)


@formula
def natural_step(inertial_parameters: Moments, gradient: Moments, step: float) -> Moments:
    """
    Return the inertial parameters of a body after one step of natural adaptation.

    Parameters
    ----------
    inertial_parameters
        Parameters of the body in kg, kg·m and kg·m², see `spatial`.
    gradient
        Derivative of the power by these parameters, see `power_gradient`.
    step
        Sampling period over gain, T / gamma, >= 0.

    Returns
    -------
        Parameters with a positive definite pseudo-inertia. They are unmodified if they are not
        definite within rounding, such as those of a frame without mass, or if a gradient is NaN.

    """
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    (b, c, d), pivots, is_body = _factor(
        (mass, 0.0, 0.0, 0.0), (x, xx, 0.0, 0.0), (y, xy, yy, 0.0), (z, zx, yz, zz)
    )
    # Columns of C = L sqrt(D), and its rows.
    roots = elementwise(_root, pivots)
    p, q, r, s = (
        (roots[0], b[0] * roots[0], c[0] * roots[0], d[0] * roots[0]),
        (0.0, roots[1], c[1] * roots[1], d[1] * roots[1]),
        (0.0, 0.0, roots[2], d[2] * roots[2]),
        (0.0, 0.0, 0.0, roots[3]),
    )
    rows = (
        (p[0], 0.0, 0.0, 0.0),
        (p[1], q[1], 0.0, 0.0),
        (p[2], q[2], r[2], 0.0),
        (p[3], q[3], r[3], s[3]),
    )
    gradient_rows = _gradient_rows(gradient)
    e, f, g, h = (
        matrix_times(gradient_rows, p),
        matrix_times(gradient_rows, q),
        matrix_times(gradient_rows, r),
        matrix_times(gradient_rows, s),
    )
    pq, pr, ps, qr, qs, rs = dot(p, f), dot(p, g), dot(p, h), dot(q, g), dot(q, h), dot(r, h)
    pp, qq, rr, ss = dot(p, e), dot(q, f), dot(r, g), dot(s, h)
    off = pq * pq + pr * pr + ps * ps + qr * qr + qs * qs + rs * rs
    size = math.sqrt(pp * pp + qq * qq + rr * rr + ss * ss + 2.0 * off)
    by = step if step * size <= _LONGEST else _LONGEST / size
    e, f, g, h = (
        (by * pp, by * pq, by * pr, by * ps),
        (by * pq, by * qq, by * qr, by * qs),
        (by * pr, by * qr, by * rr, by * rs),
        (by * ps, by * qs, by * rs, by * ss),
    )
    series, weights, is_right = _factor(
        (1.0 + e[0] + 0.5 * dot(e, e), 0.0, 0.0, 0.0),
        (e[1] + 0.5 * dot(e, f), 1.0 + f[1] + 0.5 * dot(f, f), 0.0, 0.0),
        (e[2] + 0.5 * dot(e, g), f[2] + 0.5 * dot(f, g), 1.0 + g[2] + 0.5 * dot(g, g), 0.0),
        (
            e[3] + 0.5 * dot(e, h),
            f[3] + 0.5 * dot(f, h),
            g[3] + 0.5 * dot(g, h),
            1.0 + h[3] + 0.5 * dot(h, h),
        ),
    )
    # P+ is C (L D L')^-1 C' of that series: products of L^-1 C', weighted by D^-1.
    p, q, r, s = (
        _solved(series, rows[0]),
        _solved(series, rows[1]),
        _solved(series, rows[2]),
        _solved(series, rows[3]),
    )
    by_weight = elementwise(_inverse, weights)
    e, f, g, h = (
        elementwise(times, p, by_weight),
        elementwise(times, q, by_weight),
        elementwise(times, r, by_weight),
        elementwise(times, s, by_weight),
    )
    after_step = (
        dot(p, e),
        dot(p, f),
        dot(p, g),
        dot(p, h),
        dot(q, f),
        dot(r, g),
        dot(s, h),
        dot(q, g),
        dot(r, h),
        dot(s, f),
    )
    _, _, is_still_body = _factor(
        (after_step[0], 0.0, 0.0, 0.0),
        (after_step[1], after_step[4], 0.0, 0.0),
        (after_step[2], after_step[7], after_step[5], 0.0),
        (after_step[3], after_step[9], after_step[8], after_step[6]),
    )
    return after_step if is_body & is_right & is_still_body else inertial_parameters


@formula
def bounded(inertial_parameters: Moments, nominal: Moments, upper: float) -> Moments:
    """
    Return the inertial parameters of a body, scaled down to bounds of mass and size.

    Scaling preserves consistency. The bounds of the mass and of the sum of the second moments are
    `upper` times the nominal values.
    """
    most = upper * nominal[0]
    part = most / inertial_parameters[0] if inertial_parameters[0] > most else 1.0
    size = inertial_parameters[4] + inertial_parameters[5] + inertial_parameters[6]
    most = upper * (nominal[4] + nominal[5] + nominal[6])
    part = min(part, most / size) if size > most else part
    return elementwise(times, inertial_parameters, part)


@formula
def _gradient_rows(gradient: Moments) -> Rows:
    """Return the symmetric matrix L with tr(L P) = the sum of gradients times parameters."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = gradient
    return (
        (mass, x / 2.0, y / 2.0, z / 2.0),
        (x / 2.0, xx, xy / 2.0, zx / 2.0),
        (y / 2.0, xy / 2.0, yy, yz / 2.0),
        (z / 2.0, zx / 2.0, yz / 2.0, zz),
    )


@formula
def _root(value: float) -> float:
    return math.sqrt(value)


@formula
def _inverse(value: float) -> float:
    return 1.0 / value


@formula
def _factor(a: Row, b: Row, c: Row, d: Row) -> tuple[tuple[Row, Row, Row], Row, bool]:
    """
    Return L and D of a matrix L D L' in rows up to the diagonal, and True if D is positive.

    Returned are the rows of L below the first; its diagonal entries are 1.
    """
    a0, a_is_right = _pivot(a[0], a[0])
    by = 1.0 / a0
    b0, c0, d0 = b[0] * by, c[0] * by, d[0] * by
    b1, b_is_right = _pivot(b[1] - b0 * b[0], b[1])
    by = 1.0 / b1
    c_left, d_left = c[1] - c0 * b[0], d[1] - d0 * b[0]
    c1, d1 = c_left * by, d_left * by
    c2, c_is_right = _pivot(c[2] - c0 * c[0] - c1 * c_left, c[2])
    left = d[2] - d0 * c[0] - d1 * c_left
    d2 = left / c2
    d3, d_is_right = _pivot(d[3] - d0 * d[0] - d1 * d_left - d2 * left, d[3])
    rows = ((b0, 1.0, 0.0, 0.0), (c0, c1, 1.0, 0.0), (d0, d1, d2, 1.0))
    return rows, (a0, b1, c2, d3), a_is_right & b_is_right & c_is_right & d_is_right


@formula
def _pivot(left: float, entry: float) -> tuple[float, bool]:
    """Return the pivot, or 1 if it is not positive, and True if it is positive."""
    is_right = (left > _LEAST * entry) & (left < math.inf)
    return left if is_right else 1.0, is_right


@formula
def _solved(factor: tuple[Row, Row, Row], x: Row) -> Row:
    """Return L^-1 x."""
    b, c, d = factor
    second = x[1] - b[0] * x[0]
    third = x[2] - c[0] * x[0] - c[1] * second
    return x[0], second, third, x[3] - d[0] * x[0] - d[1] * second - d[2] * third
