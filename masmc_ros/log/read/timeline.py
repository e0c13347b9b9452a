# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Time line of a run: the pass after the last reset, the order of messages, and the reference.

Messages without a stamp get the robot's time from their place in the order.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import cast, NamedTuple

from masmc_ros.aliases import Array, Flags, Indices, Integers, Stamps
from masmc_ros.errors import InputError
from masmc_ros.log.read.decode import LogContents, NO_TIME, Series, Topic
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import DERIVATIVES, TASK_AXES
import numpy as np
from numpy.typing import ArrayLike

_TOLERANCE = 1
"""Stamps that differ by this many ns are the same time, rounded in two ways."""

_END_OF_TIME = np.iinfo(np.int64).max

_REACH = 10_000
"""Number of messages of a log by which its topics may be out of order."""

_COVERED = 1.5
"""Interval between two earlier stamps, in periods, which leaves no room for one more."""

_CONFIRMED = 3
"""Number of consecutive stamps in time that has passed already, which prove a reset."""


def resets(stamps: Stamps) -> list[int]:
    """
    Return the places of those `stamps` (n), in the order of the log, that start a new pass.

    A log may be out of order: its recorder compresses in several threads, or files were merged.
    A late message then fills a gap. After a reset, time that has passed already passes again:
    stamps are equal to earlier ones, or consecutive stamps lie between adjacent earlier ones.
    """
    steps = np.diff(stamps)
    if not (steps < 0).any():
        return []
    distances = np.diff(np.unique(stamps))
    room = _COVERED * float(np.median(distances)) if len(distances) else 0.0
    start = int(np.argmax(steps < 0)) + 1
    passed: list[int] = np.unique(stamps[:start]).tolist()
    places, first_covered, count = [], 0, 0
    for index, stamp in enumerate(stamps[start:].tolist(), start):
        if stamp > passed[-1]:
            passed.append(stamp)
            count = 0
            continue
        place = bisect_left(passed, stamp)
        is_equal = passed[place] == stamp
        # A repeated message is no reset.
        if is_equal and stamp == stamps[index - 1]:
            continue
        is_between = place > 0 and passed[place] - passed[place - 1] < room
        is_before = place == 0 and passed[0] - stamp > NANOSECONDS
        if not (is_equal or is_between):
            count = 0
        elif count == 0 or stamp < stamps[index - 1]:
            first_covered, count = index, 1
        else:
            count += 1
        if is_equal or is_before or count == _CONFIRMED:
            first = index if not count else first_covered
            places.append(first)
            void_from = int(stamps[first:index + 1].min())
            del passed[bisect_left(passed, void_from):]
            passed += sorted(stamps[first:index + 1].tolist())
            count = 0
        elif count == 0:
            passed.insert(place, stamp)
    return places


def last_pass_in_order(stamps: Stamps) -> Indices:
    """
    Return the places of the valid `stamps` (n), as `last_pass`, in the order of time.

    The stamps of a pass may be out of order in the log.
    """
    if not (np.diff(stamps) < 0).any():
        return last_pass(stamps)
    starts = np.zeros(len(stamps), np.int64)
    starts[resets(stamps)] = 1
    order = np.lexsort((stamps, np.cumsum(starts)))
    places: Indices = order[last_pass(stamps[order])]
    return places


def last_pass(stamps: Stamps) -> Indices:
    """
    Return the places of those `stamps` (n), in the order of arrival, that are valid at the end.

    After a reset, time starts again: earlier stamps at or after the new time are void. The
    remaining stamps ascend strictly.
    """
    if not len(stamps):
        return np.zeros(0, np.intp)
    earliest_later = np.append(np.minimum.accumulate(stamps[::-1])[::-1][1:], _END_OF_TIME)
    return np.flatnonzero(stamps < earliest_later)


