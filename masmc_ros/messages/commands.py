# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Commands for joints, torques or rates: numbers, with the stamp of the state that they answer.

A void command answers a state and commands nothing. It is laid out like any other: as many
zeros, which whoever looks no further takes for the command, before a `data_offset` that says
that all of them are padding.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
import re
from struct import Struct
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.messages.layout import (
    all_finite,
    checked_stamp,
    ENCAPSULATION,
    Layout,
    Messages,
    NANOSECONDS,
)
from masmc_ros.messages.multi_array import labelled_layout
from masmc_ros.messages.names import DRIVEN_JOINTS, RATED_JOINTS
import numpy as np
from numpy.typing import ArrayLike, NDArray

NANOSECOND_DIGITS = 9

LABEL_SIZE = slice(len(ENCAPSULATION) + 4, len(ENCAPSULATION) + 8)
"""Place of the size of the first label in a message."""

_SECOND_DIGITS = 10

_STAMP_LENGTHS = range(len('0.0'), _SECOND_DIGITS + len('.') + NANOSECOND_DIGITS + 1)


class CommandMessages(NamedTuple):
    """
    Commands whose labels are equally long.

    Attributes
    ----------
    indices
        (n) which of the given commands they are.
    messages
        (n) as they are sent.

    """

    indices: NDArray[np.intp]
    messages: Messages


class _Form:
    """A command as it is sent, cut into what is the same in all and what varies."""

    def __init__(self, layout: Layout, joints: int) -> None:
        self.layout = layout
        characters, data = layout.places['characters'], layout.places['data']
        cuts = (0, characters.start, characters.stop, data.start, data.stop)
        sizes = (stop - start for start, stop in pairwise(cuts))
        self.parts = Struct(''.join(f'{size}s' for size in sizes))
        """Before the digits, these, after them, the numbers."""
        usual, void = (
            self.parts.unpack(message) for message in layout.messages(data_offset=[0, joints])
        )
        self.before, self.after = usual[0], (usual[2], void[2])
        """Bytes before and after the digits, and those of a void command."""


class CommandKind:
    """
    What commands of one topic are, and the layouts that they come in.

    Attributes
    ----------
    what
        what a command is called.
    joints
        that it is for, in order.
    quantity
        what each number is, such as `torque`.
    prefix
        of its label, before the stamp.

    """

    def __init__(self, what: str, quantity: str, prefix: str, joints: Sequence[str]) -> None:
        """Name a kind of command; see the attributes."""
        self.what, self.quantity, self.prefix = what, quantity, prefix
        self.joints = tuple(joints)
        self._label = re.compile(re.escape(prefix) + r'(\d+)\.(\d{1,9})', re.ASCII)
        self._forms: dict[int, _Form] = {}
        self._by_size: dict[bytes, _Form] = {}

    def named(self, joints: Sequence[str]) -> CommandKind:
        """Return the same kind for joints of other names."""
        if tuple(joints) == self.joints:
            return self
        return CommandKind(self.what, self.quantity, self.prefix, joints)

    def form(self, digits: int) -> _Form:
        """Return the form of a command with `digits` characters after the prefix."""
        form = self._forms.get(digits)
        if form is None:
            joints = len(self.joints)
            form = _Form(labelled_layout(self.prefix, digits, joints), joints)
            self._forms[digits] = form
        return form

    def messages(
        self, stamps: NDArray[np.int64], numbers: ArrayLike, is_void: ArrayLike = False
    ) -> list[CommandMessages]:
        """
        Return many commands, one group for each number of digits of the seconds.

        Parameters
        ----------
        stamps
            (N) of the states that they answer, in ns, not negative.
        numbers
            (N, n), one for each joint.
        is_void
            (N) or for all, whether they command nothing.

        """
        numbers = np.asarray(numbers)
        voids = np.broadcast_to(np.asarray(is_void, bool), len(numbers))
        seconds, nanoseconds = np.divmod(stamps, NANOSECONDS)
        lengths = np.char.str_len(seconds.astype(str))
        groups = []
        for length in np.unique(lengths).tolist():
            indices = np.flatnonzero(lengths == length)
            label = (
                _digits(seconds[indices], length),
                np.full((len(indices), 1), ord('.'), np.uint8),
                _digits(nanoseconds[indices], NANOSECOND_DIGITS),
            )
            messages = self.form(length + 1 + NANOSECOND_DIGITS).layout.messages(
                characters=np.hstack(label),
                data_offset=voids[indices] * len(self.joints),
                data=numbers[indices],
            )
            groups.append(CommandMessages(indices, messages))
        return groups

    def form_of_label(self, size: bytes) -> _Form | None:
        """
        Return the form that a label of this size goes with, None where no stamp fits it.

        Parameters
        ----------
        size
            as it stands in the message, at `LABEL_SIZE`.

        """
        form = self._by_size.get(size)
        if form is None:
            digits = int.from_bytes(size, 'little') - len(self.prefix) - 1
            if digits not in _STAMP_LENGTHS:
                return None
            form = self._by_size[size] = self.form(digits)
        return form

    def label_stamp(self, message: Any) -> int | None:
        """
        Return the stamp in ns on the label of a message, None where it has none.

        Raises
        ------
        InputError
            for a label that starts like ours and has no stamp, or one that is no
            time.

        """
        dimensions = message.layout.dim
        label = dimensions[0].label if dimensions else ''
        if not label.startswith(self.prefix):
            return None
        match = self._label.fullmatch(label)
        if match is None:
            expected = f'{self.prefix}SECONDS.NANOSECONDS'
            raise InputError(f"{self.what}: label '{label}' is not {expected}")
        if len(match[1]) > _SECOND_DIGITS:
            raise InputError(f"{self.what}: label '{label[:40]}' is beyond 2**31 s")
        return checked_stamp(int(match[1]) * NANOSECONDS + int(match[2]))


