# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A path as nav_msgs/Path, of any number of poses without rotation."""

from __future__ import annotations

from functools import cache

from masmc_ros.messages.cdr_layout import Layout
import numpy as np
from numpy.typing import NDArray

POSE_STAMPED = 'geometry_msgs/msg/PoseStamped'

_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
"""As a quaternion x, y, z, w."""


@cache
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
    frame: str, stamp_ns: int, stamps: NDArray[np.int64], points: NDArray[np.float64]
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
