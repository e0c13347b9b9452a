# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What holds at a time, out of what was sent at several: windows of the reference, resets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from masmc_ros.messages.layout import NANOSECONDS
from masmc_ros.messages.names import DERIVATIVES, TASK_AXES
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.numerics.aliases import Array, Stamps
import numpy as np
from numpy.typing import ArrayLike, NDArray

_TOLERANCE = 1
"""Stamps that differ by this many ns are the same time, rounded in two ways."""

_END_OF_TIME = np.iinfo(np.int64).max


def last_pass(stamps: Stamps) -> NDArray[np.intp]:
    """
    Return which of `stamps` (n), in the order of arrival, still hold at the end.

    After a reset, time starts again: what came before the reset and lies at or after the new
    time is void. The stamps that remain ascend strictly.
    """
    if not len(stamps):
        return np.zeros(0, np.intp)
    earliest_later = np.append(np.minimum.accumulate(stamps[::-1])[::-1][1:], _END_OF_TIME)
    return np.flatnonzero(stamps < earliest_later)


class Beginning:
    """
    Where the last pass of a run began.

    Between topics of several nodes the order in a log is that in which a recorder took them: what
    the controller tells with its answer to a state may stand before that state, and what it told
    with its last answer before a reset behind the first state after it.
    """

    def __init__(self, orders: ArrayLike = (), stamps: ArrayLike = ()) -> None:
        """Take the positions of all states in a log and their stamps in ns; nothing: one pass."""
        self._orders, self._stamps = np.array(orders, np.int64), np.array(stamps, np.int64)
        steps = np.diff(self._stamps)
        back = np.flatnonzero(steps < 0)
        self._first = int(back[-1]) + 1 if len(back) else 0
        self._period = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0

    def is_over(self, order: int, stamp: int | None = None) -> bool:
        """Tell whether what is at a position, with the stamp of a state if any, came after it."""
        if not self._first:
            return True
        if stamp is None:
            return order > int(self._orders[self._first])
        before, since = slice(self._first), slice(self._first, None)
        return self._distance(since, order, stamp) < self._distance(before, order, stamp)

    def _distance(self, states: slice, order: int, stamp: int) -> float:
        """Return how far a position and a stamp are from the next state, in messages and ticks."""
        ticks = np.abs(self._stamps[states] - stamp) / self._period
        return float((ticks + np.abs(self._orders[states] - order)).min())


class _Stretch(NamedTuple):
    """Samples that hold: stamps (n) in ns, samples (n, 3, 4), period in ns."""

    stamps: Stamps
    samples: Array
    period: int

    def covers(self, stamp: int) -> bool:
        """Tell whether a window has a stamp between its samples, or next to one."""
        first, last = int(self.stamps[0]), int(self.stamps[-1])
        return bool(self.period) and first - self.period < stamp < last + self.period

    def part(self, start: int, end: int) -> _Stretch:
        return _Stretch(self.stamps[start:end], self.samples[start:end], self.period)


def _lay(windows: Iterable[tuple[int, ReferenceWindow]]) -> list[_Stretch]:
    """
    Lay windows over one another in the order of arrival; return what remains of each.

    As the controller does, a set-point beside a trajectory is left out.
    """
    stretches: list[_Stretch] = []
    for arrival, window in windows:
        stamps = window.stamps()
        if window.stamp_ns is None:
            if any(each.covers(arrival) for each in stretches):
                continue
            stamps = np.array([arrival])
        end = int(stamps[-1])
        beyond = []
        while stretches and stretches[-1].stamps[-1] >= stamps[0]:
            old = stretches.pop()
            first = int(np.searchsorted(old.stamps, stamps[0]))
            after = int(np.searchsorted(old.stamps, end, side='right'))
            if after < len(old.stamps):
                beyond.append(old.part(after, len(old.stamps)))
            if first > 0:
                stretches.append(old.part(0, first))
        stretches.append(_Stretch(stamps, window.samples, round(window.period * NANOSECONDS)))
        stretches.extend(reversed(beyond))
    return stretches


def sample_reference(
    windows: Iterable[tuple[int, ReferenceWindow]], stamps: Stamps, axes: int = TASK_AXES
) -> Array:
    """
    Return the reference at each of `stamps`.

    Newer windows replace older ones where they overlap. Between two samples one period apart
    the reference is their quintic Hermite polynomial; past the end of what was sent it holds
    the last position. A set-point holds as it is.

    Parameters
    ----------
    windows
        each with its time of arrival in ns, in the order of arrival.
    stamps
        (N) in ns.
    axes
        number of task axes.

    Returns
    -------
        (N, 3 axes) position, velocity and acceleration of the task axes, in m, m/s and m/s^2;
        NaN before the first sample.

    """
    stretches = _lay(windows)
    reference = np.full((len(stamps), DERIVATIVES, axes), np.nan)
    if not stretches:
        return reference.reshape(len(stamps), -1)
    times = np.concatenate([each.stamps for each in stretches])
    samples = np.concatenate([each.samples for each in stretches])
    periods = np.concatenate([np.full(len(each.stamps), each.period) for each in stretches])

    before = np.searchsorted(times, stamps + _TOLERANCE, side='right') - 1
    known = before >= 0
    before = np.maximum(before, 0)
    after = np.minimum(before + 1, len(times) - 1)
    step = times[after] - times[before]
    passed = stamps - times[before]
    off_grid = known & (passed > _TOLERANCE) & (periods[before] > 0)
    between = off_grid & (step > 0) & (step <= periods[before] + _TOLERANCE)
    past_end = off_grid & ~between

    reference[known] = samples[before[known]]
    reference[past_end, 1:] = 0.0
    if between.any():
        reference[between] = _between(
            samples[before[between]],
            samples[after[between]],
            step[between] / NANOSECONDS,
            passed[between] / step[between],
        )
    return reference.reshape(len(stamps), -1)


def _between(first: Array, second: Array, period: Array, part: Array) -> Array:
    """Interpolate between samples (n, 3, axes), `period` (n) s apart, at `part` (n) of the way."""
    # The controller's own formula, on arrays. Imported when needed: logs of lock-step runs
    # are on the grid, and its compiler takes longer to import than such a log to read.
    from masmc_ros.numerics.hermite import quintic

    # It scales its arguments in place: copies keep the samples as they are.
    samples = [np.moveaxis(each, 1, 0).copy() for each in (first, second)]
    return np.stack(quintic.py_func(*samples, period[:, None], part[:, None]), axis=1)
