# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interface of a trajectory type, and the trajectory of the samples in a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol

from masmc_ros.aliases import Array, Integers
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np

Declared = tuple[Parameter, ...] | Callable[[Mechanism], tuple[Parameter, ...]]
"""Declarations of a trajectory type: parameters, or a function of the mechanism."""


class Reference(Protocol):
    """
    Type of trajectory with a class attribute `parameters`, created from checked values.

    A type for certain task axes has their names in the class attribute `axes`. A type that depends
    on the task has a class method `of(values, mechanism)`, which creates it. A type whose path may
    leave out the base has a method `complete(robot)`, which adds that of a robot with a carrier,
    and returns a sentence on it; empty if there is nothing to add.
    """

    parameters: ClassVar[Declared]

    def __init__(self, values: Values) -> None:
        """Initialise from checked values, with names without the prefix of the type."""

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s: positions, velocities, accelerations."""
        ...


def made(kind: type[Reference], values: Values, robot: Robot) -> tuple[Reference, str]:
    """
    Return a trajectory of a type from checked values, and a sentence on what it has added.

    Raises InputError if the type rejects the values.
    """
    of: Callable[[Values, Mechanism], Reference] | None = getattr(kind, 'of', None)
    reference = kind(values) if of is None else of(values, robot.mechanism)
    complete: Callable[[Robot], str] | None = getattr(reference, 'complete', None)
    return reference, '' if complete is None else complete(robot)


PATH_RECEIVED = 'path received'
"""Event of the trajectory node at the first tick of a path from a message or of parameters."""


class SampledTrajectory:
    """
    Trajectory of samples at the ticks of a run; as `Trajectory` for a simulation.

    Attributes
    ----------
    note
        Empty, because the samples are complete.

    """

    note = ''

    def __init__(self, ticks: Integers, samples: Array) -> None:
        """
        Initialise the trajectory.

        Parameters
        ----------
        ticks
            Ticks (n) of the samples, ascending.
        samples
            Samples (n, 3 axes).

        """
        self._ticks, self._samples = ticks, samples

    def sample(self, first: int, count: int) -> Array:
        """Return (count, 3 axes) samples at ticks first, ...; InputError if one is missing."""
        return self._at(np.arange(first, first + count))

    def positions(self, ticks: Integers) -> Array:
        """Return the task coordinates (n, axes) at ticks (n); InputError if one is missing."""
        return self._at(ticks)[:, :self._samples.shape[1] // 3]

    def _at(self, ticks: Integers) -> Array:
        rows = np.minimum(np.searchsorted(self._ticks, ticks), len(self._ticks) - 1)
        missing = (self._ticks[rows] != ticks) | np.isnan(self._samples[rows]).any(axis=1)
        if missing.any():
            raise InputError(
                f'the log has no reference at tick {ticks[int(np.argmax(missing))]}; only a '
                'complete run with paths from messages can be recomputed'
            )
        return self._samples[rows]
