# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Poses of frames: those of the robot as tf2_msgs/TFMessage, and the tree of the latest transforms.

All transforms of a tick, also the fixed one, are in one message. A viewer that jumps to any time
therefore needs only the latest message up to that time.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from masmc_ros.aliases import Array, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import ENCAPSULATION, Layout, Messages, NANOSECONDS, STAMP
from masmc_ros.messages.message import Message
from masmc_ros.robot.mechanisms import DEFAULT
import numpy as np
from numpy.typing import ArrayLike

_COUNT = 4
"""Bytes of a count, and of the length before a string."""

TRANSFORM = 7
"""Numbers of a transform: translation x, y, z and a quaternion x, y, z, w."""


Frames = tuple[tuple[str, str], ...]


@cache
def transforms_layout(frame_prefix: str = '', frames: Frames = DEFAULT.frames) -> Layout:
    """
    Return the layout of the transforms of frames, with a prefix before all names.

    The frame of index N has the fields `transforms_N_header_stamp` and `transforms_N_transform`,
    which has TRANSFORM numbers.
    """
    transforms = [
        {'header': {'frame_id': frame_prefix + parent}, 'child_frame_id': frame_prefix + child}
        for parent, child in frames
    ]
    return Layout('tf2_msgs/msg/TFMessage', {'transforms': transforms})


def transforms_messages(
    stamps: Stamps,
    transforms: Array,
    frame_prefix: str = '',
    frames: Frames = DEFAULT.frames,
) -> Messages:
    """
    Return the transforms of all frames at many times.

    Parameters
    ----------
    stamps
        Stamps (N) in ns.
    transforms
        Translation in m and quaternion x, y, z, w of each frame, (N, frames, TRANSFORM).
    frame_prefix
        Prefix of the names of all frames.
    frames
        Parent and child of each frame.

    """
    fields: dict[str, ArrayLike] = {}
    for number in range(len(frames)):
        fields[f'transforms_{number}_header_stamp'] = stamps
        fields[f'transforms_{number}_transform'] = transforms[:, number]
    return transforms_layout(frame_prefix, frames).messages(**fields)


class TransformsCdr(Message):
    """A TFMessage of all frames of a robot, filled in place."""

    def __init__(self, frame_prefix: str = '', frames: Frames = DEFAULT.frames) -> None:
        """Initialise transforms of zeros at time 0; `frames` are pairs of parent and child."""
        layout = transforms_layout(frame_prefix, frames)
        super().__init__(layout)
        # The fields are the stamp and the numbers of each frame.
        places = list(layout.places.values())
        self._stamps = places[::2]
        # Indices of all numbers in `words`, for one assignment.
        numbers = np.array([[place.start] for place in places[1::2]])
        self._numbers = (numbers + self._lead) // 8 + np.arange(TRANSFORM)

    def fill(self, stamp_ns: int, transforms: Array) -> bytes:
        """Write the stamp and transforms (frames, TRANSFORM); return the serialised message."""
        stamp = STAMP.pack(*divmod(stamp_ns, NANOSECONDS))
        for place in self._stamps:
            self._wire[place] = stamp
        self.words[self._numbers] = transforms
        return self.to_bytes()


def first_frames(raw: bytes) -> tuple[str, str]:
    """Return parent and child of a TFMessage's first transform; '' without transforms."""
    parent, end = _string(raw, len(ENCAPSULATION) + _COUNT + STAMP.size)
    child, _ = _string(raw, end)
    return parent, child


def transforms_of(raw: bytes) -> Iterator[tuple[str, str, Array]]:
    """
    Yield parent, child and numbers (TRANSFORM) of the transforms of a TFMessage of any sender.

    Raises InputError for bytes that are not a little-endian TFMessage.
    """
    start = len(ENCAPSULATION)
    if raw[:start] != ENCAPSULATION:
        raise InputError('tf: no little-endian TFMessage')
    end = start + _COUNT
    for _ in range(int.from_bytes(raw[start:end], 'little')):
        end += (start - end) % _COUNT
        parent, end = _string(raw, end + STAMP.size)
        child, end = _string(raw, end)
        end += (start - end) % 8
        numbers = raw[end:end + 8 * TRANSFORM]
        if len(numbers) < 8 * TRANSFORM:
            raise InputError(f'tf: a message of {len(raw)} bytes ends within a transform')
        end += 8 * TRANSFORM
        yield parent, child, np.frombuffer(numbers, '<f8')


