# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Where the robot's frames are at a time: tf2_msgs/TFMessage.

All transforms of a tick travel in one message, the fixed one too: the latest message at or
before a time then tells everything of that time, wherever a viewer jumps to.
"""

from __future__ import annotations

from functools import cache

from masmc_ros.messages.layout import ENCAPSULATION, Layout, Messages, NANOSECONDS, STAMP
from masmc_ros.messages.message import Message
from masmc_ros.robot.registry import DEFAULT
import numpy as np
from numpy.typing import ArrayLike, NDArray

_COUNT = 4
"""Bytes of a count, and of the length in front of a string."""

TRANSFORM = 7
"""Numbers of a transform: translation x, y, z and a quaternion x, y, z, w."""


Frames = tuple[tuple[str, str], ...]


@cache
def transforms_layout(frame_prefix: str = '', frames: Frames = DEFAULT.frames) -> Layout:
    """
    Return the layout of the transforms of frames, with a prefix before all names.

    Its fields are `stamp_CHILD` and `transform_CHILD` of each, the latter of TRANSFORM numbers.
    """
    layout = Layout()
    layout.uint32(len(frames))
    for parent, child in frames:
        layout.stamp(f'stamp_{child}')
        layout.string(frame_prefix + parent)
        layout.string(frame_prefix + child)
        layout.doubles(f'transform_{child}', TRANSFORM)
    return layout


def transforms_messages(
    stamps: NDArray[np.int64],
    transforms: NDArray[np.float64],
    frame_prefix: str = '',
    frames: Frames = DEFAULT.frames,
) -> Messages:
    """
    Return the transforms of all frames at each of many times.

    Parameters
    ----------
    stamps
        (N) in ns.
    transforms
        (N, frames, TRANSFORM) translation in m and quaternion x, y, z, w.
    frame_prefix
        of the names of all frames.
    frames
        parent and child of each.

    """
    fields: dict[str, ArrayLike] = {}
    for number, (_, child) in enumerate(frames):
        fields[f'stamp_{child}'] = stamps
        fields[f'transform_{child}'] = transforms[:, number]
    return transforms_layout(frame_prefix, frames).messages(**fields)


class TransformsCdr(Message):
    """A TFMessage of all frames of a robot, filled in place."""

    def __init__(self, frame_prefix: str = '', frames: Frames = DEFAULT.frames) -> None:
        """Make transforms of zeros at time 0, of these frames: parent and child of each."""
        layout = transforms_layout(frame_prefix, frames)
        super().__init__(layout)
        self._stamps = [layout.places[f'stamp_{child}'] for _, child in frames]
        # One write for all numbers, wherever they lie.
        numbers = np.array([[layout.places[f'transform_{child}'].start] for _, child in frames])
        self._numbers = (numbers + self._lead) // 8 + np.arange(TRANSFORM)

    def fill(self, stamp_ns: int, transforms: NDArray[np.float64]) -> bytes:
        """Write transforms (frames, TRANSFORM) in their order, m; return the message."""
        stamp = STAMP.pack(*divmod(stamp_ns, NANOSECONDS))
        for place in self._stamps:
            self._wire[place] = stamp
        self.words[self._numbers] = transforms
        return self.to_bytes()


def first_frames(raw: bytes) -> tuple[str, str]:
    """Return parent and child of a TFMessage's first transform; '' where it has none."""
    parent, end = _string(raw, len(ENCAPSULATION) + _COUNT + STAMP.size)
    child, _ = _string(raw, end)
    return parent, child


def first_names(frame_prefix: str, frames: Frames = DEFAULT.frames) -> tuple[bytes, int]:
    """Return the names of a robot's first frames as `TransformsCdr` has them, and their place."""
    layout, (_, child) = transforms_layout(frame_prefix, frames), frames[0]
    names = layout.places[f'stamp_{child}'].stop
    return layout.template[names:layout.places[f'transform_{child}'].start], names


def is_of_robot(raw: bytes, frame_prefix: str) -> bool:
    """
    Return True if a TFMessage is about a robot whose frames have this prefix.

    It does so where parent or child is the robot's own: `map` to `left/odom` is of `left/`.
    A robot without a prefix has the frames without one.
    """
    if frame_prefix:
        return any(name.startswith(frame_prefix) for name in first_frames(raw))
    return any('/' not in name for name in first_frames(raw))


def _string(raw: bytes, start: int) -> tuple[str, int]:
    """Return the string of a message at a place, and the end of it."""
    start += (len(ENCAPSULATION) - start) % _COUNT
    length = int.from_bytes(raw[start:start + _COUNT], 'little')
    end = start + _COUNT + length
    return raw[start + _COUNT:end - 1].decode('utf-8', 'replace'), end
