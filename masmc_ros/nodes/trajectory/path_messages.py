# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Translation of messages with paths: trajectories of joints and frames, Path, poses and twists.

Everything that does not depend on the state of the robot is checked here. Errors are an InputError
of one line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
import struct
from typing import NamedTuple

from geometry_msgs.msg import Point, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, suggestion
from masmc_ros.messages.cdr_layout import checked_stamp, ENCAPSULATION, NANOSECONDS, STAMP
from masmc_ros.messages.transforms import moved
from masmc_ros.nodes.middleware.ros_topics import deserialized
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import PosePoints, TwistPoints
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.declaration import BASE_FRAME, Mechanism, ODOM_FRAME
from nav_msgs.msg import Path
import numpy as np
from std_msgs.msg import Header
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

_MOST_POINTS = 10_000
"""Largest number of points; the node sends no samples while rclpy reads them, up to 1 s."""

_MOST_BYTES = 10_000_000
"""Largest size of a message."""

_NUMBER = struct.Struct('<I')


class MissingTransformError(InputError):
    """
    Poses in a frame whose transform to that of the path is not known yet.

    Attributes
    ----------
    frame, target
        Names of the frame, and of that of the path.

    """

    def __init__(self, frame: str, target: str) -> None:
        """Initialise the error of a frame and that of the path."""
        super().__init__(
            f"frame_id = '{frame}': no transform to '{target}' on /tf or /tf_static; expected one,"
            f" or poses in '{target}'"
        )
        self.frame, self.target = frame, target


class PathRequest(NamedTuple):
    """
    Path of a message, or of changed parameters.

    Attributes
    ----------
    topic
        Topic of the message, relative to the robot; `type` for parameters.
    points
        Points of the path, or the trajectory of the parameters; None to stop.
    stamp_ns
        Stamp in ns of time 0 of the path; None for the earliest possible one.

    """

    topic: str
    points: JointPoints | PosePoints | TwistPoints | Trajectory | None
    stamp_ns: int | None

    @property
    def is_command(self) -> bool:
        """Return True for velocities, which are sent many times a second."""
        return isinstance(self.points, TwistPoints)

    @property
    def text(self) -> str:
        """Return the content in a few words."""
        if self.points is None:
            return 'a stop'
        if isinstance(self.points, TwistPoints):
            return 'velocities of the base'
        if isinstance(self.points, Trajectory):
            return f'the trajectory {self.points.kind}'
        if isinstance(self.points, PosePoints):
            count = len(self.points.positions)
            return _counted(count, 'pose')
        count, joints = self.points.positions.shape
        return f'{_counted(count, "point")} of {_counted(joints, "joint")}'


def _counted(count: int, noun: str) -> str:
    return f'{count} {noun}' if count == 1 else f'{count} {noun}s'


