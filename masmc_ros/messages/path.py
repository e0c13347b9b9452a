# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A path as nav_msgs/Path, of any number of poses without rotation."""

from __future__ import annotations

from functools import lru_cache

from masmc_ros.aliases import Array, Stamps
from masmc_ros.messages.cdr_layout import ENCAPSULATION, Layout
import numpy as np

POSE_STAMPED = 'geometry_msgs/msg/PoseStamped'

_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
"""As a quaternion x, y, z, w."""

_FRAME = slice(16, None)
"""Place of the name of the frame, which follows its length."""

_LONGEST_FRAME = 256
"""Largest number of bytes of a frame that is read here."""


# Bounded: frames of received messages may be any.
@lru_cache(maxsize=16)
def path_layouts(frame: str) -> tuple[Layout, Layout, Layout]:
    """
    Return the layouts of a path without poses, of its first pose and of every other one.

    They may differ in padding bytes: the first pose follows the count, the others follow numbers
    of eight bytes. All have the field `header_stamp`; a pose also has `pose`, its position in m
    and its quaternion.
    """
    contents = {'header': {'frame_id': frame}}
    path = Layout('nav_msgs/msg/Path', contents)
    first = Layout(POSE_STAMPED, contents, path.size)
    return path, first, Layout(POSE_STAMPED, contents, path.size + first.size)


def path_message(
    frame: str, stamp_ns: int, stamps: Stamps, points: Array
) -> bytes:
    """
    Return a serialised path.

    Parameters
    ----------
    frame
        Frame of the path.
    stamp_ns
        Stamp of the path in ns.
    stamps
        Time (n) of each pose in ns.
    points
        Positions (n, 3) in m.

    """
    path, first, other = path_layouts(frame)
    count = len(stamps)
    poses = np.column_stack((points, np.tile(_NO_ROTATION, (count, 1))))
    # The number of poses is at the end of a path without poses.
    head = path.messages(header_stamp=[stamp_ns]).tobytes()[:-4] + count.to_bytes(4, 'little')
    parts = (
        layout.messages(header_stamp=stamps[part], pose=poses[part]).tobytes()
        for layout, part in ((first, slice(1)), (other, slice(1, None)))
    )
    return b''.join((head, *parts))


def path_points(raw: bytes) -> Array | None:
    """
    Return the positions (n, 3) in m of a serialised path.

    Returns None for a path in another form, such as poses in several frames, or with another byte
    order. rclpy reads those too, at 10 µs per pose.
    """
    length = int.from_bytes(raw[12:16], 'little')
    if raw[:4] != ENCAPSULATION or not 1 <= length <= _LONGEST_FRAME:
        return None
    try:
        frame = raw[_FRAME][:length - 1].decode()
    except UnicodeDecodeError:
        return None
    path, first, other = path_layouts(frame)
    count = int.from_bytes(raw[path.size - 4:path.size], 'little')
    parts = (first, min(count, 1)), (other, max(count - 1, 0))
    if len(raw) != path.size + sum(layout.size * poses for layout, poses in parts):
        return None
    points, start = np.empty((count, 3)), path.size
    for number, (layout, poses) in enumerate(parts):
        end = start + layout.size * poses
        pieces = [raw[i:i + layout.size] for i in range(start, end, layout.size)]
        matches, messages = layout.read(pieces)
        if not matches.all():
            return None
        points[number:number + poses] = messages['pose'][:, :3]
        start = end
    return points
