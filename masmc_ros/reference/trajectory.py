# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reference trajectory: its parameters, and samples on the control grid."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import lru_cache
import inspect
from typing import cast, ClassVar

from masmc_ros.aliases import Array, Integers
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted, kernel
from masmc_ros.mistakes import MistakeError, reported
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
from masmc_ros.reference.arc import Arc
from masmc_ros.reference.figure_eight import FigureEight
from masmc_ros.reference.jerk_limited import SetPoint
from masmc_ros.reference.line_sine import line_sine
from masmc_ros.reference.path_file import PathFile
from masmc_ros.reference.reference import Declared, made, Reference
from masmc_ros.reference.rounded_polygon import RoundedPolygon
from masmc_ros.reference.waypoints import Waypoints
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np

ENTRY_POINTS = 'masmc_ros.references'
"""Group of entry points of plug-in trajectory types."""


def _line_sine_parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    def per_axis(name: str, description: str, unit: str) -> Parameter:
        name = f'line_sine.{name}'
        default = mechanism.default(name, 'axes')
        return Parameter(name, default, description, unit=unit, length=len(default))

    units = dict.fromkeys(axis.unit for axis in mechanism.axes)
    unit, per_second = ', '.join(units), ', '.join(f'{unit_name}/s' for unit_name in units)
    return (
        per_axis('offset', 'Position at t = 0 without the sine', unit),
        per_axis('slope', 'Velocity without the sine', per_second),
        per_axis('amplitude', 'Amplitude of the sine', unit),
        per_axis('frequency', 'Frequency of the sine', 'rad/s'),
        per_axis('phase', 'Phase of the sine at t = 0', 'rad'),
    )


_AT_ONCE = 128
"""Number of times at which a path is sampled at once."""


class LineSine:
    """x_d(t) = offset + slope t + amplitude sin(frequency t + phase), axis by axis."""

    parameters: ClassVar[Declared] = staticmethod(_line_sine_parameters)

    def __init__(self, values: Values) -> None:
        """Initialise from checked values, with names without the prefix of the type."""
        names = 'offset', 'slope', 'amplitude', 'frequency', 'phase'
        self._table = np.array([values[name] for name in names], dtype=np.float64)

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return _sample_line_sine(self._table, times)


@kernel
def _sample_line_sine(table: Array, times: Array) -> Array:
    axes, count = table.shape[1], len(times)
    out = np.empty((count, 3 * axes))
    # An axis after the other, of times that a cache holds: a processor takes several at once.
    columns = np.empty((3 * axes, _AT_ONCE))
    for first in range(0, count, _AT_ONCE):
        some = min(_AT_ONCE, count - first)
        for i in range(axes):
            offset, slope = table[0, i], table[1, i]
            amplitude, frequency, phase = table[2, i], table[3, i], table[4, i]
            for k in range(some):
                position, velocity, acceleration = line_sine(
                    times[first + k], offset, slope, amplitude, frequency, phase
                )
                columns[i, k] = position
                columns[axes + i, k] = velocity
                columns[2 * axes + i, k] = acceleration
        for k in range(some):
            for j in range(3 * axes):
                out[first + k, j] = columns[j, k]
    return out


_TICKS_OF_DRY_RUN = 3

BUILT_IN: dict[str, type[Reference]] = {
    'line_sine': LineSine, 'waypoints': Waypoints, 'arc': Arc, 'figure_eight': FigureEight,
    'rounded_polygon': RoundedPolygon, 'set_point': SetPoint, 'file': PathFile,
}


def types() -> tuple[str, ...]:
    """Return the names of all types of trajectory, built in and plugged in."""
    return (*BUILT_IN, *plugged_in(ENTRY_POINTS))


def load(name: str) -> type[Reference]:
    """Return the class of a type of trajectory; raise InputError if it cannot be loaded."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    reference: type[Reference] = load_plug_in(ENTRY_POINTS, 'type', name)
    if not isinstance(reference, type) or not hasattr(reference, 'parameters'):
        raise InputError(
            f'type = {name}: {_place(reference)}: {getattr(reference, "__name__", reference)} has '
            "no 'parameters'; expected a class as in reference/reference.py"
        )
    return reference


def _place(reference: object) -> str:
    """Return file and line of a class."""
    try:
        _, first = inspect.getsourcelines(cast(type, reference))
        return f'{inspect.getfile(cast(type, reference))}:{first}'
    except (OSError, TypeError):
        return repr(reference)


TYPE = Parameter(
    'type', 'line_sine', 'Type of trajectory; its parameters are in its block', read_only=False
)


def parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the declarations of `type` and of the block of every type, for a mechanism."""
    kind = replace(TYPE, choices=types())
    declared = (load(name).parameters for name in types())
    return (
        kind,
        *(
            replace(parameter, read_only=False)
            for declaration in declared
            for parameter in (declaration(mechanism) if callable(declaration) else declaration)
        ),
    )


