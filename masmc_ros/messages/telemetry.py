# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Telemetry of the controller: one vector per tick as std_msgs/Float64MultiArray."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
import struct

from masmc_ros.aliases import Array, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages import deserialised
from masmc_ros.messages.cdr_layout import END_OF_TIME, Layout, Messages, NANOSECONDS
from masmc_ros.messages.message import Message, multi_array_layout
import numpy as np
from numpy.typing import ArrayLike

STAMP_NUMBERS = 2
"""Number of entries before the values: seconds and nanoseconds."""

_STAMP_PAIR = struct.Struct('<2d')


@cache
def telemetry_layout(label: str, count: int) -> Layout:
    """Return the layout of `count` values with a label, after the stamp."""
    return multi_array_layout([(label, count)], STAMP_NUMBERS)


def telemetry_count(label: str, size: int) -> int:
    """Return the number of values in a telemetry message of `size` bytes with a label."""
    empty, one = (telemetry_layout(label, count).size for count in (0, 1))
    return (size - empty) // (one - empty)


def telemetry_messages(label: str, stamps: Stamps, values: ArrayLike) -> Messages:
    """
    Return many telemetry messages.

    Parameters
    ----------
    label
        Label of the values.
    stamps
        Stamps (N) in ns.
    values
        Values (N, n).

    """
    values = np.asarray(values)
    data = np.column_stack((*np.divmod(stamps, NANOSECONDS), values))
    return telemetry_layout(label, values.shape[1]).messages(data=data)


class TelemetryCdr(Message):
    """
    A stamped vector whose numbers are a view into the message.

    Attributes
    ----------
    values
        Vector (count).
    numbers
        Seconds and nanoseconds of the stamp, then the vector (2 + count).
    size
        Size of the message in bytes.
    head
        Constant bytes before the stamp.

    """

    def __init__(self, label: str, count: int) -> None:
        """Initialise a vector of `count` zeros at time 0 with a label."""
        layout = telemetry_layout(label, count)
        super().__init__(layout)
        self._label = label
        self._stamp_offset = layout.places['data'].start
        self.numbers = self._record['data']
        self.values = self.numbers[STAMP_NUMBERS:]
        self.size = layout.size
        self.head = layout.template[:self._stamp_offset]

    def set_stamp(self, stamp_ns: int) -> None:
        """Write the stamp in ns of the state of the values."""
        _STAMP_PAIR.pack_into(self._wire, self._stamp_offset, *divmod(stamp_ns, NANOSECONDS))

    def writer(self, values: Array) -> Callable[[int], bytes]:
        """Return a function of a stamp in ns that returns the message of an array's numbers."""
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import write_telemetry

        write = bound(write_telemetry, 0, values, self.numbers)

        def to_bytes(stamp_ns: int) -> bytes:
            write(stamp_ns, values, self.numbers)
            return self.to_bytes()

        return to_bytes

    @property
    def stamp_ns(self) -> int:
        """Return the stamp in ns; InputError if it is invalid."""
        return self.stamp_of(self._wire)

    def stamp_of(self, raw: bytes | memoryview) -> int:
        """Return the stamp in ns of a message of this layout; InputError if it is invalid."""
        return _stamp(*_STAMP_PAIR.unpack_from(raw, self._stamp_offset))

    def load_message(self, message: deserialised.Float64MultiArray) -> None:
        """
        Read a deserialised telemetry message with any labels.

        Parameters
        ----------
        message
            std_msgs/Float64MultiArray of any deserialiser.

        Raises
        ------
        InputError
            For another number of values, and for a missing or invalid stamp before them; nothing
            is changed then.

        """
        count = len(self.values)
        offset = message.layout.data_offset
        if offset != STAMP_NUMBERS or len(message.data) != STAMP_NUMBERS + count:
            raise InputError(
                f'{self._label}: {len(message.data)} numbers, data_offset {offset};'
                f' expected seconds, nanoseconds and {count} values, data_offset {STAMP_NUMBERS}'
            )
        numbers = list(map(float, message.data))
        _stamp(*numbers[:STAMP_NUMBERS])
        self.numbers[:] = numbers


def _stamp(seconds: float, nanoseconds: float) -> int:
    # The comparisons are False for NaN.
    if not (0.0 <= seconds < END_OF_TIME / NANOSECONDS and 0.0 <= nanoseconds < NANOSECONDS):
        raise InputError(
            f'stamp [{seconds:g} s, {nanoseconds:g} ns]: expected 0 <= seconds < 2**31 and '
            '0 <= nanoseconds < 1e9'
        )
    return int(seconds) * NANOSECONDS + int(nanoseconds)
