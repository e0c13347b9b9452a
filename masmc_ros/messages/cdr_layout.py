# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Message definitions of ROS 2 Jazzy, and layouts of CDR messages with their strings and sizes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
import json
from pathlib import Path
import struct
from typing import Any, NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Bytes, Flags, Records, Stamps
from masmc_ros.errors import InputError, suggestion
import numpy as np
from numpy.typing import ArrayLike, DTypeLike

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class Definition(NamedTuple):
    """
    Definition of a message type.

    Attributes
    ----------
    text
        Definition in the form `ros2msg`, with those of the types that it uses.
    type_hash
        Version hash of REP-2011, `RIHS01_...`.

    """

    text: str
    type_hash: str


KEPT = Path(__file__).with_name('definitions.json')
"""Text and hash of the types of every run; loading all types of Jazzy takes 0.15 s."""


@cache
def _kept() -> dict[str, list[str]]:
    definitions: dict[str, list[str]] = json.loads(KEPT.read_text('utf-8'))
    return definitions


@cache
def _store() -> Typestore:
    from rosbags.typesys import get_typestore, Stores

    return get_typestore(Stores.ROS2_JAZZY)


@cache
def definition(type_name: str) -> Definition:
    """
    Return the definition of a message type.

    Parameters
    ----------
    type_name
        Name such as `sensor_msgs/msg/JointState`.

    Raises
    ------
    InputError
        If Jazzy does not have the type.

    """
    kept = _kept().get(type_name)
    return Definition(*kept) if kept else definition_of_jazzy(type_name)


@cache
def members(type_name: str) -> dict[str, list[list[str]]]:
    """Return type and name of the members of a message type and of those that it uses, by type."""
    text = f'MSG: {type_name}\n{definition(type_name).text}'
    return {
        head.removeprefix('MSG: '): [line.split() for line in lines]
        for head, *lines in map(str.splitlines, text.split('=' * 80 + '\n'))
    }


def definition_of_jazzy(type_name: str) -> Definition:
    """Return the definition of a message type from the library, which has all types of Jazzy."""
    store = _store()
    if type_name not in store.fielddefs:
        raise InputError(
            f"message type '{type_name}' is not one of ROS 2 Jazzy's own:"
            f' {suggestion(type_name, store.fielddefs)}'
        )
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(text, store.hash_rihs01(type_name))


ENCAPSULATION = b'\x00\x01\x00\x00'
"""Header of plain CDR, little endian, which ROS 2 middleware uses on little-endian machines."""

HEADER_SIZE = len(ENCAPSULATION)

UNREAD = -1
"""Result of a compiled reader instead of a stamp if rclpy has to deserialise the message."""

NANOSECOND_DIGITS = 9
"""Digits of the nanoseconds of a stamp in a label."""

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""

STAMP = struct.Struct('<iI')
"""builtin_interfaces/Time in CDR: seconds and nanoseconds."""

TIME = np.dtype([('sec', '<i4'), ('nanosec', '<u4')], align=True)
"""builtin_interfaces/Time as a field of many messages."""

Messages = Records
"""Messages (N) as records of a layout's dtype."""

_Path = tuple[str, ...]
"""Names of a member and of those that contain it, the outermost first."""

END_OF_TIME = 2**31 * NANOSECONDS
"""First time in ns after the range of ROS 2's seconds, signed integers of 32 bits."""


def checked_stamp(stamp_ns: int) -> int:
    """Return a stamp in ns; InputError if it is negative or beyond 2**31 s."""
    if not 0 <= stamp_ns < END_OF_TIME:
        fault = 'is negative' if stamp_ns < 0 else 'is beyond 2**31 s'
        raise InputError(f'stamp {stamp_ns} ns {fault}')
    return stamp_ns