def path_values(values: Values) -> Values:
    """Return the values that determine the path, among checked ones: type and its block."""
    return {name: values[name] for name in _path_names(TYPE.of(values), tuple(values))}


# A campaign asks for each of its runs.
@lru_cache(maxsize=64)
def _path_names(kind: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in names if name == 'type' or name.startswith(f'{kind}.'))


class Trajectory:
    """
    Trajectory on the control grid, checked against the robot's reach.

    Attributes
    ----------
    kind
        Value of `type`.
    note
        A sentence on what the path leaves out and is planned; empty if it is complete.

    """

    def __init__(self, values: Values, period: float, robot: Robot) -> None:
        """
        Initialise from checked values of `parameters`, and the control period in s.

        Raises InputError if the trajectory is for other task axes than those of the robot, or if
        values contradict each other.
        """
        kind = TYPE.of(values)
        block = f'{kind}.'
        chosen = load(kind)
        own = tuple(axis.name for axis in robot.mechanism.axes)
        wanted = tuple(getattr(chosen, 'axes', own))
        if wanted != own:
            raise InputError(
                f'type = {kind}: a trajectory of {", ".join(wanted)}; expected one of '
                f'{", ".join(own)}, the task axes of {robot.mechanism.name}'
            )
        own_values = {n.removeprefix(block): v for n, v in values.items() if n.startswith(block)}
        self.kind, self._class, self._period = kind, chosen, period
        self._robot = robot
        self._axes = len(own)
        with self._reported():
            self._reference, self.note = made(chosen, own_values, robot)
        if kind not in BUILT_IN:
            # A dry run before compilation, and before the first tick of a node.
            with interpreted():
                self._at(self._times(np.arange(_TICKS_OF_DRY_RUN)))

    def sample(self, first: int, count: int) -> Array:
        """
        Return (count, 3 axes) samples at ticks first, first + 1, ...

        Raises InputError if the robot cannot reach a sample.
        """
        samples = self.unchecked(first, count)
        self.check_reach(self._robot.geometry, first, samples)
        return samples

    def unchecked(self, first: int, count: int) -> Array:
        """Return finite (count, 3 axes) samples at ticks first, ..., in reach or not."""
        return self.at_times(self._times(np.arange(first, first + count)))

    def at_times(self, times: Array) -> Array:
        """Return finite (n, 3 axes) samples at times (n) in s, in reach or not."""
        samples = self._at(times)
        if not np.isfinite(samples).all():
            bad = int(np.argmin(np.isfinite(samples).all(axis=1)))
            raise InputError(
                f'trajectory: not finite at t = {times[bad]:g} s, expected numbers everywhere'
            )
        return samples

    def check_reach(self, geometry: Array, first: int, samples: Array) -> None:
        """Raise InputError if a robot of these lengths cannot reach samples from a first tick."""
        wrong = self._robot.mechanism.formulas.out_of_reach(geometry, samples[:, :self._axes])
        if wrong is not None:
            bad, why = wrong
            raise InputError(f'trajectory: at t = {(first + bad) * self._period:g} s {why}')

    def positions(self, ticks: Integers) -> Array:
        """Return the desired n x axes entries, in m, at any n ticks, reachable or not."""
        return self._at(self._times(ticks))[:, :self._axes]

    def _times(self, ticks: Integers) -> Array:
        """Return the times (n) in s of ticks (n)."""
        return ticks.astype(np.float64) * self._period

    def _at(self, times: Array) -> Array:
        """Return samples (n, 3 axes) at times (n) in s."""
        with self._reported():
            samples = np.asarray(self._reference.sample(times), dtype=np.float64)
            expected = len(times), 3 * self._axes
            if samples.shape != expected:
                raise MistakeError(
                    f'{type(self._reference).__name__}.sample returns the shape {samples.shape}: '
                    f'expected {expected}, one row per time with position, velocity and '
                    'acceleration of all axes'
                )
        return samples

    def _reported(self) -> AbstractContextManager[None]:
        """Report mistakes of a type from another package in one line."""
        if self.kind in BUILT_IN:
            return nullcontext()
        place = _place(self._class)
        return reported(f'type = {self.kind}', [place.rpartition(':')[0]], place)
