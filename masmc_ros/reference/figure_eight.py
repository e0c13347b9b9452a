# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figure eight about a point, in any plane of the task coordinates, from rest to rest."""

from __future__ import annotations

import math
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.reference.minimum_jerk import duration_parameters, rest_to_rest
from masmc_ros.reference.reference import Declared
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_ALONG, _ACROSS = 0.1, 0.05
"""Default half length and half width in m or rad."""


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    start = mechanism.default('line_sine.offset', 'axes')
    units = ', '.join(dict.fromkeys(axis.unit for axis in mechanism.axes))
    places = mechanism.places
    first = places[0].first if places else 0

    def per_axis(name: str, default: tuple[float, ...], description: str) -> Parameter:
        return Parameter(
            f'figure_eight.{name}', default, description, unit=units, length=len(start)
        )

    def moved(axis: int, size: float) -> tuple[float, ...]:
        return tuple(size if i == axis else 0.0 for i in range(len(start)))

    return (
        per_axis('start', start, 'Crossing of the eight, where the motion starts and ends'),
        per_axis('along', moved(first, _ALONG), 'Vector from the crossing along the eight'),
        per_axis('across', moved(first + 1, _ACROSS), 'Vector of half of its width'),
        Parameter('figure_eight.laps', 1, 'Number of eights', minimum=1),
        *duration_parameters('figure_eight'),
    )


class FigureEight:
    """x(t) = start + along sin(a) + across sin(2 a); the angle a has minimum jerk."""

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values) -> None:
        """Initialise from checked values, with names without the prefix of the type."""
        vectors = [values[name] for name in ('start', 'along', 'across')]
        self._vectors = np.array(vectors, dtype=np.float64)
        self._angle = 2.0 * math.pi * values['laps']
        self._delay, self._duration = values['delay'], values['duration']

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return _sample(self._vectors, self._angle, self._delay, self._duration, times)


@kernel
def _sample(vectors: Array, angle: float, delay: float, duration: float, times: Array) -> Array:
    axes = vectors.shape[1]
    out = np.empty((len(times), 3 * axes))
    for k in range(len(times)):
        way, speed, change = rest_to_rest(angle, delay, duration, times[k])
        # Past its end the eight is at its start exactly.
        s, c = sin_cos(way if way < angle else 0.0)
        s_2, c_2 = 2.0 * s * c, c * c - s * s
        for i in range(axes):
            along, across = vectors[1, i], vectors[2, i]
            slope = along * c + 2.0 * across * c_2
            bend = -along * s - 4.0 * across * s_2
            out[k, i] = vectors[0, i] + along * s + across * s_2
            out[k, axes + i] = speed * slope
            out[k, 2 * axes + i] = change * slope + speed * speed * bend
    return out
