# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectory of the samples in a log, for the recomputation of a run with paths from messages."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
import numpy as np
from numpy.typing import NDArray

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

    def __init__(self, ticks: NDArray[np.int64], samples: Array) -> None:
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

    def positions(self, ticks: NDArray[np.int64]) -> Array:
        """Return the task coordinates (n, axes) at ticks (n); InputError if one is missing."""
        return self._at(ticks)[:, :self._samples.shape[1] // 3]

    def _at(self, ticks: NDArray[np.int64]) -> Array:
        rows = np.minimum(np.searchsorted(self._ticks, ticks), len(self._ticks) - 1)
        missing = (self._ticks[rows] != ticks) | np.isnan(self._samples[rows]).any(axis=1)
        if missing.any():
            raise InputError(
                f'the log has no reference at tick {ticks[int(np.argmax(missing))]}; only a '
                'complete run with paths from messages can be recomputed'
            )
        return self._samples[rows]