def first_names(frame_prefix: str, frames: Frames = DEFAULT.frames) -> tuple[bytes, int]:
    """Return the serialised names of a robot's first frames in a TFMessage, and their place."""
    layout = transforms_layout(frame_prefix, frames)
    stamp, numbers, *_ = layout.places.values()
    return layout.template[stamp.stop:numbers.start], stamp.stop


def is_of_robot(raw: bytes, frame_prefix: str) -> bool:
    """
    Return True if a TFMessage belongs to the robot whose frames have this prefix.

    One frame of the first transform must have the prefix: `map` to `left/odom` belongs to `left/`.
    For a robot without a prefix, one frame must have none.
    """
    if frame_prefix:
        return any(name.startswith(frame_prefix) for name in first_frames(raw))
    return any('/' not in name for name in first_frames(raw))


def _string(raw: bytes, start: int) -> tuple[str, int]:
    """Return the string at a place of a message, and the place after it."""
    start += (len(ENCAPSULATION) - start) % _COUNT
    length = int.from_bytes(raw[start:start + _COUNT], 'little')
    end = start + _COUNT + length
    return raw[start + _COUNT:end - 1].decode('utf-8', 'replace'), end


_IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class FrameTree:
    """Tree of frames, each with the latest transform from its parent."""

    def __init__(self) -> None:
        """Initialise without frames."""
        self._static: dict[str, tuple[str, Array]] = {}
        self._moving: dict[str, tuple[str, Array]] = {}

    def add(self, raw: bytes, *, is_static: bool) -> None:
        """Store the transforms of a TFMessage; InputError for bytes that are none."""
        parents = self._static if is_static else self._moving
        for parent, child, numbers in transforms_of(raw):
            parents[child.lstrip('/')] = parent.lstrip('/'), numbers

    def forget_moving(self) -> None:
        """Remove the transforms that are not static."""
        self._moving.clear()

    def pose(self, frame: str, target: str) -> Array | None:
        """
        Return the pose (7) of a frame in another one; None if they are not connected.

        The numbers are the position in m and a unit quaternion x, y, z, w.
        """
        ways = self._way(frame), self._way(target)
        common = next((name for name in ways[0] if name in ways[1]), None)
        if common is None:
            return None
        return moved(_inverse(ways[1][common]), ways[0][common])

    def _way(self, frame: str) -> dict[str, Array]:
        """Return the pose of a frame in itself and in each frame above it, from it upwards."""
        way = {frame: _IDENTITY}
        parents = {**self._static, **self._moving}
        while frame in parents:
            pose = way[frame]
            frame, numbers = parents[frame]
            if frame in way:
                break  # a loop, of senders that disagree
            way[frame] = moved(numbers, pose)
        return way


def moved(transform: Array, poses: Array) -> Array:
    """
    Return poses of a frame in another one.

    Parameters
    ----------
    transform
        Pose (7) of the frame there.
    poses
        Poses (..., 7) in the frame.

    """
    result = np.empty(np.shape(poses))
    x, w = transform[3:6], transform[6]
    position, vector, scalar = poses[..., :3], poses[..., 3:6], poses[..., 6:]
    turn = 2.0 * np.cross(x, position)
    result[..., :3] = transform[:3] + position + w * turn + np.cross(x, turn)
    result[..., 3:6] = w * vector + scalar * x + np.cross(x, vector)
    result[..., 6:] = w * scalar - np.sum(x * vector, axis=-1, keepdims=True)
    return result


def _inverse(transform: Array) -> Array:
    back = _IDENTITY.copy()
    back[3:6], back[6] = -transform[3:6], transform[6]
    back[:3] = moved(back, np.append(-transform[:3], _IDENTITY[3:]))[:3]
    return back
