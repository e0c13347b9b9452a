# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Compiled readers and writers of the messages of every tick.

They read messages of the package's own layouts and leave all others to rclpy. The classes of the
messages import this module when they use it first: reading a log needs no compiler.

Several functions share these arguments: `raw` is a received message as bytes, `forms` are those
of its `Layout`, `message` the bytes of a message of that layout.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Bytes, Integers
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.messages.cdr_layout import (
    END_OF_TIME,
    HEADER_SIZE,
    NANOSECOND_DIGITS,
    NANOSECONDS,
    UNREAD,
)
import numpy as np

_POINT, _ZERO = ord('.'), ord('0')


@formula
def is_like(raw: Bytes, forms: Bytes) -> bool:
    """Return True if bytes are a message with the layout of `forms`; padding bytes are ignored."""
    template, constant = forms[0], forms[1]
    if len(raw) != len(template):
        return False
    differs = np.uint8(0)
    for i in range(len(template)):
        differs |= (raw[i] ^ template[i]) & constant[i]
    return differs == 0


@formula
def copy_message(raw: Bytes, forms: Bytes, message: Bytes) -> None:
    """Write the varying bytes of a message into another, with zeros for padding bytes."""
    template, varies = forms[0], forms[2]
    for i in range(len(template)):
        message[i] = template[i] | raw[i] & varies[i]


@formula
def uint32_at(raw: Bytes, place: int) -> np.int64:
    """Return the little-endian uint32 from byte `place` on."""
    number = np.int64(0)
    for i in range(4):
        number |= np.int64(raw[place + i]) << 8 * i
    return number


@formula
def stamp_at(raw: Bytes, place: int) -> np.int64:
    """Return the stamp in ns of a builtin_interfaces/Time from byte `place` on."""
    return uint32_at(raw, place) * NANOSECONDS + uint32_at(raw, place + 4)


@formula
def are_finite(raw: Bytes, first: int, count: int) -> bool:
    """Return True if the float64 numbers from byte `first` on are finite, by their exponents."""
    for i in range(count):
        high, low = raw[first + 8 * i + 7], raw[first + 8 * i + 6]
        if high & 0x7F == 0x7F and low & 0xF0 == 0xF0:
            return False
    return True


@kernel
def load(raw: Bytes, forms: Bytes, message: Bytes) -> bool:
    """Copy a message of a layout's `forms`; False for a message of another layout."""
    if not is_like(raw, forms):
        return False
    copy_message(raw, forms, message)
    return True


@kernel
def read_state(raw: Bytes, forms: Bytes, starts: Integers, message: Bytes) -> int | np.int64:
    """Read a joint state whose fields start at bytes `starts`; return its stamp or UNREAD."""
    joints = (len(message) - starts[2]) // 8
    if not (
        is_like(raw, forms)
        and are_finite(raw, starts[0], joints)
        and are_finite(raw, starts[1], joints)
    ):
        return UNREAD
    stamp = stamp_at(raw, HEADER_SIZE)
    if stamp >= END_OF_TIME:
        return UNREAD
    copy_message(raw, forms, message)
    return stamp


@kernel
def write_state(
    stamp: int, position: Array, velocity: Array, effort: Array, places: Integers, words: Array
) -> None:
    """Write a joint state; `words` is the message as float64, `places` the fields' first words."""
    for i in range(len(position)):
        words[places[0] + i] = position[i]
        words[places[1] + i] = velocity[i]
    for i in range(len(effort)):
        words[len(words) - len(effort) + i] = effort[i]
    seconds, nanoseconds = stamp // NANOSECONDS, stamp % NANOSECONDS
    words.view(np.int64)[1] = seconds | nanoseconds << 32


@kernel
def read_command(
    raw: Bytes, forms: Bytes, places: Integers, numbers: Array
) -> tuple[int | np.int64, bool]:
    """
    Read a command; return its stamp in ns, or UNREAD, and True for a void command.

    `places` are the bytes at which the stamp starts and ends, the numbers and `data_offset` start.
    """
    if not (is_like(raw, forms) and are_finite(raw, places[2], len(numbers))):
        return UNREAD, False
    # Ten digits of seconds and nine of nanoseconds would overflow in one number.
    seconds, part = np.int64(0), np.int64(0)
    for i in range(places[0], places[1]):
        if i == places[1] - 1 - NANOSECOND_DIGITS:
            if raw[i] != _POINT:
                return UNREAD, False
        else:
            digit = np.int64(raw[i]) - _ZERO
            if digit < 0 or digit > 9:
                return UNREAD, False
            if i < places[1] - 1 - NANOSECOND_DIGITS:
                seconds = seconds * 10 + digit
            else:
                part = part * 10 + digit
    if seconds >= END_OF_TIME // NANOSECONDS:
        return UNREAD, False
    offset = uint32_at(raw, places[3])
    if offset != 0 and offset != len(numbers):
        return UNREAD, False
    written = numbers.view(np.uint8)
    for i in range(len(written)):
        written[i] = raw[places[2] + i]
    return seconds * NANOSECONDS + part, offset != 0


@kernel
def write_command(stamp: int, numbers: Array, places: Integers, message: Bytes) -> None:
    """Write the stamp and the numbers of a command; `places` as for `read_command`."""
    remaining = stamp
    for k in range(1, places[1] - places[0] + 1):
        if k == 1 + NANOSECOND_DIGITS:
            message[places[1] - k] = _POINT
        else:
            message[places[1] - k] = remaining % 10 + _ZERO
            remaining //= 10
    source = numbers.view(np.uint8)
    for i in range(len(source)):
        message[places[2] + i] = source[i]


@kernel
def write_telemetry(stamp: int, values: Array, numbers: Array) -> None:
    """Write the stamp in ns and the values of telemetry."""
    numbers[0], numbers[1] = stamp // NANOSECONDS, stamp % NANOSECONDS
    for i in range(len(values)):
        numbers[2 + i] = values[i]
