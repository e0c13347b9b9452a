# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path through points at certain times, from rest to rest, with or without stops at the points.

Without stops, the path has minimum jerk: the smallest integral of the squared third derivative of
all paths through the points at their times that start and end at rest. The source is Todorov and
Jordan 1998, "Smoothness maximization along a predefined path accurately predicts the speed
profiles of complex arm movements". The path is a spline of degree five whose derivatives are
continuous up to the fourth. With stops, it consists of straight lines, each with minimum jerk
(Flash and Hogan 1985).
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.elimination import solve_band
from masmc_ros.numerics.hermite import quintic
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.reference.reference import Declared
from masmc_ros.reference.rotations import continued_vectors, orientation_of
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_BESIDE = 3
"""Diagonals on each side of the main one: a knot's two unknowns meet those of its neighbours."""

_QUATERNIONS = Parameter(
    'waypoints.quaternions', (),
    'Orientations at the points as x, y, z, w. The points have no rotation vectors then; empty: '
    'rotation vectors in the points', kind='doubles',
)  # fmt: skip


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    units = ', '.join(dict.fromkeys(axis.unit for axis in mechanism.axes))
    quaternions = () if orientation_of(mechanism) is None else (_QUATERNIONS,)
    return (
        Parameter(
            'waypoints.times', (0.0,), 'Times at which the path passes the points, ascending',
            unit='s', minimum=0.0,
        ),
        Parameter(
            'waypoints.points', mechanism.default('line_sine.offset', 'axes'),
            'Coordinates of the points, one point after the other, with a number for each task '
            'axis', unit=units,
        ),
        *quaternions,
        Parameter(
            'waypoints.stops', False,
            'Stop at each point and connect the points by straight lines',
        ),
    )  # fmt: skip


class Waypoints:
    """Motion that holds the first point until its time, passes the others, and holds the last."""

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values) -> None:
        """Initialise from checked values without the type's prefix; each time has a point."""
        self._times = np.array(values['times'], dtype=np.float64)
        points = np.array(values['points'], dtype=np.float64).reshape(len(self._times), -1)
        self._knots = np.hstack([points, np.zeros((len(points), 2 * points.shape[1]))])
        if not values['stops']:
            smooth_knots(self._times, self._knots)

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> Waypoints:
        """Return the path; raise InputError if times and points do not match the task."""
        times, axes = values['times'], mechanism.axes
        quaternions = values.get('quaternions', ())
        rotation = orientation_of(mechanism) if quaternions else None
        own = [axis.name for axis in axes]
        if rotation is not None:
            del own[rotation.axes]
        if not times:
            raise InputError('waypoints.times = []: expected a time for each point')
        for before, time in pairwise(times):
            if not before < time:
                raise InputError(
                    f'waypoints.times: {yaml_text(time)} follows {yaml_text(before)}; expected '
                    'times that ascend'
                )
        count, expected = len(values['points']), len(times) * len(own)
        if count != expected:
            raise InputError(
                f'waypoints.points: {count} numbers; expected {expected}, for each of '
                f'{len(times)} times one of {", ".join(own)}'
            )
        if rotation is None:
            return cls(values)
        if len(quaternions) != 4 * len(times):
            raise InputError(
                f'waypoints.quaternions: {len(quaternions)} numbers; expected {4 * len(times)}, '
                f'x, y, z, w for each of {len(times)} times'
            )
        start = np.array(mechanism.default('line_sine.offset', 'axes')[rotation.axes])
        numbers = np.array(quaternions, dtype=np.float64).reshape(len(times), -1)
        vectors = continued_vectors(numbers, start, 'waypoint')
        points: Array = np.array(values['points'], dtype=np.float64).reshape(len(times), -1)
        points = np.insert(points, [rotation.first] * rotation.size, vectors, axis=1)
        return cls({**values, 'points': points})

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return sample_knots(self._times, self._knots, times)


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