class PassStart:
    """
    Start of the last pass of a run.

    A recorder takes topics of several nodes in any order: telemetry of a state may precede
    this state in the log, and telemetry of the last state before a reset may follow the first
    state after it.
    """

    def __init__(self, orders: ArrayLike = (), stamps: ArrayLike = ()) -> None:
        """
        Initialise the start; without states there is one pass.

        Parameters
        ----------
        orders
            (n) positions of all states in the log.
        stamps
            (n) their stamps in ns.

        """
        self._orders, self._stamps = np.array(orders, np.int64), np.array(stamps, np.int64)
        steps = np.diff(self._stamps)
        self._first = max(resets(self._stamps), default=0)
        self._period = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        if self._first:
            self._order, self._stamp = int(self._orders[self._first]), self._stamps[self._first]
            # States further away belong to no record whose pass is in question.
            ends = self._order - 2 * _REACH, self._order + 2 * _REACH
            start, end = np.searchsorted(self._orders, ends).tolist()
            start = min(start, self._first - 1)
            self._orders, self._stamps = self._orders[start:end], self._stamps[start:end]
            self._first -= start

    def is_over(self, order: int, stamp: int | None = None) -> bool:
        """Return True if a record, with the stamp of its state if any, is of the last pass."""
        if not self._first:
            return True
        if stamp is None or abs(order - self._order) > _REACH:
            return order > self._order
        ticks = np.abs(self._stamps - stamp) / self._period
        distances = ticks + np.abs(self._orders - order)
        return bool(distances[self._first:].min() < distances[:self._first].min())

    def kept(self, orders: Integers, stamps: Stamps) -> Indices:
        """Return the indices of the records (n) of a topic that are valid and of its last pass."""
        valid = np.flatnonzero(self.are_valid(orders, stamps))
        return valid[last_pass_in_order(stamps[valid])]

    def are_valid(self, orders: Integers, stamps: Stamps) -> Flags:
        """
        Return which records (n) of a topic the reset did not make void.

        A topic may have no messages in the last pass, or none at its start: its own stamps do not
        show the reset then. Void are records of earlier passes at or after the new time.
        """
        if not self._first:
            return np.ones(len(orders), np.bool_)
        is_valid = (orders > self._order) | (stamps < self._stamp)
        for index in np.flatnonzero(np.abs(orders - self._order) <= _REACH).tolist():
            stamp = int(stamps[index])
            is_valid[index] = stamp < self._stamp or self.is_over(int(orders[index]), stamp)
        return is_valid


class _Samples(NamedTuple):
    """Valid samples: stamps (n) in ns, samples (n, 3, 4), period in ns."""

    stamps: Stamps
    samples: Array
    period: int

    def covers(self, stamp: int) -> bool:
        """Return True if a stamp lies between the samples of a window, or next to one."""
        first, last = int(self.stamps[0]), int(self.stamps[-1])
        return bool(self.period) and first - self.period < stamp < last + self.period

    def part(self, start: int, end: int | None = None) -> _Samples:
        return _Samples(self.stamps[start:end], self.samples[start:end], self.period)


def _overlay(windows: Iterable[tuple[int, ReferenceWindow]]) -> list[_Samples]:
    """
    Overlay windows in the order of arrival; return the remaining samples of each.

    A set-point during a trajectory is ignored, as in the controller.
    """
    parts: list[_Samples] = []
    for arrival, window in windows:
        stamps = window.stamps()
        if window.stamp_ns is None:
            if any(part.covers(arrival) for part in parts):
                continue
            stamps = np.array([arrival])
        later = []
        while parts and parts[-1].stamps[-1] >= stamps[0]:
            old = parts.pop()
            first = int(np.searchsorted(old.stamps, stamps[0]))
            after = int(np.searchsorted(old.stamps, stamps[-1], side='right'))
            if after < len(old.stamps):
                later.append(old.part(after))
            if first > 0:
                parts.append(old.part(0, first))
        parts.append(_Samples(stamps, window.samples, round(window.period * NANOSECONDS)))
        parts.extend(reversed(later))
    return parts


def sample_reference(
    windows: Iterable[tuple[int, ReferenceWindow]], stamps: Stamps, axes: int = TASK_AXES
) -> Array:
    """
    Return the reference at each of `stamps`.

    Newer windows replace older ones in their overlap. Between two samples one period apart
    the reference is their quintic Hermite polynomial; after the end it holds the last position.
    A set-point is constant.

    Parameters
    ----------
    windows
        windows with their time of arrival in ns, in the order of arrival.
    stamps
        (N) in ns.
    axes
        number of task axes.

    Returns
    -------
        (N, 3 axes) position, velocity and acceleration of the task axes, in m, m/s and m/s^2;
        NaN before the first sample.

    """
    parts = _overlay(windows)
    reference = np.full((len(stamps), DERIVATIVES, axes), np.nan)
    if not parts:
        return reference.reshape(len(stamps), -1)
    times = np.concatenate([part.stamps for part in parts])
    samples = np.concatenate([part.samples for part in parts])
    periods = np.concatenate([np.full(len(part.stamps), part.period) for part in parts])

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
    # The controller's compiled function, on arrays. Imported here: logs of lock-step runs are on
    # the grid, and importing the compiler takes longer than reading such a log.
    from masmc_ros.jit.compiled import Formula
    from masmc_ros.numerics.hermite import quintic

    # It scales its arguments in place.
    samples = [np.moveaxis(sample, 1, 0).copy() for sample in (first, second)]
    plain = cast(Formula, quintic).py_func
    return np.stack(plain(*samples, period[:, None], part[:, None]), axis=1)


