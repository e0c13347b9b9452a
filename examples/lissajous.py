# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A custom path: the end effector draws a Lissajous figure, and the platform stands."""

from __future__ import annotations

from typing import ClassVar

import masmc_ros as masmc
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.plug_ins import add_plug_in
from masmc_ros.reference.reference import Declared
from masmc_ros.reference.trajectory import ENTRY_POINTS
import numpy as np
from numpy.typing import NDArray


class Lissajous:
    """x_E = x_0 + A sin(a t), y_E = y_0 + B sin(b t); the point F stays at the origin."""

    axes: ClassVar[tuple[str, ...]] = ('x_E', 'y_E', 'x_F', 'y_F')
    parameters: ClassVar[Declared] = (
        Parameter('lissajous.centre', (0.4, 0.4), 'Centre x_0, y_0', unit='m', length=2),
        Parameter('lissajous.amplitude', (0.15, 0.1), 'A and B', unit='m', length=2),
        Parameter('lissajous.frequency', (0.6, 0.9), 'a and b', unit='rad/s', length=2),
    )

    def __init__(self, values: Values) -> None:
        """Initialise from checked values, with names without the prefix of the type."""
        self._centre = np.array(values['centre'])
        self._amplitude = np.array(values['amplitude'])
        self._frequency = np.array(values['frequency'])

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return positions, velocities and accelerations (n, 3 axes) at times (n) in s."""
        angle = np.outer(times, self._frequency)
        samples = np.zeros((len(times), 3, 4))
        samples[:, 0, :2] = self._centre + self._amplitude * np.sin(angle)
        samples[:, 1, :2] = self._amplitude * self._frequency * np.cos(angle)
        samples[:, 2, :2] = -self._amplitude * self._frequency**2 * np.sin(angle)
        return samples.reshape(len(times), 12)


if __name__ == '__main__':
    # A package adds it by the entry point `lissajous = lissajous:Lissajous` of this group.
    add_plug_in(ENTRY_POINTS, 'lissajous', Lissajous)
    print(masmc.simulate('paper', {'trajectory.type': 'lissajous'}))
