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

"""
A command for some joints: numbers, labelled with the stamp of the state that they answer.

A void command answers a state and commands nothing. It is laid out like any other: as many
zeros, which whoever looks no further takes for the command, before a `data_offset` that says
that all of them are padding.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
import re
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.messages.layout import checked_stamp, ENCAPSULATION, NANOSECONDS
from masmc_ros.messages.multi_array import MultiArrayLayout
import numpy as np

NANOSECOND_DIGITS = 9

LABEL_SIZE = slice(len(ENCAPSULATION) + 4, len(ENCAPSULATION) + 8)
"""Where a message holds the size of its first label."""

_SECOND_DIGITS = 10

_STAMP_LENGTHS = range(len('0.0'), _SECOND_DIGITS + len('.') + NANOSECOND_DIGITS + 1)


class LabelledLayout(MultiArrayLayout):
    """
    A command whose label has a known number of digits.

    Attributes
    ----------
    digits
        where the digits of the stamp stand in the message.
    padding
        where it says how many of its numbers are none.

    """

    def __init__(self, prefix: str, count: int, digits: int) -> None:
        """Lay out `count` numbers with so many characters after `prefix` in their label."""
        super().__init__([(prefix + '0' * digits, count)], 0)
        start = self.labels[0] + len(prefix)
        self.digits = slice(start, start + digits)
        self.padding = slice(self.offset, self.offset + 4)
        self.let_vary(self.digits)
        self.let_vary(self.padding)


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
    paddings
        how many numbers are none, in the message, of a command and of a void one.

    """

    def __init__(self, what: str, quantity: str, prefix: str, joints: Sequence[str]) -> None:
        """Name a kind of command; see the attributes."""
        self.what, self.quantity, self.prefix = what, quantity, prefix
        self.joints = tuple(joints)
        self._label = re.compile(re.escape(prefix) + r'(\d+)\.(\d{1,9})', re.ASCII)
        self._layouts: dict[int, LabelledLayout] = {}
        self._templates: dict[tuple[int, bool], tuple[bytes, bytes]] = {}
        self.paddings = bytes(4), len(self.joints).to_bytes(4, 'little')
        self._by_size: dict[bytes, LabelledLayout | None] = {}

    def named(self, joints: Sequence[str]) -> CommandKind:
        """Return the same kind for joints of other names."""
        if tuple(joints) == self.joints:
            return self
        return CommandKind(self.what, self.quantity, self.prefix, joints)

    def layout(self, digits: int) -> LabelledLayout:
        """Return the layout of a command with `digits` characters after the prefix."""
        layout = self._layouts.get(digits)
        if layout is None:
            layout = LabelledLayout(self.prefix, len(self.joints), digits)
            self._layouts[digits] = layout
        return layout

    def template(self, digits: int, *, is_void: bool) -> tuple[bytes, bytes]:
        """Return what comes before and after the digits, the numbers left out."""
        template = self._templates.get((digits, is_void))
        if template is None:
            layout = self.layout(digits)
            whole, padding = layout.template, layout.padding
            template = (
                whole[: layout.digits.start],
                whole[layout.digits.stop:padding.start]
                + self.paddings[is_void]
                + whole[padding.stop:layout.data],
            )
            self._templates[digits, is_void] = template
        return template

    def layout_of_label(self, size: bytes) -> LabelledLayout | None:
        """
        Return the layout that a label of this size goes with, None where no stamp fits it.

        Parameters
        ----------
        size
            as it stands in the message, at `LABEL_SIZE`.

        """
        if size not in self._by_size:
            digits = int.from_bytes(size, 'little') - len(self.prefix) - 1
            if digits not in _STAMP_LENGTHS:
                return None
            self._by_size[size] = self.layout(digits)
        return self._by_size[size]

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
        before, after = self.kind.template(len(self._digits), is_void=self.is_void)
        return b''.join((before, self._digits, after, self._numbers))

    def is_finite(self) -> bool:
        """Tell whether every number is finite."""
        numbers = self.data.tolist()
        return isfinite(sum(numbers)) or all(map(isfinite, numbers))

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
        layout = self.kind.layout_of_label(raw[LABEL_SIZE])
        if layout is None or not layout.matches(raw):
            return False
        digits, padding = raw[layout.digits], raw[layout.padding]
        seconds, _, nanoseconds = digits.partition(b'.')
        if not (
            seconds.isdigit() and nanoseconds.isdigit() and len(nanoseconds) <= NANOSECOND_DIGITS
        ):
            return False
        stamp_ns = checked_stamp(int(seconds) * NANOSECONDS + int(nanoseconds))
        command, void = self.kind.paddings
        if padding not in (command, void):
            return False
        self.is_void = padding == void
        self._numbers[:] = raw[layout.data:]
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