_OTHER_CLOCK = NANOSECONDS // 10
"""Difference in ns between log time and stamp from which a report mentions two clocks."""


def sort_by_log_time(contents: LogContents, states: Topic) -> None:
    """
    Put the messages of a log into the order of their log times.

    A recorder that compresses in several threads, or a program that merges or converts files,
    may write them in another order. If log times are the robot's time, which a reset sets back,
    the order in the file is that of arrival: it remains.

    Parameters
    ----------
    contents
        the log, whose topics are changed.
    states
        topic of the joint states.

    """
    topics = [topic for topic in contents.topics.values() if topic.messages]
    orders = np.concatenate([topic.orders for topic in topics]).astype(np.int64)
    log_times = np.empty(len(orders), np.int64)
    log_times[orders] = np.concatenate([np.array(t.log_times, np.int64) for t in topics])
    if (np.diff(log_times) >= 0).all() or _has_robot_time(states):
        return
    ranks = np.empty(len(orders), np.int64)
    ranks[np.argsort(log_times, kind='stable')] = np.arange(len(orders))
    for topic in topics:
        places = ranks[topic.orders]
        topic.orders = np.sort(places).tolist()
        sequence = np.argsort(places).tolist()
        topic.log_times = [topic.log_times[index] for index in sequence]
        topic.messages = [topic.messages[index] for index in sequence]


def _has_robot_time(states: Topic) -> bool:
    """Return True if log times are the stamps, or if a reset sets them back as well."""
    stamps, log_times = [], []
    for raw, log_time in zip(states.messages, states.log_times, strict=True):
        with suppress(InputError):
            stamps.append(header_stamp(raw))
            log_times.append(log_time)
    clock, logged = np.array(stamps, np.int64), np.array(log_times, np.int64)
    if np.mean(clock == logged) > 0.5:
        return True
    starts = np.array(resets(clock), np.int64)
    return bool(len(starts)) and bool((logged[starts] < logged[starts - 1]).all())


def align_log_times(contents: LogContents, states: Topic, decoded: Series) -> list[str]:
    """
    Replace log times by the robot's time if they are times of another clock, or of arrival.

    A bag that was recorded next to a simulator has stamps in simulation time and log times of
    the wall clock. The states have both: between two states, the robot's time of a message
    follows by linear interpolation.

    Parameters
    ----------
    contents
        the log, whose topics are changed.
    states
        topic of the joint states.
    decoded
        its usable states of the last pass, whose stamps ascend.

    Returns
    -------
        A sentence about the clocks; empty if they are the same.

    Raises
    ------
    InputError
        if log times of all states are equal.

    """
    assert decoded.orders is not None
    at = np.searchsorted(np.array(states.orders, np.int64), decoded.orders)
    logged, stamps = np.array(states.log_times, np.int64)[at], decoded.stamps
    if (logged == stamps).all():
        return []
    offset = int(np.median(logged - stamps))
    seconds = abs(offset) / NANOSECONDS
    relation = 'after' if offset > 0 else 'before'
    text = f'Log times are {seconds:.3f} s {relation} the stamps of the states (median)'
    rising = np.flatnonzero(np.diff(np.maximum.accumulate(logged), prepend=logged[0] - 1) > 0)
    is_constant = len(rising) < 2
    for topic in contents.topics.values():
        if topic is not states and topic.messages:
            if is_constant:
                topic.log_times = [NO_TIME] * len(topic.log_times)
            else:
                topic.log_times = _robot_times(topic.log_times, logged[rising], stamps[rising])
    if is_constant:
        return [f'{text}, and equal for all states: messages without a stamp are not used.']
    if abs(offset) < _OTHER_CLOCK:
        return []
    return [f'{text}: messages without a stamp have the time of the states around them.']


def _robot_times(
    log_times: Sequence[int], logged: Integers, stamps: Stamps
) -> list[int]:
    """Interpolate log times; outside of the states, the offset is that of the next state."""
    times = np.array(log_times, np.int64)
    # Differences are exact in doubles, times since 1970 in ns are not.
    inside = np.interp(
        (times - logged[0]).astype(np.float64),
        (logged - logged[0]).astype(np.float64),
        (stamps - stamps[0]).astype(np.float64),
    )
    beyond = np.minimum(times - logged[0], 0) + np.maximum(times - logged[-1], 0)
    aligned: list[int] = (np.rint(inside).astype(np.int64) + stamps[0] + beyond).tolist()
    return aligned
