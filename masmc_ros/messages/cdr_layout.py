# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Layout of a CDR message with known strings and sizes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
import struct

from masmc_ros.errors import InputError
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

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

TIME = np.dtype([('sec', '<i4'), ('nanosec', '<u4')])
"""builtin_interfaces/Time as a field of many messages."""

Messages = NDArray[np.void]
"""Messages (N) as records of a layout's dtype."""

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

    The fields are appended in the order of the message definition. Variable fields have names;
    constant and padding bytes are in unnamed fields between them. One record is a message, and an
    array of records is many messages. Alignment counts from the end of the 4-byte encapsulation
    header. Padding bytes are zero here. ROS 2's serialiser leaves them uninitialised, so a
    comparison of messages must ignore them.
    """

    def __init__(self, position: int | None = None) -> None:
        """
        Initialise an empty layout, with the encapsulation header for a complete message.

        Parameters
        ----------
        position
            Position in bytes of a part of a message, which has no header; None for a complete
            message.

        """
        self._bytes = bytearray(ENCAPSULATION if position is None else b'')
        self._mask = bytearray(b'\xff' * len(self._bytes))
        self._start = 0 if position is None else position
        self._fields: list[tuple[str, DTypeLike] | tuple[str, DTypeLike, tuple[int, ...]]] = []
        self._described = 0

    def _append(self, data: bytes, mask: int) -> None:
        self._bytes += data
        self._mask += bytes([mask]) * len(data)

    def _align(self, size: int) -> None:
        position = self._start + len(self._bytes)
        self._append(bytes((len(ENCAPSULATION) - position) % size), 0)

    def _close_gap(self) -> None:
        gap = len(self._bytes) - self._described
        if gap:
            self._fields.append((f'_{len(self._fields)}', f'V{gap}'))
        self._described = len(self._bytes)

    def _vary(self, name: str, kind: DTypeLike, *shape: int) -> None:
        """Append a variable field, with zeros in the template."""
        self._close_gap()
        self._fields.append((name, kind, shape))
        self._append(bytes(np.dtype((kind, shape)).itemsize), 0)
        self._described = len(self._bytes)

    def uint32(self, value: int) -> None:
        """Append a constant unsigned number."""
        self._align(4)
        self._append(value.to_bytes(4, 'little'), 0xFF)

    def varying_uint32(self, name: str) -> None:
        """Append a variable unsigned number."""
        self._align(4)
        self._vary(name, '<u4')

    def string(self, text: str, varying: str = '', count: int = 0) -> None:
        """Append a string: `text`, then a field of `count` variable characters."""
        data = text.encode()
        self.uint32(len(data) + count + 1)
        self._append(data, 0xFF)
        if count:
            self._vary(varying, np.uint8, count)
        self._append(b'\0', 0xFF)

    def stamp(self, name: str = 'stamp') -> None:
        """Append a variable builtin_interfaces/Time."""
        self._align(4)
        self._vary(name, TIME)

    def doubles(self, name: str, *shape: int) -> None:
        """Append variable float64 numbers of a shape."""
        self._align(8)
        self._vary(name, '<f8', *shape)

    def sequence(self, name: str, count: int) -> None:
        """Append a variable float64[] of constant length."""
        self.uint32(count)
        self.doubles(name, count)

    @property
    def size(self) -> int:
        """Size of the message in bytes, encapsulation header included."""
        return len(self._bytes)

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Return the dtype of the message as a record; nothing can be appended afterwards."""
        self._close_gap()
        return np.dtype(self._fields)

    @cached_property
    def places(self) -> dict[str, slice]:
        """Return the byte range of each variable field in the message, in order."""
        return {
            name: slice(offset, offset + kind.itemsize)
            for name, (kind, offset, *_) in (self.dtype.fields or {}).items()
            if not name.startswith('_')
        }

    @cached_property
    def template(self) -> bytes:
        """Return the message with zeros in the variable fields."""
        return bytes(self._bytes)

    @cached_property
    def forms(self) -> NDArray[np.uint8]:
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

    def read(self, raws: Sequence[bytes]) -> tuple[NDArray[np.bool_], Messages]:
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


def stamps_of(times: Messages) -> NDArray[np.int64]:
    """Return stamps (N) in ns of a field of times (N)."""
    return np.asarray(times['sec'].astype(np.int64) * NANOSECONDS + times['nanosec'])
