# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps of messages: read without deserialisation, and the order of those of states."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import lru_cache

from masmc_ros.aliases import Indices, Stamps
from masmc_ros.errors import InputError
from masmc_ros.loop.controller_parameters import STATE_TIMEOUT
from masmc_ros.loop.timing import CONTROL_PERIOD
from masmc_ros.messages.cdr_layout import checked_stamp, ENCAPSULATION, NANOSECONDS, STAMP
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.telemetry import telemetry_count, TelemetryCdr
from masmc_ros.messages.topics import ARM_VELOCITY_TOPIC, COMMAND_TOPIC, TELEMETRY, telemetry_topic
from masmc_ros.params.declaration import Values
import numpy as np

StampReader = Callable[[bytes], int | None]
"""Function that returns a stamp in ns, None for a message without one; InputError if invalid."""

TRANSFORMS_TYPE = 'tf2_msgs/msg/TFMessage'

_STAMPED = (
    'sensor_msgs/msg/JointState',
    'nav_msgs/msg/Odometry',
    'nav_msgs/msg/Path',
    'geometry_msgs/msg/TwistStamped',
    'rosgraph_msgs/msg/Clock',
)
"""Types whose messages start with a stamp of the robot's clock."""


def header_stamp(raw: bytes) -> int:
    """
    Return the stamp in ns of a message that starts with a header or a time.

    Raises InputError if the message is too short or the stamp is invalid.
    """
    return _stamp_at(raw, len(ENCAPSULATION))


def transforms_stamp(raw: bytes) -> int | None:
    """Return the stamp in ns of a TFMessage's first transform; None without transforms."""
    start = len(ENCAPSULATION) + 4
    # Bytes after a count of 0 are padding.
    return _stamp_at(raw, start) if any(raw[len(ENCAPSULATION):start]) else None


def stamp_reader(topic: str, type_name: str) -> StampReader:
    """
    Return the reader of the stamps of a topic's messages.

    `topic` is relative to the robot. Commands have the stamp of the state to which they respond,
    telemetry that of the state of its tick.
    """
    if type_name in _STAMPED:
        return header_stamp
    if type_name == TRANSFORMS_TYPE:
        return transforms_stamp
    if topic == COMMAND_TOPIC:
        return EFFORT.stamp_of
    if topic == ARM_VELOCITY_TOPIC:
        return ARM_VELOCITY.stamp_of
    for label in TELEMETRY:
        if topic == telemetry_topic(label):
            return _telemetry_reader(label)
    return lambda _: None


def _stamp_at(raw: bytes, start: int) -> int:
    if len(raw) < start + STAMP.size:
        raise InputError(f'a message of {len(raw)} bytes has no stamp')
    seconds, nanoseconds = STAMP.unpack_from(raw, start)
    return checked_stamp(seconds * NANOSECONDS + nanoseconds)


def _telemetry_reader(label: str) -> StampReader:
    """Return the reader for telemetry messages of any size."""

    @lru_cache(maxsize=8)
    def telemetry(size: int) -> TelemetryCdr:
        return TelemetryCdr(label, max(1, telemetry_count(label, size)))

    def read(raw: bytes) -> int | None:
        message = telemetry(len(raw))
        if len(raw) == message.size and raw.startswith(message.head):
            return message.stamp_of(raw)
        return message.stamp_ns if message.load(raw) else None

    return read


_CONFIRMED = 3
"""Number of consecutive older states after which time was set back."""

_MIN_PERIODS = 5
"""Smallest state timeout in control periods; shorter ones would reject ordinary jitter."""


def state_timeout(values: Values) -> float:
    """Return the state timeout of a controller's parameters in s, at least five periods."""
    minimum: float = _MIN_PERIODS * CONTROL_PERIOD.of(values)
    return max(STATE_TIMEOUT.of(values), minimum)


def in_time(stamps: Stamps, gap_ns: int | None) -> Indices:
    """
    Return the indices of the states that are not late.

    Parameters
    ----------
    stamps
        Stamps (n) of the states in ns, in order of arrival.
    gap_ns
        Longest ordinary interval in ns between two states; None: lock-step.

    """
    order = StampOrder()
    order.gap_ns = gap_ns
    if gap_ns is None or not (np.diff(stamps) < 0).any():
        return np.arange(len(stamps))
    orders = map(order.judge, stamps.tolist())
    return np.flatnonzero([order is not Order.LATE for order in orders])


class Order(Enum):
    """Order of a stamp after the previous ones."""

    NEXT = 'next'
    REPEATED = 'repeated'
    LATE = 'late'
    """Older than a state with a response: out of order, or delayed by the network."""
    AHEAD = 'ahead'
    """Far ahead: states were lost, or a clock was set forward."""
    BACK = 'back'
    """Time was set back: the robot was restarted, or a clock was set."""


class StampOrder:
    """
    Order of the stamps of received states.

    In lock-step every state waits for its command, so an older stamp always means that time was
    set back. In real time messages may be late or out of order. An older stamp then means this
    only if it is older by more than `gap_ns`, or if it is the third of ascending older stamps.

    Attributes
    ----------
    gap_ns
        Longest ordinary interval in ns between two states; None: lock-step.
    last
        Latest stamp in ns that gets a response; None before the first one.

    """

    def __init__(self) -> None:
        """Initialise without a stamp, for lock-step."""
        self.gap_ns: int | None = None
        self.last: int | None = None
        self._older: list[int] = []

    def judge(self, stamp: int) -> Order:
        """Return the order of a stamp in ns; keep the stamp unless it is late or repeated."""
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
        return self.set_back(stamp)

    def set_back(self, stamp: int) -> Order:
        """Continue from an older stamp in ns; return that time was set back."""
        self._older.clear()
        self.last = stamp
        return Order.BACK
