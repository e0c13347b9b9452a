# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Arc of a circle about an axis in space, from rest to rest, also of more than one turn."""

from __future__ import annotations

import math
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.reference.minimum_jerk import duration_parameters, rest_to_rest
from masmc_ros.reference.reference import Declared
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_SPACE = 3


def _coordinates(mechanism: Mechanism) -> tuple[int, ...]:
    """Return the task axes of x, y and perhaps z of the first position; empty without one."""
    places = mechanism.places
    return tuple(range(places[0].first, places[0].axes.stop)) if places else ()


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    start = mechanism.default('line_sine.offset', 'axes')
    units = ', '.join(dict.fromkeys(axis.unit for axis in mechanism.axes))
    dimensions = len(_coordinates(mechanism)) or _SPACE
    normal = Parameter(
        'arc.normal', (0.0, 0.0, 1.0),
        'Direction of the axis, about which a positive angle turns as a right-handed screw does',
        length=_SPACE,
    )  # fmt: skip
    return (
        Parameter(
            'arc.start', start, 'Start of the arc; axes outside of the circle stay constant',
            unit=units, length=len(start),
        ),
        Parameter(
            'arc.centre', (0.0,) * dimensions, 'Point on the axis of the circle',
            unit='m', length=dimensions,
        ),
        *((normal,) if dimensions == _SPACE else ()),
        Parameter('arc.angle', 2.0 * math.pi, 'Angle of the arc about the axis', unit='rad'),
        *duration_parameters('arc'),
    )  # fmt: skip


class Arc:
    """
    Motion about an axis through an angle, with minimum jerk along the arc and holds at its ends.

    x(t) = foot + u cos(angle(t)) + w sin(angle(t)), where u leads from the axis to the start and
    w is perpendicular to both.
    """

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values, first: int = 0) -> None:
        """Initialise from checked values without the type's prefix; `first` is the axis of x."""
        self._start = np.array(values['start'], dtype=np.float64)
        self._first, dimensions = first, len(values['centre'])
        normal = values['normal'] if dimensions == _SPACE else (0.0, 0.0, 1.0)
        nx, ny, nz = normal
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if not length > 0.0:
            raise InputError(f'arc.normal = {list(normal)}: expected a direction')
        nx, ny, nz = (component / length for component in normal)
        start = values['start'][first:first + dimensions]
        away = [at - centre for at, centre in zip(start, values['centre'], strict=True)]
        x, y, z = away if dimensions == _SPACE else (*away, 0.0)
        along = x * nx + y * ny + z * nz
        u = x - along * nx, y - along * ny, z - along * nz
        if not any(u):
            raise InputError(
                f'arc.start: {list(start)} is on the axis of the circle; expected one off the axis'
            )
        w = ny * u[2] - nz * u[1], nz * u[0] - nx * u[2], nx * u[1] - ny * u[0]
        self._circle = np.array([u, w])[:, :dimensions].copy()
        self._angle = float(values['angle'])
        self._delay, self._duration = float(values['delay']), float(values['duration'])

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> Arc:
        """Return the arc for the first position of the task; raise InputError without one."""
        coordinates = _coordinates(mechanism)
        if not coordinates:
            raise InputError(
                'type = arc: a trajectory of x and y; expected another type, as the task is '
                f'{", ".join(axis.name for axis in mechanism.axes)}'
            )
        return cls(values, coordinates[0])

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return _sample(
            self._start, self._circle, self._first, self._angle, self._delay, self._duration, times
        )


@kernel
def _sample(
    start: Array,
    circle: Array,
    first: int,
    angle: float,
    delay: float,
    duration: float,
    times: Array,
) -> Array:
    axes = len(start)
    out = np.zeros((len(times), 3 * axes))
    for k in range(len(times)):
        for j in range(axes):
            out[k, j] = start[j]
        way, speed, change = rest_to_rest(angle, delay, duration, times[k])
        s, c = sin_cos(way)
        for j in range(circle.shape[1]):
            u, w = circle[0, j], circle[1, j]
            ahead, inward = w * c - u * s, u * c + w * s
            # The start itself is used, so the value before the motion is exact.
            out[k, first + j] = start[first + j] + (w * s - u * (1.0 - c))
            out[k, axes + first + j] = speed * ahead
            out[k, 2 * axes + first + j] = change * ahead - speed * speed * inward
    return out
