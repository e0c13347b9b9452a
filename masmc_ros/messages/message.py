# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Single messages of a fixed layout, read and written in place."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

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
