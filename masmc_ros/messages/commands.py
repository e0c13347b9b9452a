# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Commands for joints, torques or velocities, with the stamp of the state to which they respond.

A void command responds to a state without a torque or velocity. Its layout is that of other
commands, with zeros and a `data_offset` that marks all of them as padding. A receiver that ignores
`data_offset` reads zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
import re
from typing import NamedTuple

from masmc_ros.aliases import Array, Bytes, Indices, Integers, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages import cdr_layout, deserialised
from masmc_ros.messages.message import multi_array_layout
from masmc_ros.messages.topics import DRIVEN_JOINTS, RATED_JOINTS
import numpy as np
from numpy.typing import ArrayLike

_DIMENSIONS = slice(cdr_layout.HEADER_SIZE, cdr_layout.HEADER_SIZE + 4)
"""Bytes of the number of dimensions; the size of the first label and the label follow."""

_LABEL = cdr_layout.HEADER_SIZE + 8
"""First byte of the label."""

_SECOND_DIGITS = 10

_STAMP_LENGTHS = range(len('0.0'), _SECOND_DIGITS + len('.') + cdr_layout.NANOSECOND_DIGITS + 1)

_SHORTEST = len('0.') + cdr_layout.NANOSECOND_DIGITS
"""Smallest number of characters of a stamp that compiled code reads: to the nanosecond."""


class CommandMessages(NamedTuple):
    """
    Commands with labels of equal length.

    Attributes
    ----------
    indices
        Indices (n) of these commands among all commands.
    messages
        Serialised messages (n).

    """

    indices: Indices
    messages: cdr_layout.Messages


class CommandKind:
    """
    Kind of the commands of one topic, with their layouts.

    Attributes
    ----------
    name
        Name of a command in error messages.
    joints
        Names of the joints, in the order of the numbers.
    quantity
        Quantity of each number, such as `torque`.
    prefix
        Start of the label, before the stamp.

    """

    def __init__(self, name: str, quantity: str, prefix: str, joints: Sequence[str]) -> None:
        """Initialise the kind with its attributes, without layouts."""
        self.name, self.quantity, self.prefix = name, quantity, prefix
        self.joints = tuple(joints)
        self._label = re.compile(re.escape(prefix) + r'(\d+)\.(\d{1,9})', re.ASCII)
        self._layouts: dict[int, cdr_layout.Layout] = {}

    def named(self, joints: Sequence[str]) -> CommandKind:
        """Return the same kind with other joint names."""
        if tuple(joints) == self.joints:
            return self
        return CommandKind(self.name, self.quantity, self.prefix, joints)

    def layout(self, characters: int) -> cdr_layout.Layout:
        """Return the layout of a command with this number of characters after the prefix."""
        layout = self._layouts.get(characters)
        if layout is None:
            dimension = (self.prefix, characters), len(self.joints)
            layout = multi_array_layout([dimension], None)
            self._layouts[characters] = layout
        return layout

    def messages(
        self, stamps: Stamps, numbers: ArrayLike, is_void: ArrayLike = False
    ) -> list[CommandMessages]:
        """
        Return many commands, grouped by the number of digits of the seconds.

        Parameters
        ----------
        stamps
            Stamps (N) of the states in ns, not negative.
        numbers
            Numbers (N, n), one for each joint.
        is_void
            True for void commands, (N) or one for all.

        """
        numbers = np.asarray(numbers)
        voids = np.broadcast_to(np.asarray(is_void, bool), len(numbers))
        seconds, nanoseconds = np.divmod(stamps, cdr_layout.NANOSECONDS)
        lengths = np.char.str_len(seconds.astype(str))
        groups = []
        for length in np.unique(lengths).tolist():
            indices = np.flatnonzero(lengths == length)
            label = (
                _digits(seconds[indices], length),
                np.full((len(indices), 1), ord('.'), np.uint8),
                _digits(nanoseconds[indices], cdr_layout.NANOSECOND_DIGITS),
            )
            messages = self.layout(length + 1 + cdr_layout.NANOSECOND_DIGITS).messages(
                layout_dim_0_label=np.hstack(label),
                layout_data_offset=voids[indices] * len(self.joints),
                data=numbers[indices],
            )
            groups.append(CommandMessages(indices, messages))
        return groups

    def layout_of(self, raw: bytes) -> cdr_layout.Layout | None:
        """Return the layout of a message by the size of its label; None if no stamp fits it."""
        characters = _label_size(raw) - len(self.prefix) - 1
        return self.layout(characters) if characters in _STAMP_LENGTHS else None

    def stamp_of(self, raw: bytes) -> int | None:
        """
        Return the stamp in ns on the label of a serialised message of any number of joints.

        Returns
        -------
            None without a label of this kind.

        Raises
        ------
        InputError
            As `label_stamp`.

        """
        label = raw[_LABEL:_LABEL + _label_size(raw) - 1] if any(raw[_DIMENSIONS]) else b''
        return self._stamp(label.decode('ascii', 'replace'))

    def label_stamp(self, message: deserialised.Float64MultiArray) -> int | None:
        """
        Return the stamp in ns on the label of a deserialised message, None without a label.

        Raises
        ------
        InputError
            If the label has the prefix of this kind and no valid stamp.

        """
        dimensions = message.layout.dim
        return self._stamp(dimensions[0].label if dimensions else '')

    def _stamp(self, label: str) -> int | None:
        if not label.startswith(self.prefix):
            return None
        match = self._label.fullmatch(label)
        if match is None:
            expected = f'{self.prefix}SECONDS.NANOSECONDS'
            raise InputError(f"{self.name}: label '{label}' is not {expected}")
        if len(match[1]) > _SECOND_DIGITS:
            raise InputError(f"{self.name}: label '{label[:40]}' is beyond 2**31 s")
        return cdr_layout.checked_stamp(int(match[1]) * cdr_layout.NANOSECONDS + int(match[2]))


