# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lateness of states: their age relative to the mean age, from stamps and times of arrival."""

from __future__ import annotations

_MEMORY = 1000
"""Number of states after which the weight of a state in the mean has fallen to 1/e."""


class StateLateness:
    """
    Difference of the age of each state to the mean age.

    A constant difference of the clocks of stamps and arrivals has no effect.
    """

    def __init__(self) -> None:
        """Initialise without a state."""
        self._origin, self._mean, self._count = 0, 0.0, 0

    def restart(self) -> None:
        """Restart the mean, because the clock of the stamps may have been set."""
        self._count = 0

    def add(self, stamp: int, now: float) -> float:
        """Return by how much a state (stamp in ns) is later than usual at a time, both in s."""
        difference = round(1e9 * now) - stamp
        if self._count == 0:
            self._origin, self._mean = difference, 0.0
        self._count = min(self._count + 1, _MEMORY)
        age = 1e-9 * (difference - self._origin)
        self._mean += (age - self._mean) / self._count
        return age - self._mean
