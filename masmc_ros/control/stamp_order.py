# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Order of the stamp of a state after the last one: next, repeated, late, or another time."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

_CONFIRMED = 3
"""States in a row that must be older before time is taken to have been set back."""

_FEWEST_PERIODS = 5
"""Control periods that the state timeout is at least."""


def state_timeout(values: Mapping[str, Any]) -> float:
    """Return that of a controller's parameters, in s; five periods, lest every state is late."""
    least: float = _FEWEST_PERIODS * values['control_period']
    return max(values['state_timeout'], least)


def in_time(stamps: NDArray[np.int64], gap_ns: int | None) -> NDArray[np.intp]:
    """Return which of the states of stamps (n) in ns, in order of arrival, are not late."""
    order = StampOrder()
    order.gap_ns = gap_ns
    if gap_ns is None or not (np.diff(stamps) < 0).any():
        return np.arange(len(stamps))
    judged = map(order.judge, stamps.tolist())
    return np.flatnonzero([each is not Order.LATE for each in judged])


class Order(Enum):
    """Order of a stamp after the previous ones."""

    NEXT = 'next'
    REPEATED = 'repeated'
    LATE = 'late'
    """Older than one that was answered: out of order or on its way for long."""
    AHEAD = 'ahead'
    """Far ahead: states were lost, or a clock was set forward."""
    BACK = 'back'
    """Time was set back: the robot started again, or a clock was set."""


class StampOrder:
    """
    Judges the stamps of states as they come.

    In lock-step every state waits for its answer: an older stamp then always tells that the
    robot was set back. In real time messages may come late and out of order, and an older
    stamp means that time was set back only when it is older by more than `gap_ns`, or when a
    third one in a row is, ascending.
    """

    def __init__(self) -> None:
        """Start without a stamp, for lock-step."""
        self.gap_ns: int | None = None
        """Longest ordinary distance in ns between two states; None: lock-step."""
        self.last: int | None = None
        """The latest stamp in ns that was to be answered."""
        self._older: list[int] = []

    def judge(self, stamp: int) -> Order:
        """Return the order of a stamp in ns, and note the stamp unless it is late or repeated."""
        last = self.last
        if last is None or stamp > last:
            self.last = stamp
            self._older.clear()
            is_far = last is not None and self.gap_ns is not None and stamp - last > self.gap_ns
            return Order.AHEAD if is_far else Order.NEXT
        if stamp == last:
            return Order.REPEATED
        if self.gap_ns is not None and last - stamp <= self.gap_ns:
            if self._older and stamp <= self._older[-1]:
                self._older.clear()
            self._older.append(stamp)
            if len(self._older) < _CONFIRMED:
                return Order.LATE
        self._older.clear()
        self.last = stamp
        return Order.BACK