class PathMessages:
    """Reader of the messages of all topics with paths, for one robot."""

    def __init__(
        self,
        mechanism: Mechanism,
        names: Sequence[str],
        frame_prefix: str,
        frame: str = '',
        pose_of: Callable[[str, str], Array | None] = lambda *_: None,
    ) -> None:
        """
        Initialise the reader.

        Parameters
        ----------
        mechanism
            Type of the robot.
        names
            Names of the joints in the order of a joint state.
        frame_prefix
            Prefix of the names of the robot's frames.
        frame
            Frame of the path; empty: that of odometry.
        pose_of
            Function that returns the pose (7) of a frame in another one, None if it is unknown.

        """
        self._mechanism, self._names = mechanism, tuple(names)
        self._pose_of = pose_of
        odom, self._base_frame, self._tip_frame = (
            frame_prefix + name
            for name in (ODOM_FRAME, BASE_FRAME, mechanism.point_frame or mechanism.frames[-1][1])
        )
        self._frame = frame or odom
        base, drives = len(mechanism.base), len(mechanism.twist)
        # The pose of a mobile base replaces the positions of its drives.
        self._places = [*(range(base) if drives else ()), *range(base + drives, len(names))]
        self._drives = self._names[base:base + drives]

    @property
    def topics(self) -> Mapping[str, tuple[type, Callable[[str, bytes], PathRequest]]]:
        """Return the type of each topic and the reader of its messages."""
        return {
            'trajectory/joint_trajectory': (JointTrajectory, self._joint_trajectory),
            'trajectory/multi_dof_trajectory': (
                MultiDOFJointTrajectory, self._multi_dof_trajectory
            ),
            'trajectory/path': (Path, self._path),
            'trajectory/base_path': (Path, self._path),
            'trajectory/goal': (PoseStamped, self._goal),
            'trajectory/base_goal': (PoseStamped, self._goal),
            'reference/cmd_vel': (Twist, self._twist),
            'reference/cmd_vel_stamped': (TwistStamped, self._stamped_twist),
        }

    def _joint_trajectory(self, topic: str, raw: bytes) -> PathRequest:
        _check_size(raw, with_names=True)
        message = deserialized(raw, JointTrajectory)
        stamp = _stamp(message.header)
        if not message.points:
            return PathRequest(topic, None, None)
        columns = self._columns(message.joint_names)
        points = message.points
        positions = _numbers([p.positions for p in points], len(columns), 'positions')
        if positions is None:
            raise InputError('no positions; expected one for each joint in every point')
        velocities = _numbers([p.velocities for p in points], len(columns), 'velocities')
        accelerations = _numbers([p.accelerations for p in points], len(columns), 'accelerations')
        if accelerations is not None and velocities is None:
            raise InputError('accelerations without velocities; expected both')
        path = JointPoints(columns, _times(points), positions, velocities, accelerations)
        path.check()
        return PathRequest(topic, path, stamp)

    def _multi_dof_trajectory(self, topic: str, raw: bytes) -> PathRequest:
        _check_size(raw, with_names=True)
        message = deserialized(raw, MultiDOFJointTrajectory)
        if not message.points:
            return PathRequest(topic, None, None)
        transform = self._transform([message.header])
        names, known = list(message.joint_names), (self._base_frame, self._tip_frame)
        if len(names) != 1 or names[0] not in known:
            raise InputError(
                f'joint_names = {names}: expected the base or the end effector, '
                f"['{known[0]}'] or ['{known[1]}']"
            )
        for number, point in enumerate(message.points, 1):
            if len(point.transforms) != 1:
                raise InputError(
                    f'point {number} has {len(point.transforms)} transforms; expected one'
                )
        times = _times(message.points)
        if times[0] < 0.0:
            raise InputError(f'point 1 is at {times[0]:g} s; expected times from 0 s on')
        transforms = [point.transforms[0] for point in message.points]
        poses = np.array([_pose(t.translation, t.rotation) for t in transforms])
        points = self._pose_points(names[0] == self._base_frame, poses, times, transform)
        return PathRequest(topic, points, _stamp(message.header))

    def _columns(self, names: Sequence[str]) -> np.ndarray:
        """Return the indices of joints among the positions of a joint state."""
        known = [self._names[place] for place in self._places]
        for name in names:
            if name in self._drives:
                raise InputError(
                    f"'{name}' drives the base; expected the pose of the base, "
                    f'{", ".join(self._names[:len(self._mechanism.base)])}'
                )
            if name not in known:
                raise InputError(f"unknown joint '{name}'; {suggestion(name, known)}")
            if list(names).count(name) > 1:
                raise InputError(f"joint '{name}' is named twice; expected each joint once")
        if not names:
            raise InputError(f'no joint_names; expected some of {", ".join(known)}')
        return np.array([self._names.index(name) for name in names])

    def _path(self, topic: str, raw: bytes) -> PathRequest:
        _check_size(raw, with_names=False)
        message = deserialized(raw, Path)
        if not message.poses:
            return PathRequest(topic, None, None)
        transform = self._transform([message.header, *(p.header for p in message.poses)])
        stamps = np.array([_stamp(pose.header) or 0 for pose in message.poses], dtype=np.int64)
        if (stamps == stamps[0]).all():
            # Planners of paths without times stamp them with the time of planning.
            return self._poses(topic, message.poses, None, None, transform)
        times = (stamps - stamps[0]) / NANOSECONDS
        return self._poses(topic, message.poses, times, int(stamps[0]) or None, transform)

    def _goal(self, topic: str, raw: bytes) -> PathRequest:
        message = deserialized(raw, PoseStamped)
        return self._poses(topic, [message], None, None, self._transform([message.header]))

    def _twist(self, topic: str, raw: bytes) -> PathRequest:
        return self._velocities(topic, deserialized(raw, Twist))

    def _stamped_twist(self, topic: str, raw: bytes) -> PathRequest:
        message = deserialized(raw, TwistStamped)
        frame = message.header.frame_id.lstrip('/')
        if frame not in ('', self._base_frame):
            raise InputError(
                f"frame_id = '{frame}': velocities are those of the base in its frame; expected "
                f"'{self._base_frame}'"
            )
        return self._velocities(topic, message.twist)

    def _velocities(self, topic: str, twist: Twist) -> PathRequest:
        points = TwistPoints(twist.linear.x, twist.linear.y, twist.angular.z)
        points.check(self._mechanism)
        return PathRequest(topic, points, None)

    def _poses(
        self,
        topic: str,
        poses: Sequence[PoseStamped],
        times: np.ndarray | None,
        stamp: int | None,
        transform: Array | None,
    ) -> PathRequest:
        numbers = np.array([_pose(p.pose.position, p.pose.orientation) for p in poses])
        of_base = topic.rpartition('/')[2].startswith('base_')
        return PathRequest(topic, self._pose_points(of_base, numbers, times, transform), stamp)

    def _pose_points(
        self, of_base: bool, poses: Array, times: np.ndarray | None, transform: Array | None
    ) -> PosePoints:
        """Return checked points of poses (n, 7), moved by a transform (7) to the path's frame."""
        points = PosePoints(of_base, poses[:, :3], poses[:, 3:], times)
        points.check(self._mechanism)
        if transform is None:
            return points
        poses = moved(transform, poses)
        return PosePoints(of_base, poses[:, :3], poses[:, 3:], times)

    def _transform(self, headers: Sequence[Header]) -> Array | None:
        """
        Return the pose (7) of the frame of headers in that of the path; None for the same frame.

        An empty name stands for the frame of the path. Raises MissingTransformError, and
        InputError for several frames.
        """
        frames = dict.fromkeys(header.frame_id.lstrip('/') for header in headers)
        frames.pop('', None)
        if len(frames) > 1:
            raise InputError(f"frame_id {' and '.join(map(repr, frames))}; expected one frame")
        frame = next(iter(frames), self._frame)
        if frame == self._frame:
            return None
        transform = self._pose_of(frame, self._frame)
        if transform is None:
            raise MissingTransformError(frame, self._frame)
        return transform


