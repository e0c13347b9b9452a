# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps of serialised messages, read without deserialisation."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import checked_stamp, ENCAPSULATION, NANOSECONDS, STAMP
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, COMMAND_TOPIC, TELEMETRY, telemetry_topic
from masmc_ros.messages.telemetry import telemetry_count, TelemetryCdr

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