def _digits(numbers: Integers, count: int) -> Bytes:
    """Return the decimal digits (N, count) of numbers (N)."""
    powers = 10 ** np.arange(count - 1, -1, -1)
    return (numbers[:, None] // powers % 10 + ord('0')).astype(np.uint8)


def _places(layout: cdr_layout.Layout) -> Integers:
    """Return the bytes at which the stamp starts and ends, the numbers and `data_offset` start."""
    characters, data = layout.places['layout_dim_0_label'], layout.places['data']
    offset = layout.places['layout_data_offset']
    return np.array([characters.start, characters.stop, data.start, offset.start])


def _label_size(raw: bytes) -> int:
    """Return the size of the first label of a serialised message, terminator included."""
    return int.from_bytes(raw[_LABEL - 4:_LABEL], 'little')


class CommandWriter:
    """Writer of the commands whose numbers are in one array."""

    def __init__(
        self, kind: CommandKind, numbers: Array, *, is_void: bool = False
    ) -> None:
        """
        Initialise the writer.

        Parameters
        ----------
        kind
            Kind of the commands.
        numbers
            Array (joints) that the caller updates.
        is_void
            True for void commands.

        """
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import write_command

        self._kind, self._numbers, self._is_void = kind, numbers, is_void
        self._prepare(0)
        self._write = bound(write_command, 0, numbers, self._places, self._message)

    def to_bytes(self, stamp_ns: int) -> bytes:
        """Return the message of the response to the state of a stamp in ns."""
        if not self._first <= stamp_ns < self._end:
            self._prepare(stamp_ns)
        self._write(stamp_ns, self._numbers, self._places, self._message)
        return self._message.tobytes()

    def _prepare(self, stamp_ns: int) -> None:
        """Use the layout for stamps with as many digits as this one."""
        digits = len(str(stamp_ns // cdr_layout.NANOSECONDS))
        self._first = 0 if digits == 1 else 10 ** (digits - 1) * cdr_layout.NANOSECONDS
        self._end = 10**digits * cdr_layout.NANOSECONDS
        layout = self._kind.layout(digits + 1 + cdr_layout.NANOSECOND_DIGITS)
        self._places = _places(layout)
        offset = self._is_void * len(self._numbers)
        (message,) = layout.messages(layout_data_offset=[offset]).view(np.uint8).reshape(1, -1)
        self._message = message


class LabelledCdr:
    """
    A command as std_msgs/Float64MultiArray.

    Attributes
    ----------
    kind
        Kind of the command.
    data
        A number for each joint of the kind.
    stamp_ns
        Stamp in ns of the state to which the command responds; None for a received command
        without a label.
    is_void
        True for a void command.

    """

    def __init__(self, kind: CommandKind) -> None:
        """Initialise a command of zeros as the response to the state of time 0."""
        self.kind = kind
        self.data = np.zeros(len(kind.joints))
        self.stamp_ns: int | None = 0
        self.is_void = False
        self._layout = kind.layout(_SHORTEST)
        self._places = _places(self._layout)

    def set_stamp(self, stamp_ns: int) -> None:
        """Label the command with the stamp in ns of the state to which it responds."""
        self.stamp_ns = stamp_ns

    def to_bytes(self) -> bytes:
        """Return the serialised message; `CommandWriter` is faster."""
        stamps = np.array([self.stamp_ns or 0])
        ((_, messages),) = self.kind.messages(stamps, self.data[None], self.is_void)
        return messages.tobytes()

    def load(self, raw: bytes) -> bool:
        """
        Read a received command of finite numbers in the package's own layout.

        Parameters
        ----------
        raw
            Message with its encapsulation header.

        Returns
        -------
            False for every other message, which rclpy has to deserialise for `load_message`;
            nothing is changed then.

        """
        stamp, is_void = self._read(raw, self._layout.forms, self._places, self.data)
        if stamp == cdr_layout.UNREAD and self._adopts(raw):
            stamp, is_void = self._read(raw, self._layout.forms, self._places, self.data)
        if stamp == cdr_layout.UNREAD:
            return False
        self.stamp_ns, self.is_void = stamp, is_void
        return True

    def _adopts(self, raw: bytes) -> bool:
        """Adopt the layout of a label with another number of digits; False if there is none."""
        layout = self.kind.layout_of(raw)
        if layout is None or layout is self._layout:
            return False
        characters = layout.places['layout_dim_0_label']
        if characters.stop - characters.start < _SHORTEST:
            return False
        self._layout, self._places = layout, _places(layout)
        return True

    @cached_property
    def _read(self) -> Callable[..., tuple[int, bool]]:
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import read_command

        return bound(read_command, b'', self._layout.forms, self._places, self.data)

    def load_message(self, message: deserialised.Float64MultiArray) -> None:
        """
        Read a deserialised command of any sender, such as ros2_control, with or without a label.

        Parameters
        ----------
        message
            std_msgs/Float64MultiArray of any deserialiser.

        Raises
        ------
        InputError
            For another number of joints, a number that is not finite, or a label with the
            prefix of this kind and no valid stamp; nothing is changed then.

        """
        kind = self.kind
        stamp_ns = kind.label_stamp(message)
        numbers = np.asarray(message.data, dtype=np.float64)
        if numbers.shape != self.data.shape:
            raise InputError(
                f'{kind.name}: {len(numbers)} numbers; expected {len(self.data)},'
                f' the {kind.quantity}s of {", ".join(kind.joints)}'
            )
        if not np.isfinite(numbers).all():
            joint = kind.joints[int(np.argmin(np.isfinite(numbers)))]
            raise InputError(
                f"{kind.name}: the {kind.quantity} of '{joint}' is not a finite number"
            )
        self.data[:] = numbers
        self.is_void = int(message.layout.data_offset) == len(numbers)
        self.stamp_ns = stamp_ns


EFFORT = CommandKind('effort command', 'torque', 'effort@', DRIVEN_JOINTS)
"""Torques in N·m, labelled `effort@SECONDS.NANOSECONDS`."""

ARM_VELOCITY = CommandKind('arm velocity command', 'rate', 'velocity@', RATED_JOINTS)
"""Velocities in rad/s, labelled `velocity@SECONDS.NANOSECONDS`; the base has a twist."""


class EffortCdr(LabelledCdr):
    """Torques of the driven joints in N·m, in `data`."""

    def __init__(self, joints: Sequence[str] = DRIVEN_JOINTS) -> None:
        """Initialise zero torques of joints of these names."""
        super().__init__(EFFORT.named(joints))


class ArmVelocityCdr(LabelledCdr):
    """Velocities in rad/s of the joints that do not move the base, in `data`."""

    def __init__(self, joints: Sequence[str] = RATED_JOINTS) -> None:
        """Initialise zero velocities of joints of these names."""
        super().__init__(ARM_VELOCITY.named(joints))
