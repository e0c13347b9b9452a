# SPDX-License-Identifier: Apache-2.0
"""Where the robot's frames are at a time: tf2_msgs/TFMessage.

All transforms of a tick travel in one message, the fixed one too: the latest message at or
before a time then tells everything of that time, wherever a viewer jumps to.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from masmc_ros.log.layout import Layout, Message, NANOSECONDS
from masmc_ros.robot.names import FRAMES

TRANSFORM = 7
"""Numbers of a transform: translation x, y, z and a quaternion x, y, z, w."""


class TransformsLayout(NamedTuple):
    """The layout of a robot's transforms; where each one's parts start, in bytes."""

    layout: Layout
    stamps: list[int]
    numbers: list[int]


@cache
def transforms_layout(frame_prefix: str = '') -> TransformsLayout:
    """Return the layout of the transforms of FRAMES, with a prefix before all names."""
    layout = Layout()
    layout.uint32(len(FRAMES))
    stamps, numbers = [], []
    for parent, child in FRAMES:
        stamps.append(layout.stamp())
        layout.string(frame_prefix + parent)
        layout.string(frame_prefix + child)
        numbers.append(layout.doubles(TRANSFORM))
    return TransformsLayout(layout, stamps, numbers)


class TransformsCdr(Message):
    """A TFMessage of all frames of a robot, filled in place."""

    def __init__(self, frame_prefix: str = '') -> None:
        """Make transforms of zeros at time 0."""
        layout, stamps, numbers = transforms_layout(frame_prefix)
        super().__init__(layout)
        self._words = self._memory.view(np.int32)
        # One write each for all stamps and for all numbers, wherever they lie.
        self._stamps = (np.array(stamps)[:, None] + self._lead) // 4 + np.arange(2)
        self._numbers = (np.array(numbers)[:, None] + self._lead) // 8 + np.arange(TRANSFORM)

    def fill(self, stamp_ns: int, transforms: NDArray[np.float64]) -> bytes:
        """Write transforms (6, 7) as FRAMES lists them, m; return the message as it is sent."""
        self._words[self._stamps] = divmod(stamp_ns, NANOSECONDS)
        self._memory[self._numbers] = transforms
        return self.to_bytes()