class Layout:
    """
    Bytes of a CDR message with known strings and sizes, as a NumPy dtype.

    The fields are those of the message definition, in its order. The name of a variable field is
    its path: `header_stamp`, `transforms_0_transform`. A part that consists of float64 numbers,
    such as a geometry_msgs/Twist, is one field; so is a builtin_interfaces/Time. A message that
    consists of float64 numbers has the field `numbers`. Constant and padding bytes are in unnamed
    fields between them. One record is a message, and an array of records is many messages.
    Alignment counts from the end of the 4-byte encapsulation header. Padding bytes are zero here.
    ROS 2's serialiser leaves them uninitialised, so a comparison of messages must ignore them.

    Attributes
    ----------
    places
        Byte range of each variable field in the message, in order.
    dtype
        The message as a record.
    template
        The message with zeros in the variable fields.
    size
        Size of the message in bytes, encapsulation header included.

    """

    def __init__(self, type_name: str, contents: Any = None, position: int | None = None) -> None:
        """
        Initialise the layout of a message.

        Parameters
        ----------
        type_name
            Type of the message, such as `sensor_msgs/msg/JointState`.
        contents
            Constants of the message, nested as its members: texts of strings, elements of
            sequences, lengths of sequences of float64, values of uint32. A string whose last
            characters vary is a pair of the text before them and their number. A missing string
            or sequence is empty, and a missing number varies.
        position
            Position in bytes of a part of a message, which has no header; None for a complete
            message.

        """
        self._bytes = bytearray(ENCAPSULATION if position is None else b'')
        self._mask = bytearray(b'\xff' * len(self._bytes))
        self._start = position or 0
        self._members = members(type_name)
        self._fields: list[tuple[str, DTypeLike]] = []
        self._described = 0
        self.places: dict[str, slice] = {}
        self._append_member(type_name, contents, ())
        self._close_gap()
        self.dtype: np.dtype[np.void] = np.dtype(self._fields)
        self.template, self.size = bytes(self._bytes), len(self._bytes)

    def _append_member(self, kind: str, content: Any, path: _Path) -> None:
        """Append a member of the message, whose `path` are the names down to it."""
        element, bracket, length = kind.rstrip(']').partition('[')
        if length:
            self._vary(path, '<f8', int(length))
        elif bracket and isinstance(content, int):
            self._append_uint32(content)
            self._vary(path, '<f8', content)
        elif bracket:
            self._append_uint32(len(content or ()))
            for number, item in enumerate(content or ()):
                self._append_member(element, item, (*path, str(number)))
        elif kind == 'string':
            text, count = content if isinstance(content, tuple) else (content or '', 0)
            data = text.encode()
            self._append_uint32(len(data) + count + 1)
            self._append(data, 0xFF)
            if count:
                self._vary(path, np.uint8, count)
            self._append(b'\0', 0xFF)
        elif kind == 'builtin_interfaces/Time':
            self._vary(path, TIME)
        elif doubles := self._count_doubles(kind):
            self._vary(path, '<f8', doubles)
        elif kind in self._members:
            for member, name in self._members[kind]:
                self._append_member(member, (content or {}).get(name), (*path, name))
        elif content is None:
            self._vary(path, '<u4')
        else:
            self._append_uint32(content)

    def _count_doubles(self, kind: str) -> int:
        """Return the number of float64 of a type that consists of them; 0 for other types."""
        if kind == 'float64':
            return 1
        counts = [self._count_doubles(member) for member, _ in self._members.get(kind, ())]
        return sum(counts) if all(counts) else 0

    def _append_uint32(self, value: int) -> None:
        self._align(4)
        self._append(value.to_bytes(4, 'little'), 0xFF)

    def _append(self, data: bytes, mask: int) -> None:
        self._bytes += data
        self._mask += bytes([mask]) * len(data)

    def _align(self, size: int) -> None:
        position = self._start + len(self._bytes)
        self._append(bytes((len(ENCAPSULATION) - position) % size), 0)

    def _vary(self, path: _Path, kind: DTypeLike, *shape: int) -> None:
        """Append a variable field, with zeros in the template."""
        dtype = np.dtype((kind, shape))
        self._align(dtype.alignment)
        self._close_gap()
        name, start = '_'.join(path) or 'numbers', len(self._bytes)
        self._fields.append((name, dtype))
        self._append(bytes(dtype.itemsize), 0)
        self._described = len(self._bytes)
        self.places[name] = slice(start, self._described)

    def _close_gap(self) -> None:
        """Append an unnamed field of the bytes after the last field."""
        gap = len(self._bytes) - self._described
        if gap:
            self._fields.append((f'_{len(self._fields)}', f'V{gap}'))

    @cached_property
    def forms(self) -> Bytes:
        """
        Return (3, size): the template, the mask of constant bytes and that of variable bytes.

        Masks are 0xFF for these bytes and 0 for the others; padding bytes are in neither.
        """
        varies = np.zeros(self.size, np.uint8)
        for place in self.places.values():
            varies[place] = 255
        constant = np.frombuffer(bytes(self._mask), np.uint8)
        return np.stack([np.frombuffer(self.template, np.uint8), constant, varies])

    def messages(self, **fields: ArrayLike) -> Messages:
        """
        Return many messages.

        Parameters
        ----------
        **fields
            Values (N, ...) of variable fields by name, stamps in ns; the other fields are zero.

        Returns
        -------
            Records (N), whose bytes are the serialised messages.

        """
        arrays = {name: np.asarray(values) for name, values in fields.items()}
        count = len(next(iter(arrays.values())))
        messages = np.repeat(np.frombuffer(self.template, self.dtype), count)
        for name, values in arrays.items():
            field = messages[name]
            if field.dtype == TIME:
                field['sec'], field['nanosec'] = np.divmod(values, NANOSECONDS)
            else:
                field[:] = values
        return messages

    def read(self, raws: Sequence[bytes]) -> tuple[Flags, Messages]:
        """
        Read many messages of the right size.

        Parameters
        ----------
        raws
            N messages of the layout's size.

        Returns
        -------
            Mask (N) of the messages of this layout, with any padding bytes; records (N), which are
            meaningless for the other messages.

        """
        joined = b''.join(raws)
        rows = np.frombuffer(joined, np.uint8).reshape(len(raws), self.size)
        constant = self.forms[1].astype(bool)
        matches = (rows[:, constant] == self.forms[0][constant]).all(axis=1)
        return matches, np.frombuffer(joined, self.dtype)


def stamps_of(times: Messages) -> Stamps:
    """Return stamps (N) in ns of a field of times (N)."""
    return np.asarray(times['sec'].astype(np.int64) * NANOSECONDS + times['nanosec'])