def _stamp(header: Header) -> int | None:
    """Return the stamp in ns of a header, None for zero; InputError if it is invalid."""
    return checked_stamp(header.stamp.sec * NANOSECONDS + header.stamp.nanosec) or None


def _times(
    points: Sequence[JointTrajectoryPoint | MultiDOFJointTrajectoryPoint],
) -> np.ndarray:
    """Return the times (n) in s of points."""
    times = (point.time_from_start for point in points)
    return np.array([time.sec + time.nanosec / NANOSECONDS for time in times])


def _pose(position: Point | Vector3, rotation: Quaternion) -> tuple[float, ...]:
    """Return the position x, y, z, and the quaternion x, y, z, w."""
    return position.x, position.y, position.z, rotation.x, rotation.y, rotation.z, rotation.w


def _numbers(rows: Sequence[Sequence[float]], count: int, field: str) -> np.ndarray | None:
    """Return an array (n, count) of a field of all points; None if all are empty."""
    sizes = {len(row) for row in rows}
    if sizes == {0}:
        return None
    if sizes != {count}:
        point = next(k for k, row in enumerate(rows) if len(row) != count)
        raise InputError(
            f'point {point + 1} has {len(rows[point])} {field} for {count} joints; expected one '
            'for each joint in every point' + ('' if field == 'positions' else ', or none at all')
        )
    # Faster than an array of arrays by a factor of four.
    flat = np.fromiter(chain.from_iterable(rows), np.float64, len(rows) * count)
    return flat.reshape(len(rows), count)


def _check_size(raw: bytes, *, with_names: bool) -> None:
    """Raise InputError for more points or bytes than the limits, before they are read."""
    if len(raw) > _MOST_BYTES:
        raise InputError(f'{len(raw)} bytes; expected at most {_MOST_BYTES}')
    count = _point_count(raw, with_names=with_names)
    if count > _MOST_POINTS:
        raise InputError(
            f'{count} points; expected at most {_MOST_POINTS}, such as every tenth point, since '
            'the path is interpolated'
        )


def _point_count(raw: bytes, *, with_names: bool) -> int:
    """Return the number of points of a serialised message; 0 if it cannot be read."""
    body = memoryview(raw)[len(ENCAPSULATION):]

    def number(at: int) -> tuple[int, int]:
        """Return the next number, and the place after it."""
        at += -at % _NUMBER.size
        return int(_NUMBER.unpack_from(body, at)[0]), at + _NUMBER.size

    try:
        size, at = number(STAMP.size)
        names, after = number(at + size)
        if not with_names:
            return names
        for _ in range(names):
            size, at = number(after)
            after = at + size
        return number(after)[0]
    except struct.error:
        return 0
