# SPDX-License-Identifier: Apache-2.0
"""The command of the controller: four torques, labelled with the stamp of their state."""

from __future__ import annotations

from functools import cache, lru_cache
from math import isfinite
import re
from typing import Any

import numpy as np

from masmc_ros.errors import InputError
from masmc_ros.log.layout import ENCAPSULATION, NANOSECONDS
from masmc_ros.log.multi_array import MultiArrayLayout
from masmc_ros.log.names import DRIVEN_JOINTS

PREFIX = 'effort@'
NANOSECOND_DIGITS = 9

LABEL_SIZE = slice(len(ENCAPSULATION) + 4, len(ENCAPSULATION) + 8)
"""Where a message holds the size of its first label."""

_STAMP_LENGTHS = range(len('0.0'), len('0123456789.') + NANOSECOND_DIGITS + 1)
_LABEL = re.compile(PREFIX + r'(\d+)\.(\d{1,9})', re.ASCII)


class EffortLayout(MultiArrayLayout):
    """A command whose label has a known number of digits.

    Attributes:
        digits: where the digits of the stamp stand in the message.
    """

    def __init__(self, digits: int) -> None:
        """Lay out a command with `digits` characters after `effort@` in its label."""
        super().__init__([(PREFIX + '0' * digits, len(DRIVEN_JOINTS))], 0)
        start = self.labels[0] + len(PREFIX)
        self.digits = slice(start, start + digits)
        self.let_vary(self.digits)


@cache
def effort_layout(digits: int) -> EffortLayout:
    """Return the layout of a command with `digits` characters after `effort@`."""
    return EffortLayout(digits)


@cache
def _template(digits: int) -> tuple[bytes, bytes]:
    """Return what comes before and after the digits, the torques left out."""
    layout = effort_layout(digits)
    return (
        layout.template[: layout.digits.start],
        layout.template[layout.digits.stop : layout.data],
    )


@lru_cache(maxsize=64)
def layout_of_label(size: bytes) -> EffortLayout | None:
    """Return the layout that a label of this size goes with, None where no stamp fits it.

    Args:
        size: as it stands in the message, at `LABEL_SIZE`.
    """
    digits = int.from_bytes(size, 'little') - len(PREFIX) - 1
    return effort_layout(digits) if digits in _STAMP_LENGTHS else None


class EffortCdr:
    """A command as std_msgs/Float64MultiArray.

    Attributes:
        data: (4) torques of right wheel, left wheel, arm joints 1 and 2 in N m.
        stamp_ns: stamp in ns of the state that it answers; None for a received command
            without a label.
    """

    def __init__(self) -> None:
        """Make a command of zeros that answers the state of time 0."""
        self.data = np.zeros(len(DRIVEN_JOINTS))
        self.stamp_ns: int | None = None
        self._torques = memoryview(self.data.data).cast('B')
        self._digits = b''
        self.set_stamp(0)

    def set_stamp(self, stamp_ns: int) -> None:
        """Label the command with the stamp, in ns, of the state that it answers."""
        self.stamp_ns = stamp_ns
        self._digits = b'%d.%09d' % divmod(stamp_ns, NANOSECONDS)

    def to_bytes(self) -> bytes:
        """Return the message as it is sent, with the label set last."""
        before, after = _template(len(self._digits))
        return b''.join((before, self._digits, after, self._torques))

    def is_finite(self) -> bool:
        """Tell whether every torque is a finite number."""
        return all(map(isfinite, self.data.tolist()))

    def load(self, raw: bytes) -> bool:
        """Take over a received command that is labelled and laid out like ours.

        Args:
            raw: the message with its encapsulation header.

        Returns:
            False, with nothing changed, for every other message, which a full deserialiser
            has to read: see `load_message`.
        """
        layout = layout_of_label(raw[LABEL_SIZE])
        if layout is None or not layout.matches(raw):
            return False
        digits = raw[layout.digits]
        seconds, _, nanoseconds = digits.partition(b'.')
        if not (
            seconds.isdigit() and nanoseconds.isdigit() and len(nanoseconds) <= NANOSECOND_DIGITS
        ):
            return False
        self._torques[:] = raw[layout.data :]
        self._digits = digits
        self.stamp_ns = int(seconds) * NANOSECONDS + int(nanoseconds)
        return True

    def load_message(self, message: Any) -> None:
        """Take over a command of any sender, such as ros2_control's, labelled or not.

        Args:
            message: std_msgs/Float64MultiArray as any deserialiser gives it.

        Raises:
            InputError: for another number of torques than four, for one that is not finite
                and for a label that starts like ours and has no stamp; nothing is changed then.
        """
        stamp_ns = _label_stamp(message)
        torques = np.asarray(message.data, dtype=np.float64)
        if torques.shape != self.data.shape:
            raise InputError(
                f'effort command: {len(torques)} numbers; it takes {len(self.data)},'
                f' the torques of {", ".join(DRIVEN_JOINTS)}'
            )
        if not np.isfinite(torques).all():
            joint = DRIVEN_JOINTS[int(np.argmin(np.isfinite(torques)))]
            raise InputError(f"effort command: the torque of '{joint}' is not a finite number")
        self.data[:] = torques
        if stamp_ns is None:
            self.stamp_ns = None
        else:
            self.set_stamp(stamp_ns)


def _label_stamp(message: Any) -> int | None:
    """Return the stamp in ns on the label of a message, None where it has none."""
    dimensions = message.layout.dim
    label = dimensions[0].label if dimensions else ''
    if not label.startswith(PREFIX):
        return None
    match = _LABEL.fullmatch(label)
    if match is None:
        raise InputError(f"effort command: label '{label}' is not {PREFIX}SECONDS.NANOSECONDS")
    return int(match[1]) * NANOSECONDS + int(match[2])
