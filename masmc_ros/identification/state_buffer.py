# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Buffer of states of a running robot with their commands."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.aliases import Array
import numpy as np

_LONGEST_GAP = 2.5
"""Interval between two states above which there is a gap, in control periods."""


class StateBuffer:
    """Buffer of a constant number of consecutive states."""

    def __init__(self, count: int, widths: Sequence[int], period: float) -> None:
        """
        Initialise an empty buffer.

        Parameters
        ----------
        count
            Number N of states of a full buffer.
        widths
            Number of components of each value of a state.
        period
            Control period in s.

        """
        self._stamps = np.zeros(count, np.int64)
        self._numbers = np.zeros((count, sum(widths)))
        ends = np.cumsum(widths).tolist()
        self._columns = [slice(end - width, end) for end, width in zip(ends, widths, strict=True)]
        self._longest = round(1e9 * _LONGEST_GAP * period)
        self._count = self._last = 0

    def add(self, stamp: int, *values: Array) -> list[Array] | None:
        """
        Add a state, and return the content of a full buffer; a gap empties the buffer.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        values
            Values of the state, (width) each.

        Returns
        -------
            Times in s (N), ascending from zero, and each value (N, width); None if not full.

        """
        if not 0 < stamp - self._last <= self._longest:
            self._count = 0
        count, self._last = self._count, stamp
        self._stamps[count] = stamp
        row = self._numbers[count]
        for column, value in zip(self._columns, values, strict=True):
            row[column] = value
        self._count = count + 1
        if self._count < len(self._stamps):
            return None
        self._count = 0
        times = np.asarray(1e-9 * (self._stamps - self._stamps[0]), np.float64)
        numbers = self._numbers.copy()
        return [times, *(numbers[:, column] for column in self._columns)]
