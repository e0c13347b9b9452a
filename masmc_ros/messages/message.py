# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Single messages: of a fixed layout, read and written in place, and of std_msgs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import prod

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import ENCAPSULATION, Layout, NANOSECONDS, STAMP
import numpy as np


class Message:
    """
    One message of a fixed layout: a record whose fields are views into its bytes.

    The bytes are aligned for float64 numbers, which are read and written in place.

    Attributes
    ----------
    words
        The message as float64; the first number ends with the encapsulation header.

    """

    def __init__(self, layout: Layout) -> None:
        """
        Initialise a message of zeros.

        Parameters
        ----------
        layout
            Layout of the message, which must not change afterwards.

        """
        self._layout = layout
        self._lead = -len(ENCAPSULATION) % 8
        self.words = np.zeros((self._lead + layout.size + 7) // 8)
        self._wire = memoryview(self.words.data).cast('B')[self._lead:self._lead + layout.size]
        self._wire[:] = layout.template
        self._bytes = np.frombuffer(self._wire, np.uint8)
        self._record = np.ndarray((), layout.dtype, self.words, self._lead)

    def to_bytes(self) -> bytes:
        """Return the serialised message."""
        return self._wire.tobytes()

    def load(self, raw: bytes) -> bool:
        """
        Read a received message.

        Parameters
        ----------
        raw
            Message with its encapsulation header.

        Returns
        -------
            False for a message of another layout, which rclpy has to deserialise; nothing is
            changed then.

        """
        is_ours: bool = self._load(raw, self._layout.forms, self._bytes)
        return is_ours

    @cached_property
    def _load(self) -> Callable[..., bool]:
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import load

        return bound(load, b'', self._layout.forms, self._bytes)


class StampedMessage(Message):
    """A message that starts with a builtin_interfaces/Time or a std_msgs/Header."""

    _STAMP_OFFSET = len(ENCAPSULATION)

    def set_stamp(self, stamp_ns: int) -> None:
        """Write the stamp in ns since time 0."""
        STAMP.pack_into(self._wire, self._STAMP_OFFSET, *divmod(stamp_ns, NANOSECONDS))

    @property
    def stamp_ns(self) -> int:
        """Return the stamp in ns since time 0."""
        seconds, nanoseconds = STAMP.unpack_from(self._wire, self._STAMP_OFFSET)
        return int(seconds * NANOSECONDS + nanoseconds)


def string_message(text: str) -> bytes:
    """Return a serialised std_msgs/String, padded to 4 bytes as in received messages."""
    raw = Layout('std_msgs/msg/String', {'data': text}).template
    return raw + bytes(-len(raw) % 4)


def text_of(raw: bytes) -> str:
    """Return the text of a serialised std_msgs/String; InputError if it is invalid."""
    start = len(ENCAPSULATION) + 4
    size = int.from_bytes(raw[start - 4:start], 'little')
    if len(raw) < start + size:
        raise InputError(f'{len(raw)} bytes that are not a std_msgs/String')
    try:
        return raw[start:start + max(0, size - 1)].decode()
    except UnicodeDecodeError:
        raise InputError(f'a text of {size} bytes that is not UTF-8') from None


def multi_array_layout(
    dimensions: Sequence[tuple[str | tuple[str, int], int]], data_offset: int | None
) -> Layout:
    """
    Return the layout of a Float64MultiArray with labelled dimensions.

    Its fields are `data`, `layout_dim_N_label` of labels that vary, and `layout_data_offset` if it
    varies.

    Parameters
    ----------
    dimensions
        Label and size of each dimension, the slowest first; a label that varies at its end is a
        pair of text and number of variable characters.
    data_offset
        Number of entries before the array; None for a variable one, without such entries.

    """
    sizes = [size for _, size in dimensions]
    dim = [
        {'label': label, 'size': size, 'stride': prod(sizes[number:])}
        for number, (label, size) in enumerate(dimensions)
    ]
    contents = {
        'layout': {'dim': dim, 'data_offset': data_offset},
        'data': (data_offset or 0) + prod(sizes),
    }
    return Layout('std_msgs/msg/Float64MultiArray', contents)
