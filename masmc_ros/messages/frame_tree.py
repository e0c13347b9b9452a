# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Latest transforms between frames, from the messages of /tf and /tf_static."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.messages.transforms import transforms_of
import numpy as np

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