def _digits(numbers: NDArray[np.int64], count: int) -> NDArray[np.uint8]:
    """Return `numbers` (N) as `count` characters each, (N, count)."""
    powers = 10 ** np.arange(count - 1, -1, -1)
    return (numbers[:, None] // powers % 10 + ord('0')).astype(np.uint8)


class LabelledCdr:
    """
    A command as std_msgs/Float64MultiArray.

    Attributes
    ----------
    kind
        what it is.
    data
        a number for each joint of the kind.
    stamp_ns
        stamp in ns of the state that it answers; None for a received command
        without a label.
    is_void
        whether it commands nothing.

    """

    def __init__(self, kind: CommandKind) -> None:
        """Make a command of zeros that answers the state of time 0."""
        self.kind = kind
        self.data = np.zeros(len(kind.joints))
        self.stamp_ns: int | None = None
        self.is_void = False
        self._numbers = memoryview(self.data.data).cast('B')
        self._digits = b''
        self.set_stamp(0)

    def set_stamp(self, stamp_ns: int) -> None:
        """Label the command with the stamp, in ns, of the state that it answers."""
        self.stamp_ns = stamp_ns
        self._digits = b'%d.%09d' % divmod(stamp_ns, NANOSECONDS)

    def to_bytes(self) -> bytes:
        """Return the message as it is sent, with the label set last."""
        form = self.kind.form(len(self._digits))
        return b''.join((form.before, self._digits, form.after[self.is_void], self._numbers))

    def is_finite(self) -> bool:
        """Return True if every number is finite."""
        return all_finite(self.data.tolist())

    def load(self, raw: bytes) -> bool:
        """
        Take over a received command that is labelled and laid out like ours.

        Parameters
        ----------
        raw
            the message with its encapsulation header.

        Returns
        -------
            False, with nothing changed, for every other message, which a full deserialiser
            has to read: see `load_message`.

        Raises
        ------
        InputError
            for a stamp that is no time; nothing is changed then.

        """
        form = self.kind.form_of_label(raw[LABEL_SIZE])
        if form is None or len(raw) != form.parts.size:
            return False
        before, digits, after, numbers = form.parts.unpack(raw)
        if before != form.before or after not in form.after:
            # A foreign sender's, unless only what it aligns with differs.
            if not form.layout.matches(raw):
                return False
            offset = int.from_bytes(raw[form.layout.places['data_offset']], 'little')
            if offset not in (0, len(self.data)):
                return False
            after = form.after[offset > 0]
        seconds, _, nanoseconds = digits.partition(b'.')
        if not (
            seconds.isdigit() and nanoseconds.isdigit() and len(nanoseconds) <= NANOSECOND_DIGITS
        ):
            return False
        stamp_ns = checked_stamp(int(seconds) * NANOSECONDS + int(nanoseconds))
        self.is_void = after == form.after[True]
        self._numbers[:] = numbers
        self._digits = digits
        self.stamp_ns = stamp_ns
        return True

    def load_message(self, message: Any) -> None:
        """
        Take over a command of any sender, such as ros2_control's, labelled or not.

        Parameters
        ----------
        message
            std_msgs/Float64MultiArray as any deserialiser gives it.

        Raises
        ------
        InputError
            for another number of joints than the kind's, for a number that is not
            finite and for a label that starts like ours and has no stamp; nothing is
            changed then.

        """
        kind = self.kind
        stamp_ns = kind.label_stamp(message)
        numbers = np.asarray(message.data, dtype=np.float64)
        if numbers.shape != self.data.shape:
            raise InputError(
                f'{kind.what}: {len(numbers)} numbers; it takes {len(self.data)},'
                f' the {kind.quantity}s of {", ".join(kind.joints)}'
            )
        if not np.isfinite(numbers).all():
            joint = kind.joints[int(np.argmin(np.isfinite(numbers)))]
            raise InputError(
                f"{kind.what}: the {kind.quantity} of '{joint}' is not a finite number"
            )
        self.data[:] = numbers
        self.is_void = int(message.layout.data_offset) == len(numbers)
        if stamp_ns is None:
            self.stamp_ns = None
        else:
            self.set_stamp(stamp_ns)


EFFORT = CommandKind('effort command', 'torque', 'effort@', DRIVEN_JOINTS)
"""Torques in N m, labelled `effort@SECONDS.NANOSECONDS`."""

ARM_VELOCITY = CommandKind('arm velocity command', 'rate', 'velocity@', RATED_JOINTS)
"""Velocities in rad/s, labelled `velocity@SECONDS.NANOSECONDS`; the base has a twist."""


class EffortCdr(LabelledCdr):
    """Torques of the driven joints in N m, in `data`."""

    def __init__(self, joints: Sequence[str] = DRIVEN_JOINTS) -> None:
        """Make a command of zeros, for joints of these names, that answers the state of time 0."""
        super().__init__(EFFORT.named(joints))


class ArmVelocityCdr(LabelledCdr):
    """Rates of the joints that the base does not move by, in rad/s, in `data`."""

    def __init__(self, joints: Sequence[str] = RATED_JOINTS) -> None:
        """Make a command of zeros, for joints of these names, that answers the state of time 0."""
        super().__init__(ARM_VELOCITY.named(joints))
