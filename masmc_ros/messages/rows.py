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

"""Many messages of one layout at once, as the rows of a matrix of bytes."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.messages.effort import EFFORT
from masmc_ros.messages.joint_state import joint_state_layout
from masmc_ros.messages.labelled_command import CommandKind, NANOSECOND_DIGITS
from masmc_ros.messages.layout import ENCAPSULATION, Layout, NANOSECONDS
from masmc_ros.messages.names import JOINTS
from masmc_ros.messages.platform_motion import (
    odometry_layout,
    time_layout,
    twist_layout,
    twist_stamped_layout,
)
from masmc_ros.messages.telemetry import telemetry_layout
from masmc_ros.messages.transforms import Frames, transforms_layout
from masmc_ros.robot.registry import DEFAULT
import numpy as np
from numpy.typing import ArrayLike, NDArray

Rows = NDArray[np.uint8]
Stamps = NDArray[np.int64]


class CommandRows(NamedTuple):
    """
    Commands whose labels are equally long.

    Attributes
    ----------
    indices
        (n) which of the given commands they are.
    rows
        (n, size) their messages.

    """

    indices: NDArray[np.intp]
    rows: Rows


def _rows(layout: Layout, count: int) -> Rows:
    return np.tile(np.frombuffer(layout.template, np.uint8), (count, 1))


def _fill(rows: Rows, offset: int, values: ArrayLike, kind: str = '<f8') -> None:
    """Write `values` (N, n) into the rows, from byte `offset` on."""
    data = np.ascontiguousarray(values, dtype=kind).view(np.uint8)
    rows[:, offset:offset + data.shape[1]] = data


def _fill_stamps(rows: Rows, stamps: Stamps, offset: int = len(ENCAPSULATION)) -> None:
    # Nanoseconds stay below 2^31, so that one signed kind serves both numbers.
    _fill(rows, offset, np.stack(np.divmod(stamps, NANOSECONDS), axis=1), '<i4')


def joint_state_rows(
    stamps: Stamps,
    positions: ArrayLike,
    velocities: ArrayLike,
    efforts: ArrayLike,
    names: tuple[str, ...] = JOINTS,
) -> Rows:
    """
    Return joint states as (N, size).

    Parameters
    ----------
    stamps
        (N) in ns.
    positions
        (N, n) in m and rad.
    velocities
        (N, n) in m/s and rad/s.
    efforts
        (N, n) zeros for the base joints, then torques in N m.
    names
        (n) of the joints.

    """
    layout, position, velocity, effort = joint_state_layout(names)
    rows = _rows(layout, len(stamps))
    _fill_stamps(rows, stamps)
    _fill(rows, position, positions)
    _fill(rows, velocity, velocities)
    _fill(rows, effort, efforts)
    return rows


def effort_rows(
    stamps: Stamps, torques: ArrayLike, is_void: ArrayLike = False
) -> list[CommandRows]:
    """Return commands of torques (N, 4) in N m; see `command_rows`."""
    return command_rows(EFFORT, stamps, torques, is_void)


def command_rows(
    kind: CommandKind, stamps: Stamps, numbers: ArrayLike, is_void: ArrayLike = False
) -> list[CommandRows]:
    """
    Return commands, one group for each number of digits of the seconds.

    Parameters
    ----------
    kind
        what they are.
    stamps
        (N) of the states that they answer, in ns, not negative.
    numbers
        (N, n), one for each joint of the kind.
    is_void
        (N) or for all, whether they command nothing.

    """
    numbers = np.asarray(numbers)
    voids = np.broadcast_to(np.asarray(is_void, bool), len(numbers))
    paddings = np.array([np.frombuffer(each, np.uint8) for each in kind.paddings])
    seconds, nanoseconds = np.divmod(stamps, NANOSECONDS)
    lengths = np.char.str_len(seconds.astype(str))
    groups = []
    for length in np.unique(lengths).tolist():
        indices = np.flatnonzero(lengths == length)
        layout = kind.layout(length + 1 + NANOSECOND_DIGITS)
        rows = _rows(layout, len(indices))
        start = layout.digits.start
        rows[:, start:start + length] = _digits(seconds[indices], length)
        rows[:, start + length] = ord('.')
        rows[:, start + length + 1:layout.digits.stop] = _digits(
            nanoseconds[indices], NANOSECOND_DIGITS
        )
        rows[:, layout.padding] = paddings[voids[indices].astype(int)]
        _fill(rows, layout.data, numbers[indices])
        groups.append(CommandRows(indices, rows))
    return groups


def _digits(numbers: Stamps, count: int) -> Rows:
    """Return `numbers` (N) as `count` characters each, (N, count)."""
    powers = 10 ** np.arange(count - 1, -1, -1)
    return (numbers[:, None] // powers % 10 + ord('0')).astype(np.uint8)


def telemetry_rows(label: str, stamps: Stamps, values: ArrayLike) -> Rows:
    """
    Return telemetry messages called `label` as (N, size).

    Parameters
    ----------
    label
        what the values are.
    stamps
        (N) in ns.
    values
        (N, n).

    """
    values = np.asarray(values)
    layout = telemetry_layout(label, values.shape[1])
    rows = _rows(layout, len(stamps))
    _fill(rows, layout.data, np.column_stack((*np.divmod(stamps, NANOSECONDS), values)))
    return rows


def twist_rows(twists: ArrayLike) -> Rows:
    """Return twists as (N, size) of (N, 6): linear (m/s), then angular (rad/s)."""
    layout, linear = twist_layout()
    rows = _rows(layout, len(np.asarray(twists)))
    _fill(rows, linear, twists)
    return rows


def twist_stamped_rows(stamps: Stamps, twists: ArrayLike, frame_prefix: str = '') -> Rows:
    """
    Return stamped twists in `base_link` as (N, size); see `twist_rows`.

    Parameters
    ----------
    stamps
        (N) in ns.
    twists
        (N, 6).
    frame_prefix
        of the frame's name.

    """
    layout, linear = twist_stamped_layout(frame_prefix)
    rows = _rows(layout, len(stamps))
    _fill_stamps(rows, stamps)
    _fill(rows, linear, twists)
    return rows


def odometry_rows(
    stamps: Stamps, poses: ArrayLike, twists: ArrayLike, frame_prefix: str = ''
) -> Rows:
    """
    Return odometries with zero covariances as (N, size).

    Parameters
    ----------
    stamps
        (N) in ns.
    poses
        (N, 7) position in m and quaternion x, y, z, w of `base_link` in `odom`.
    twists
        (N, 6) linear (m/s), then angular (rad/s), in `base_link`.
    frame_prefix
        of the names of both frames.

    """
    layout, pose, twist = odometry_layout(frame_prefix)
    rows = _rows(layout, len(stamps))
    _fill_stamps(rows, stamps)
    _fill(rows, pose, poses)
    _fill(rows, twist, twists)
    return rows


def transforms_rows(
    stamps: Stamps,
    transforms: ArrayLike,
    frame_prefix: str = '',
    frames: Frames = DEFAULT.frames,
) -> Rows:
    """
    Return the transforms of all frames as (N, size).

    Parameters
    ----------
    stamps
        (N) in ns.
    transforms
        (N, frames, 7) translation in m and quaternion x, y, z, w.
    frame_prefix
        of the names of all frames.
    frames
        parent and child of each.

    """
    transforms = np.asarray(transforms)
    layout, stamp_offsets, number_offsets = transforms_layout(frame_prefix, frames)
    rows = _rows(layout, len(stamps))
    for frame, (stamp, number) in enumerate(zip(stamp_offsets, number_offsets, strict=True)):
        _fill_stamps(rows, stamps, stamp)
        _fill(rows, number, transforms[:, frame])
    return rows


def time_rows(stamps: Stamps) -> Rows:
    """Return times or clocks as (N, 12) of stamps (N) in ns."""
    rows = _rows(time_layout(), len(stamps))
    _fill_stamps(rows, stamps)
    return rows
