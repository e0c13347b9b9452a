# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Samples of a plot in a moving window of time."""

from __future__ import annotations

from collections.abc import Iterable

from masmc_ros.aliases import Array
import numpy as np
from numpy.typing import ArrayLike

WINDOW = 20.0
"""Length of the window in s of robot time."""


class SampleWindow:
    """
    Vectors with their times over the last `WINDOW` seconds; the memory is bounded.

    Attributes
    ----------
    times
        Times (k) in s, strictly increasing.
    values
        Vectors (k, width).

    """

    def __init__(self, width: int, most: int) -> None:
        """
        Initialise an empty window.

        Parameters
        ----------
        width
            Number of components of a vector.
        most
            Largest number of samples; the oldest are dropped.

        """
        self._most = most
        self.times: Array = np.zeros(0)
        self.values: Array = np.zeros((0, width))

    def append(self, time: float, vector: ArrayLike) -> None:
        """
        Append a vector (width) at a time in s.

        A sample at the last time is ignored: the robot is paused. An earlier time clears the
        window: the robot was reset.
        """
        if len(self.times) and time == self.times[-1]:
            return
        if len(self.times) and time < self.times[-1]:
            self.times, self.values = self.times[:0], self.values[:0]
        first = int(np.searchsorted(self.times, time - WINDOW))
        first = max(first, len(self.times) - self._most + 1)
        self.times = np.append(self.times[first:], time)
        self.values = np.vstack((self.values[first:], np.asarray(vector)[None]))

    def marks(self, times: Iterable[float]) -> Array:
        """Return 1 at the samples (k) that follow these times in s first, 0 elsewhere."""
        marks = np.zeros(len(self.times))
        places = np.searchsorted(self.times, list(times))
        marks[places[(places > 0) & (places < len(marks))]] = 1.0
        return marks
