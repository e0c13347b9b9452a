# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Order of the messages of a log, and the robot's time of messages without a stamp."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from masmc_ros.aliases import Stamps
from masmc_ros.errors import InputError
from masmc_ros.log.read.contents import LogContents, NO_TIME, Topic
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.timeline import resets
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.stamps import header_stamp
import numpy as np
from numpy.typing import NDArray

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
    log_times: Sequence[int], logged: NDArray[np.int64], stamps: Stamps
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
