# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Paths of minimum jerk through knots: positions, velocities and accelerations at certain times.

Between two knots an axis is a polynomial of degree five.

`rest_to_rest` is such a motion along a curve, with holds at its ends.
"""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.numerics.elimination import solve_band
from masmc_ros.numerics.hermite import quintic, Sample
from masmc_ros.params.declaration import Parameter
import numpy as np

_BESIDE = 3
"""Diagonals on each side of the main one: a knot's two unknowns meet those of its neighbours."""


@kernel
def smooth_knots(times: Array, knots: Array) -> None:
    """
    Write velocity and acceleration into knots (n, 3 axes) that have positions.

    Between the ends the third and fourth derivatives are continuous. Each knot has two unknowns,
    velocity and acceleration, and two equations with its neighbours. The matrix is that of the
    integral of the squared jerk, which is symmetric, positive definite and has seven diagonals.
    """
    n, axes = len(times) - 2, knots.shape[1] // 3
    if n < 1:
        return
    band, right = np.zeros((2 * n, 1 + _BESIDE)), np.zeros((2 * n, axes))
    for i in range(n):
        before, after = times[i + 1] - times[i], times[i + 2] - times[i + 1]
        p, q = 1.0 / before, 1.0 / after
        v, a = 2 * i, 2 * i + 1
        band[v, 0] = 192.0 * (p * p * p + q * q * q)
        band[v, 1] = 36.0 * (q * q - p * p)
        band[a, 0] = 9.0 * (p + q)
        if i + 1 < n:
            band[v, 2] = 168.0 * q * q * q
            band[v, 3] = -24.0 * q * q
            band[a, 1] = 24.0 * q * q
            band[a, 2] = -3.0 * q
        for j in range(axes):
            come = (knots[i + 1, j] - knots[i, j]) * p * p * p
            go = (knots[i + 2, j] - knots[i + 1, j]) * q * q * q
            right[v, j] = 360.0 * (come * p + go * q)
            right[a, j] = 60.0 * (go - come)
    solve_band(band, right)
    for i in range(n):
        for j in range(axes):
            knots[i + 1, axes + j] = right[2 * i, j]
            knots[i + 1, 2 * axes + j] = right[2 * i + 1, j]


@kernel
def sample_knots(times: Array, knots: Array, at: Array) -> Array:
    """Return samples (k, 3 axes) at times `at` (k) of knots (n, 3 axes) at their times (n)."""
    last, axes = len(times) - 1, knots.shape[1] // 3
    out = np.empty((len(at), 3 * axes))
    for k in range(len(at)):
        time = at[k]
        if not times[0] < time < times[last]:
            end = 0 if time <= times[0] else last
            for j in range(3 * axes):
                out[k, j] = knots[end, j]
            continue
        low, high = 0, last
        while high - low > 1:
            middle = (low + high) // 2
            if times[middle] <= time:
                low = middle
            else:
                high = middle
        period = times[high] - times[low]
        part = (time - times[low]) / period
        for j in range(axes):
            position, velocity, acceleration = quintic(
                (knots[low, j], knots[low, axes + j], knots[low, 2 * axes + j]),
                (knots[high, j], knots[high, axes + j], knots[high, 2 * axes + j]),
                period,
                part,
            )
            out[k, j] = position
            out[k, axes + j] = velocity
            out[k, 2 * axes + j] = acceleration
    return out


def stopped(position: Array, velocity: Array, acceleration: Array, duration: float) -> Array:
    """
    Return the positions (k) at which a motion is at rest after a duration in s.

    The motion starts with these positions, velocities and accelerations (k). It is the polynomial
    of degree four; one of degree five would overshoot.
    """
    rest: Array = position + 0.5 * duration * velocity + duration**2 / 12.0 * acceleration
    return rest


def duration_parameters(kind: str) -> tuple[Parameter, Parameter]:
    """Return the parameters `delay` and `duration` of a type of trajectory."""
    return (
        Parameter(f'{kind}.delay', 0.0, 'Time at which the motion starts', unit='s', minimum=0.0),
        Parameter(
            f'{kind}.duration', 10.0, 'Duration of the motion',
            unit='s', minimum=0.0, exclusive_minimum=True,
        ),
    )  # fmt: skip


@formula
def rest_to_rest(total: float, delay: float, duration: float, time: float) -> Sample:
    """
    Return the way along a curve, and its two derivatives, at a time in s.

    The way starts at 0 after `delay` s and is `total` from `duration` s later on. Its unit is
    that of the curve's parameter.
    """
    part = max((time - delay) / duration, 0.0)
    way, speed, change = total, 0.0, 0.0
    if part < 1.0:
        way, speed, change = quintic((0.0, 0.0, 0.0), (total, 0.0, 0.0), duration, part)
    return way, speed, change
