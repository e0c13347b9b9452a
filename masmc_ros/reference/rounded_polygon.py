# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Closed polygon with rounded corners, in any task coordinates, from rest to rest.

The curve is a function of its length s: straight sides, and polynomials of degree five about the
corners. Its first and second derivatives by s are continuous: at both ends of a corner the first
one is the direction of the side and the second one is zero.
"""

from __future__ import annotations

import math
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import kernel
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.reference.minimum_jerk import duration_parameters, rest_to_rest, sample_knots
from masmc_ros.reference.reference import Declared
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_SIDE = 0.1
"""Side of the default polygon in m or rad."""

_ROUNDING = Parameter(
    'rounded_polygon.rounding', 0.25,
    'Share of the shorter side at a corner, on each side of it, that is rounded',
    minimum=0.0, maximum=0.5, exclusive_minimum=True,
)  # fmt: skip


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    start = mechanism.default('line_sine.offset', 'axes')
    units = ', '.join(dict.fromkeys(axis.unit for axis in mechanism.axes))
    places = mechanism.places
    first = places[0].first if places else 0
    corners = [list(start) for _ in range(3)]
    for corner in corners[1:]:
        corner[first] += _SIDE
    corners[2][min(first + 1, len(start) - 1)] += _SIDE
    return (
        Parameter(
            'rounded_polygon.corners', tuple(x for corner in corners for x in corner),
            'Coordinates of the corners, one corner after the other, with a number for each task '
            'axis; the motion starts and ends at the first one', unit=units,
        ),
        _ROUNDING,
        Parameter('rounded_polygon.laps', 1, 'Number of rounds', minimum=1),
        *duration_parameters('rounded_polygon'),
    )  # fmt: skip


class RoundedPolygon:
    """Motion around a polygon, whose way along the curve has minimum jerk."""

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values) -> None:
        """
        Initialise from checked values, with names without the prefix of the type.

        `corners` has the shape (corners, axes).

        Raises InputError for a corner that repeats the one before.
        """
        corners = np.array(values['corners'], dtype=np.float64)
        course = np.vstack([*[corners] * values['laps'], corners[:1]])
        self._lengths, self._knots = _rounded(course, values['rounding'])
        self._delay, self._duration = values['delay'], values['duration']

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> RoundedPolygon:
        """Return the path; raise InputError if the corners do not match the task."""
        axes, numbers = mechanism.axes, values['corners']
        count, extra = divmod(len(numbers), len(axes))
        if extra or count < 2:
            raise InputError(
                f'rounded_polygon.corners: {len(numbers)} numbers; expected at least two corners, '
                f'for each one of {", ".join(axis.name for axis in axes)}'
            )
        return cls({**values, 'corners': np.reshape(numbers, (count, len(axes)))})

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        ways = _ways(self._lengths[-1], self._delay, self._duration, times)
        samples: Array = sample_knots(self._lengths, self._knots, ways[:, 0].copy())
        _differentiate_by_time(samples, ways)
        return samples


def _rounded(course: Array, rounding: float) -> tuple[Array, Array]:
    """
    Return lengths (m) and knots (m, 3 axes) of the curve: position and derivatives by length.

    A metre and a radian count as the same length. `course` are the corners (n, axes). The first
    and the last one are not rounded.
    """
    axes = course.shape[1]
    steps = np.diff(course, axis=0)
    # The result of fsum depends neither on the machine nor on the version of Python.
    sides = [math.sqrt(math.fsum(x * x for x in step)) for step in steps.tolist()]
    if not all(sides):
        count = sides.index(0.0) + 1
        raise InputError(
            f'rounded_polygon.corners: corner {count} repeats the one before or after; expected '
            'different ones'
        )
    directions = steps / np.array(sides)[:, None]
    lengths, knots, at = [0.0], [(course[0], directions[0])], 0.0
    for k in range(1, len(sides)):
        near = rounding * min(sides[k - 1], sides[k])
        before, after = directions[k - 1], directions[k]
        at += sides[k - 1]
        lengths += [at - near, at + near]
        knots += [(course[k] - near * before, before), (course[k] + near * after, after)]
    lengths.append(at + sides[-1])
    knots.append((course[-1], directions[-1]))
    table = np.zeros((len(knots), 3 * axes))
    for row, (position, direction) in zip(table, knots, strict=True):
        row[:axes], row[axes:2 * axes] = position, direction
    return np.array(lengths), table


@kernel
def _ways(length: float, delay: float, duration: float, times: Array) -> Array:
    """Return way (m), speed and acceleration along the curve (n, 3) at times (n) in s."""
    ways = np.empty((len(times), 3))
    for k in range(len(times)):
        way, speed, change = rest_to_rest(length, delay, duration, times[k])
        ways[k, 0], ways[k, 1], ways[k, 2] = way, speed, change
    return ways


@kernel
def _differentiate_by_time(samples: Array, ways: Array) -> None:
    """Convert derivatives by the way in samples (n, 3 axes) to those by time."""
    axes = samples.shape[1] // 3
    for k in range(len(ways)):
        speed, change = ways[k, 1], ways[k, 2]
        for i in range(axes):
            slope, bend = samples[k, axes + i], samples[k, 2 * axes + i]
            samples[k, axes + i] = speed * slope
            samples[k, 2 * axes + i] = change * slope + speed * speed * bend
