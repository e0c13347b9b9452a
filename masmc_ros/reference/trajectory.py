# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The reference trajectory: its parameters, and samples of it on the control grid."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any, ClassVar, Protocol

from masmc_ros.errors import InputError
from masmc_ros.numerics.compiled import kernel
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
from masmc_ros.reference.line_sine import line_sine
from masmc_ros.robot.two_link.parameters import Robot
import numpy as np
from numpy.typing import NDArray

ENTRY_POINTS = 'masmc_ros.references'
"""Group of entry points through which a user's own trajectory types plug in."""

SAMPLE = 12
"""Numbers in a sample: x_d, xdot_d and xddot_d of the four task axes."""


class Reference(Protocol):
    """A type of trajectory: class attribute `parameters`, made from checked values."""

    parameters: ClassVar[tuple[Parameter, ...]]

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take checked values, names without the type's prefix."""

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 12) samples at times (n) in s: positions, velocities, accelerations."""
        ...


def _axes(name: str, default: tuple[float, ...], description: str, unit: str) -> Parameter:
    return Parameter(f'line_sine.{name}', default, description, unit=unit, length=4)


class LineSine:
    """x_d(t) = offset + slope t + amplitude sin(frequency t + phase), axis by axis."""

    parameters: ClassVar[tuple[Parameter, ...]] = (
        _axes('offset', (0.3, 0.5, 0.0, 0.0), 'Position at t = 0 without the sine', 'm'),
        _axes('slope', (0.2, 0.0, 0.2, 0.0), 'Velocity without the sine', 'm/s'),
        _axes('amplitude', (0.0, 0.25, 0.0, 0.0), 'Amplitude of the sine', 'm'),
        _axes('frequency', (0.0, 0.2 * math.pi, 0.0, 0.0), 'Frequency of the sine', 'rad/s'),
        _axes('phase', (0.0, 0.0, 0.0, 0.0), 'Phase of the sine at t = 0', 'rad'),
    )

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take checked values, names without the type's prefix."""
        self._table = np.array(
            [values[p.name.partition('.')[2]] for p in self.parameters], dtype=np.float64
        )

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 12) samples at times (n) in s."""
        return _sample_line_sine(self._table, times)


@kernel
def _sample_line_sine(table: Any, times: Any) -> NDArray[np.float64]:
    out = np.empty((len(times), 12))
    for k in range(len(times)):
        for i in range(4):
            position, velocity, acceleration = line_sine(
                times[k], table[0, i], table[1, i], table[2, i], table[3, i], table[4, i]
            )
            out[k, i] = position
            out[k, 4 + i] = velocity
            out[k, 8 + i] = acceleration
    return out


BUILT_IN: dict[str, type[Reference]] = {'line_sine': LineSine}


def types() -> tuple[str, ...]:
    """Names of all types of trajectory, built in and plugged in."""
    return (*BUILT_IN, *plugged_in(ENTRY_POINTS))


def load(name: str) -> type[Reference]:
    """Return the class of a type of trajectory; InputError where it cannot be loaded."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    reference: type[Reference] = load_plug_in(ENTRY_POINTS, 'type', name)
    return reference


def parameters() -> tuple[Parameter, ...]:
    """Return the declarations of `type` and of the block of every type."""
    kind = Parameter(
        'type', 'line_sine', 'Type of trajectory; its parameters are in its block', choices=types()
    )
    return (kind, *(p for name in types() for p in load(name).parameters))


class Trajectory:
    """A trajectory on the control grid, checked against the robot's reach."""

    def __init__(self, values: Mapping[str, Any], period: float, robot: Robot) -> None:
        """Take checked values of `parameters()` and the control period in s."""
        kind = values['type']
        block = f'{kind}.'
        self._reference = load(kind)(
            {n.removeprefix(block): v for n, v in values.items() if n.startswith(block)}
        )
        self._period = period
        self._robot = robot

    def sample(self, first: int, count: int) -> NDArray[np.float64]:
        """
        Return (count, 12) samples at ticks first, first + 1, ...

        Raises InputError where the arm cannot reach the desired end effector position from
        the desired position of its base.
        """
        times, samples = self._at(np.arange(first, first + count))
        if not np.isfinite(samples).all():
            bad = int(np.argmin(np.isfinite(samples).all(axis=1)))
            raise InputError(
                f'trajectory: not finite at t = {times[bad]:g} s, expected numbers everywhere'
            )
        distance = np.hypot(samples[:, 0] - samples[:, 2], samples[:, 1] - samples[:, 3])
        least, most = self._robot.reach
        outside = (distance < least) | (distance > most)
        if outside.any():
            bad = int(np.argmax(outside))
            raise InputError(
                f'trajectory: at t = {times[bad]:g} s the end effector is to be '
                f'{distance[bad]:.3f} m from the base of the arm, outside its reach; expected '
                f'{least:.3f} to {most:.3f} m'
            )
        return samples

    def positions(self, ticks: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the desired n x 4 entries, in m, at any n ticks, reachable or not."""
        return self._at(ticks)[1][:, :4]

    def _at(self, ticks: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return times (n) in s and samples (n, 12) of ticks (n)."""
        times = ticks.astype(np.float64) * self._period
        samples = np.asarray(self._reference.sample(times), dtype=np.float64)
        if samples.shape != (len(ticks), SAMPLE):
            raise InputError(
                f'trajectory: {type(self._reference).__name__}.sample gave shape '
                f'{samples.shape}, expected {(len(ticks), SAMPLE)}'
            )
        return times, samples
