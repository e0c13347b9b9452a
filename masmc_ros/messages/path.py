# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A path as nav_msgs/Path, of any number of poses without rotation."""

from __future__ import annotations

from functools import cache

from masmc_ros.messages.cdr_layout import Layout
import numpy as np
from numpy.typing import NDArray

_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
"""As a quaternion x, y, z, w."""


@cache
def path_layouts(frame: str) -> tuple[Layout, Layout, Layout]:
    """
    Return the layouts of a path's head, of its first pose and of every other one.

    They may differ in padding bytes: the first pose follows the count, the others follow numbers
    of eight bytes. The head has the fields `stamp` and `count`; a pose has `stamp`, `position` and
    `orientation`.
    """
    head = Layout()
    head.stamp()
    head.string(frame)
    head.varying_uint32('count')
    first = _pose(frame, head.size)
    return head, first, _pose(frame, head.size + first.size)


def _pose(frame: str, position: int) -> Layout:
    """Return the layout of a pose at a position in bytes of the message."""
    layout = Layout(position)
    layout.stamp()
    layout.string(frame)
    layout.doubles('position', 3)
    layout.doubles('orientation', len(_NO_ROTATION))
    return layout


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
    head, first, other = path_layouts(frame)
    parts = [head.messages(stamp=[stamp_ns], count=[len(stamps)])]
    for layout, poses in ((first, slice(1)), (other, slice(1, None))):
        parts.append(
            layout.messages(
                stamp=stamps[poses], position=points[poses], orientation=_NO_ROTATION
            )
        )
    return b''.join(part.tobytes() for part in parts)
