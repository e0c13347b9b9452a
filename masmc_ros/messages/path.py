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

"""A path as nav_msgs/Path, of any number of poses without rotation."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from masmc_ros.messages.layout import ENCAPSULATION, Layout, NANOSECONDS, STAMP
import numpy as np
from numpy.typing import ArrayLike, NDArray

_POSE = 7
"""Numbers of a pose: position x, y, z and a quaternion x, y, z, w."""


class PathLayout(NamedTuple):
    """
    A path of two poses, from which one of any number is made; places in bytes.

    The second pose is like all that follow it. The first one's may differ by bytes that
    align: it follows the count, the others follow numbers of eight bytes.
    """

    layout: Layout
    length: int
    stamps: tuple[int, int]
    numbers: tuple[int, int]


@cache
def path_layout(frame: str) -> PathLayout:
    """Return the layout of a path of two poses in a frame."""
    layout = Layout()
    layout.stamp()
    layout.string(frame)
    length = layout.uint32(2)
    stamps, numbers = [], []
    for _ in range(2):
        stamps.append(layout.stamp())
        layout.string(frame)
        numbers.append(layout.doubles(_POSE))
    return PathLayout(layout, length, (stamps[0], stamps[1]), (numbers[0], numbers[1]))


def path_message(
    frame: str, stamp_ns: int, stamps: NDArray[np.int64], points: ArrayLike
) -> bytes:
    """
    Return a serialised path.

    Parameters
    ----------
    frame
        the frame that it is in.
    stamp_ns
        its stamp in ns.
    stamps
        (n) time of each pose in ns.
    points
        (n, 3) positions in m.

    """
    layout, length, stamp_offsets, number_offsets = path_layout(frame)
    template = np.frombuffer(layout.template, np.uint8)
    first_end, end = (offset + 8 * _POSE for offset in number_offsets)
    head = template[: first_end if len(stamps) else length + 4].copy()
    STAMP.pack_into(head.data, len(ENCAPSULATION), *divmod(stamp_ns, NANOSECONDS))
    head[length:length + 4] = np.frombuffer(len(stamps).to_bytes(4, 'little'), np.uint8)
    if not len(stamps):
        return head.tobytes()
    poses = np.zeros((len(stamps), _POSE))
    poses[:, :3] = points
    poses[:, -1] = 1.0
    rest = np.tile(template[first_end:end], (len(stamps) - 1, 1))
    for rows, which, place in ((head[None], slice(1), 0), (rest, slice(1, None), 1)):
        # The rows of the rest begin where the first pose ends.
        start = place * first_end
        _fill(rows, stamp_offsets[place] - start, _times(stamps[which]))
        _fill(rows, number_offsets[place] - start, poses[which])
    return head.tobytes() + rest.tobytes()


def _times(stamps: NDArray[np.int64]) -> NDArray[np.int32]:
    return np.stack(np.divmod(stamps, NANOSECONDS), axis=1).astype('<i4')


def _fill(rows: NDArray[np.uint8], offset: int, values: NDArray[np.generic]) -> None:
    data = values.view(np.uint8)
    rows[:, offset:offset + data.shape[1]] = data
