# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The messages of every tick, from bytes to numbers and back, each by one call of compiled code.

What is read here is laid out like ours and in order in every respect. All else, be it right or
wrong, is left to the classes of the messages, which say what is wrong with it.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.messages.commands import CommandKind, LABEL_SIZE, LabelledCdr, NANOSECOND_DIGITS
from masmc_ros.messages.joint_state import FIELDS, joint_state_layout, JointStateCdr
from masmc_ros.messages.layout import ENCAPSULATION, END_OF_TIME, Layout, NANOSECONDS
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.numerics.compiled import bound, formula, kernel
import numpy as np
from numpy.typing import NDArray

UNREAD = -1
"""In place of a stamp: the message is for others to read, and what was written is void."""

_WORD = 8
_LEAD = _WORD - len(ENCAPSULATION)
"""Bytes before a message in its words."""

_STAMP = 1
"""Word of the stamp of messages that begin with it."""

_POINT, _ZERO = ord('.'), ord('0')
_FEWEST, _MOST = 1 + 1 + NANOSECOND_DIGITS, 9 + 1 + NANOSECOND_DIGITS
"""Characters of a stamp in a label: to the nanosecond, and not so many that it overflows."""

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]
Numbers = NDArray[np.float64]


def _forms(layout: Layout, *constant: str) -> Bytes:
    """
    Return (3, bytes): a layout's template, and 255 for what is constant and for what varies.

    Fields named `constant` are taken for that, too.
    """
    template = np.frombuffer(layout.template, np.uint8)
    mask = np.frombuffer(layout.mask, np.uint8).copy()
    varies = np.zeros_like(mask)
    for name, place in layout.places.items():
        (mask if name in constant else varies)[place] = 255
    return np.stack([template, mask, varies])


@formula
def _is_like(raw: Any, forms: Any) -> bool:
    """Return True if bytes are a message of these forms; padding bytes are ignored."""
    template, mask = forms[0], forms[1]
    if len(raw) != len(template):
        return False
    differs = np.uint8(0)
    for i in range(len(template)):
        differs |= (raw[i] ^ template[i]) & mask[i]
    return differs == 0


@formula
def _copy(raw: Any, forms: Any, message: Any) -> None:
    """Write what varies of a message into another; what it aligns with is not sent on."""
    template, varies = forms[0], forms[2]
    for i in range(len(template)):
        message[i] = template[i] | raw[i] & varies[i]


@formula
def _are_finite(numbers: Any) -> bool:
    rest = 0.0
    for number in numbers:
        rest += number - number
    return rest == 0.0


# Joint states.


