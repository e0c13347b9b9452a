# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Where everything stands in a CDR message whose strings and sizes are known."""

from __future__ import annotations

from functools import cached_property
import struct

from masmc_ros.errors import InputError
import numpy as np
from numpy.typing import NDArray

ENCAPSULATION = b'\x00\x01\x00\x00'
"""Plain CDR, little endian: what every ROS 2 middleware sends on such a machine."""

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""

STAMP = struct.Struct('<iI')
"""builtin_interfaces/Time in CDR: seconds and nanoseconds."""

END_OF_TIME = 2**31 * NANOSECONDS
"""In ns: the first time that ROS 2's seconds of 32 bits, sign included, cannot say."""


def checked_stamp(stamp_ns: int) -> int:
    """Return a stamp in ns; InputError for one that is no time since time 0."""
    if not 0 <= stamp_ns < END_OF_TIME:
        fault = 'is negative' if stamp_ns < 0 else 'is beyond 2**31 s'
        raise InputError(f'stamp {stamp_ns} ns {fault}')
    return stamp_ns


class Layout:
    """
    The bytes of one CDR message: which are constant, which vary, which only align.

    The fields are appended in the order of the message definition. Alignment counts from the
    end of the 4-byte encapsulation header. The bytes that only align hold zero here; ROS 2's
    own serialiser leaves in them what the memory held before, so that a comparison of
    messages must leave them out.
    """

    def __init__(self) -> None:
        """Start with the encapsulation header."""
        self._bytes = bytearray(ENCAPSULATION)
        self._mask = bytearray(b'\xff' * len(ENCAPSULATION))
        self._varying: list[slice] = []

    def _append(self, data: bytes, mask: int) -> int:
        offset = len(self._bytes)
        self._bytes += data
        self._mask += bytes([mask]) * len(data)
        return offset

    def _append_varying(self, size: int) -> int:
        offset = self._append(bytes(size), 0)
        self._varying.append(slice(offset, offset + size))
        return offset

    def _align(self, size: int) -> None:
        self._append(bytes((len(ENCAPSULATION) - len(self._bytes)) % size), 0)

    def uint32(self, value: int) -> int:
        """Append a constant unsigned number and return its offset in the message."""
        self._align(4)
        return self._append(value.to_bytes(4, 'little'), 0xFF)

    def string(self, text: str) -> int:
        """Append a constant string and return the offset of its first character."""
        data = text.encode() + b'\0'
        self.uint32(len(data))
        return self._append(data, 0xFF)

    def stamp(self) -> int:
        """Append a builtin_interfaces/Time that varies and return its offset."""
        self._align(4)
        return self._append_varying(STAMP.size)

    def doubles(self, count: int) -> int:
        """Append `count` float64 that vary and return the offset of the first."""
        self._align(8)
        return self._append_varying(8 * count)

    def sequence(self, count: int) -> int:
        """Append a float64[] of constant length and return the offset of its first number."""
        self.uint32(count)
        return self.doubles(count)

    @property
    def size(self) -> int:
        """Size of the message in bytes, encapsulation header included."""
        return len(self._bytes)

    def let_vary(self, part: slice) -> None:
        """Take bytes that were appended as constant out of the constant ones."""
        self._mask[part] = bytes(part.stop - part.start)
        self._varying = sorted([*self._varying, part], key=lambda each: int(each.start))

    @property
    def varying(self) -> list[slice]:
        """Return the parts that differ from message to message, in order."""
        return self._varying

    @cached_property
    def template(self) -> bytes:
        """Return the whole message, zero where it varies."""
        return bytes(self._bytes)

    @cached_property
    def mask(self) -> bytes:
        """255 for each byte that is constant, 0 for one that varies or only aligns."""
        return bytes(self._mask)

    @cached_property
    def _mask_number(self) -> int:
        return int.from_bytes(self.mask, 'little')

    @cached_property
    def _template_number(self) -> int:
        return int.from_bytes(self.template, 'little') & self._mask_number

    @cached_property
    def _rest(self) -> struct.Struct:
        """Take out what does not vary, aligning bytes included."""
        form = '<'
        position = 0
        for part in self._varying:
            form += f'{part.start - position}s{part.stop - part.start}x'
            position = part.stop
        return struct.Struct(f'{form}{self.size - position}s')

    @cached_property
    def _template_rest(self) -> tuple[bytes, ...]:
        return self._rest.unpack(self.template)

    def equals(self, raw: bytes) -> bool:
        """Tell whether `raw` is such a message with zeros for all aligning bytes."""
        return len(raw) == self.size and self._rest.unpack(raw) == self._template_rest

    def matches(self, raw: bytes) -> bool:
        """Tell whether `raw` is such a message, whatever its aligning bytes hold."""
        return self.equals(raw) or (
            len(raw) == self.size
            and int.from_bytes(raw, 'little') & self._mask_number == self._template_number
        )

    def rows_match(self, rows: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Tell the same of each row of `rows` (N, size); returns (N)."""
        constant = np.frombuffer(self.mask, np.uint8).astype(bool)
        expected = np.frombuffer(self.template, np.uint8)[constant]
        return np.asarray((rows[:, constant] == expected).all(axis=1))


class Message:
    """
    One message of a fixed layout, kept in memory where its numbers are float64 views.

    The bytes lie so that the doubles fall on multiples of 8: reading and writing them
    copies nothing and serialises nothing.
    """

    def __init__(self, layout: Layout) -> None:
        """
        Make a message that holds zeros.

        Parameters
        ----------
        layout
            what the message looks like; not changed any more from here on.

        """
        self._layout = layout
        self._lead = -len(ENCAPSULATION) % 8
        self._memory = np.zeros((self._lead + layout.size + 7) // 8)
        self._wire = memoryview(self._memory.data).cast('B')[self._lead:self._lead + layout.size]
        self._wire[:] = layout.template

    def _view(self, offset: int, count: int) -> NDArray[np.float64]:
        first = (self._lead + offset) // 8
        return self._memory[first:first + count]

    def to_bytes(self) -> bytes:
        """Return the message as it is sent."""
        return self._wire.tobytes()

    def load(self, raw: bytes) -> bool:
        """
        Take over a received message.

        Parameters
        ----------
        raw
            the message with its encapsulation header.

        Returns
        -------
            False, with nothing changed, where strings or sizes differ: a message of another
            layout, which a full deserialiser has to read.

        """
        if self._layout.equals(raw):
            self._wire[:] = raw
            return True
        if not self._layout.matches(raw):
            return False
        # Part by part, so that what a foreign sender aligns with is never sent on.
        for part in self._layout.varying:
            self._wire[part] = raw[part]
        return True


class StampedMessage(Message):
    """A message that starts with a builtin_interfaces/Time or a std_msgs/Header."""

    _STAMP_OFFSET = len(ENCAPSULATION)

    def set_stamp(self, stamp_ns: int) -> None:
        """Write the stamp, given in ns since time 0."""
        STAMP.pack_into(self._wire, self._STAMP_OFFSET, *divmod(stamp_ns, NANOSECONDS))

    @property
    def stamp_ns(self) -> int:
        """Return the stamp in ns since time 0."""
        seconds, nanoseconds = STAMP.unpack_from(self._wire, self._STAMP_OFFSET)
        return int(seconds * NANOSECONDS + nanoseconds)