def _state_places(state: JointStateCdr) -> Places:
    """Return in which word of a state its positions, velocities and efforts begin."""
    places = joint_state_layout(state.names).places
    return np.array([(_LEAD + places[name].start) // _WORD for name in FIELDS])


@kernel
def _read_state(raw: Any, forms: Any, places: Any, words: Any) -> Any:
    if not _is_like(raw, forms):
        return UNREAD
    _copy(raw, forms, words.view(np.uint8)[_LEAD:])
    joints = len(words) - places[2]
    if not _are_finite(words[places[0]:places[0] + joints]):
        return UNREAD
    if not _are_finite(words[places[1]:places[1] + joints]):
        return UNREAD
    time = words[_STAMP:_STAMP + 1].view(np.uint32)
    stamp = np.int64(time[0]) * NANOSECONDS + np.int64(time[1])
    return stamp if stamp < END_OF_TIME else UNREAD


class StateReader:
    """Reads joint states."""

    def __init__(self, state: JointStateCdr) -> None:
        """Read states of the same joints as this one's."""
        self._known = _forms(joint_state_layout(state.names)), _state_places(state)
        self._read = bound(_read_state, b'', *self._known, state.words)

    def read(self, raw: bytes, state: JointStateCdr) -> int:
        """
        Read a message into a state and return its stamp in ns.

        UNREAD for another layout, for positions and velocities that are not finite and for a
        stamp that is no time.
        """
        stamp: int = self._read(raw, *self._known, state.words)
        return stamp


@kernel
def _write_state(
    stamp: int, position: Any, velocity: Any, effort: Any, places: Any, words: Any
) -> None:
    for i in range(len(position)):
        words[places[0] + i] = position[i]
        words[places[1] + i] = velocity[i]
    for i in range(len(effort)):
        words[len(words) - len(effort) + i] = effort[i]
    seconds, nanoseconds = stamp // NANOSECONDS, stamp % NANOSECONDS
    words.view(np.int64)[_STAMP] = seconds | nanoseconds << 32


class StateWriter:
    """Writes joint states."""

    def __init__(
        self, state: JointStateCdr, position: Numbers, velocity: Numbers, effort: Numbers
    ) -> None:
        """Write what stands in these arrays, efforts of the last joints, into a state."""
        self._state = state
        self._arguments = position, velocity, effort, _state_places(state), state.words
        self._write = bound(_write_state, 0, *self._arguments)

    def to_bytes(self, stamp_ns: int) -> bytes:
        """Return the message as it is sent."""
        self._write(stamp_ns, *self._arguments)
        return self._state.to_bytes()


# Commands.


@kernel
def _read_command(raw: Any, forms: Any, places: Any, numbers: Any) -> Any:
    if not _is_like(raw, forms):
        return UNREAD
    stamp = np.int64(0)
    for i in range(places[0], places[1]):
        if i == places[1] - 1 - NANOSECOND_DIGITS:
            if raw[i] != _POINT:
                return UNREAD
        else:
            digit = np.int64(raw[i]) - _ZERO
            if digit < 0 or digit > 9:
                return UNREAD
            stamp = stamp * 10 + digit
    written = numbers.view(np.uint8)
    for i in range(len(written)):
        written[i] = raw[places[2] + i]
    return stamp if _are_finite(numbers) else UNREAD


@kernel
def _write_command(stamp: int, numbers: Any, places: Any, message: Any) -> None:
    rest = stamp
    for k in range(1, places[1] - places[0] + 1):
        if k == 1 + NANOSECOND_DIGITS:
            message[places[1] - k] = _POINT
        else:
            message[places[1] - k] = rest % 10 + _ZERO
            rest //= 10
    bare = numbers.view(np.uint8)
    for i in range(len(bare)):
        message[places[2] + i] = bare[i]


def _command_places(layout: Layout) -> Places:
    """Return the bytes of a command at which its stamp starts and ends, and its numbers start."""
    characters, data = layout.places['characters'], layout.places['data']
    return np.array([characters.start, characters.stop, data.start])


class CommandReader:
    """Reads commands of numbers, not void ones."""

    def __init__(self, command: LabelledCdr) -> None:
        """Read what is of the same kind as this command into its `data`."""
        self._kind, self._data = command.kind, command.data
        self._layout = self._kind.form(_FEWEST).layout
        self._known = self._known_of(self._layout)
        self._read = bound(_read_command, b'', *self._known, self._data)

    def read(self, raw: bytes) -> int:
        """
        Read a message and return the stamp in ns of the state that it answers.

        UNREAD for another layout, for a void command, for a label without a stamp to the
        nanosecond and for numbers that are not finite.
        """
        stamp: int = self._read(raw, *self._known, self._data)
        if stamp == UNREAD and self._is_of_another_size(raw):
            stamp = self._read(raw, *self._known, self._data)
        return stamp

    def _is_of_another_size(self, raw: bytes) -> bool:
        """Return True if the label has another size than the last one, and adopt that."""
        form = self._kind.form_of_label(raw[LABEL_SIZE])
        if form is None or form.layout is self._layout:
            return False
        characters = form.layout.places['characters']
        if not _FEWEST <= characters.stop - characters.start <= _MOST:
            return False
        self._layout, self._known = form.layout, self._known_of(form.layout)
        return True

    @staticmethod
    def _known_of(layout: Layout) -> tuple[Bytes, Places]:
        return _forms(layout, 'data_offset'), _command_places(layout)


class CommandWriter:
    """Writes commands of numbers, not void ones."""

    def __init__(self, kind: CommandKind, numbers: Numbers) -> None:
        """Write what stands in an array as commands of a kind."""
        self._kind, self._numbers = kind, numbers
        self._go_by(0)
        self._write = bound(_write_command, 0, numbers, self._places, self._message)

    def to_bytes(self, stamp_ns: int) -> bytes:
        """Return the message as it is sent, as the answer to the state of a stamp."""
        if not self._first <= stamp_ns < self._end:
            self._go_by(stamp_ns)
        self._write(stamp_ns, self._numbers, self._places, self._message)
        return self._message.tobytes()

    def _go_by(self, stamp_ns: int) -> None:
        """Make room for stamps with as many digits as this one."""
        digits = len(str(stamp_ns // NANOSECONDS))
        self._first = 0 if digits == 1 else 10 ** (digits - 1) * NANOSECONDS
        self._end = 10**digits * NANOSECONDS
        layout = self._kind.form(digits + 1 + NANOSECOND_DIGITS).layout
        self._places = _command_places(layout)
        self._message = np.frombuffer(layout.template, np.uint8).copy()


# Telemetry.


@kernel
def _write_telemetry(stamp: int, values: Any, numbers: Any) -> None:
    numbers[0], numbers[1] = stamp // NANOSECONDS, stamp % NANOSECONDS
    for i in range(len(values)):
        numbers[2 + i] = values[i]


class TelemetryWriter:
    """Writes telemetry."""

    def __init__(self, message: TelemetryCdr, values: Numbers) -> None:
        """Write what stands in an array into a message."""
        self._message = message
        self._arguments = values, message.numbers
        self._write = bound(_write_telemetry, 0, *self._arguments)

    def to_bytes(self, stamp_ns: int) -> bytes:
        """Return the message as it is sent, of a stamp in ns."""
        self._write(stamp_ns, *self._arguments)
        return self._message.to_bytes()
