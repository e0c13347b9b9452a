# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of the platform and time: Twist, TwistStamped, Odometry, Clock and Time."""

from __future__ import annotations

from functools import cache

from masmc_ros.aliases import Array
from masmc_ros.messages import deserialised
from masmc_ros.messages.cdr_layout import Layout, NANOSECONDS
from masmc_ros.messages.message import Message, StampedMessage
from masmc_ros.robot.declaration import BASE_FRAME, ODOM_FRAME
import numpy as np


@cache
def time_layout() -> Layout:
    """Return the layout of rosgraph_msgs/Clock, which builtin_interfaces/Time shares."""
    return Layout('rosgraph_msgs/msg/Clock')


class TimeCdr(StampedMessage):
    """A builtin_interfaces/Time or rosgraph_msgs/Clock, which consists of a stamp."""

    def __init__(self) -> None:
        """Initialise the time 0."""
        super().__init__(time_layout())


def twist_numbers(twist: TwistCdr | TwistStampedCdr | deserialised.Twist) -> list[float]:
    """
    Return the six numbers of a twist, linear (m/s) and angular (rad/s), each x, y, z.

    `twist` is one of the classes here, or a geometry_msgs/Twist of any deserialiser.
    """
    if isinstance(twist, TwistCdr | TwistStampedCdr):
        return [*twist.linear.tolist(), *twist.angular.tolist()]
    return [getattr(part, c) for part in (twist.linear, twist.angular) for c in 'xyz']


def odometry_numbers(odometry: deserialised.Odometry) -> tuple[int, Array, Array]:
    """
    Return the stamp in ns, pose and twist of a nav_msgs/Odometry of any deserialiser.

    The pose is (7) position in m and quaternion x, y, z, w; the twist (6) as `twist_numbers`.
    """
    pose, stamp = odometry.pose.pose, odometry.header.stamp
    position = [getattr(pose.position, c) for c in 'xyz']
    orientation = [getattr(pose.orientation, c) for c in 'xyzw']
    return (
        stamp.sec * NANOSECONDS + stamp.nanosec,
        np.array([*position, *orientation]),
        np.array(twist_numbers(odometry.twist.twist)),
    )


@cache
def twist_layout() -> Layout:
    """Return the layout of geometry_msgs/Twist."""
    return Layout('geometry_msgs/msg/Twist')


class TwistCdr(Message):
    """
    A geometry_msgs/Twist whose numbers are views into the message.

    Attributes
    ----------
    linear
        (3) velocity in m/s, x forward.
    angular
        (3) rate in rad/s, z up, counter-clockwise positive.

    """

    def __init__(self) -> None:
        """Initialise a twist of zeros."""
        super().__init__(twist_layout())
        self.linear, self.angular = np.split(self._record['numbers'], 2)


@cache
def twist_stamped_layout(frame_prefix: str = '', frame: str = BASE_FRAME) -> Layout:
    """Return the layout of geometry_msgs/TwistStamped in the base's frame, with a prefix."""
    contents = {'header': {'frame_id': frame_prefix + frame}}
    return Layout('geometry_msgs/msg/TwistStamped', contents)


class TwistStampedCdr(StampedMessage):
    """
    A geometry_msgs/TwistStamped in `base_link` whose numbers are views into the message.

    Attributes
    ----------
    linear
        (3) velocity in m/s, x forward.
    angular
        (3) rate in rad/s, z up, counter-clockwise positive.

    """

    def __init__(self, frame_prefix: str = '', frame: str = BASE_FRAME) -> None:
        """Initialise a twist of zeros at time 0, in the base's frame."""
        super().__init__(twist_stamped_layout(frame_prefix, frame))
        self.linear, self.angular = np.split(self._record['twist'], 2)


@cache
def odometry_layout(frame_prefix: str = '', frame: str = BASE_FRAME) -> Layout:
    """Return the layout of nav_msgs/Odometry from `odom` to the base's frame, with a prefix."""
    header = {'frame_id': frame_prefix + ODOM_FRAME}
    contents = {'header': header, 'child_frame_id': frame_prefix + frame}
    return Layout('nav_msgs/msg/Odometry', contents)


class OdometryCdr(StampedMessage):
    """
    A nav_msgs/Odometry of the platform whose numbers are views into the message.

    Attributes
    ----------
    position
        (3) of `base_link` in `odom`, m.
    orientation
        (4) of `base_link` in `odom`, quaternion x, y, z, w.
    pose_covariance
        (36) rows of x, y, z in m and the rotations about them in rad.
    linear
        (3) velocity in `base_link`, m/s.
    angular
        (3) rate in `base_link`, rad/s.
    twist_covariance
        (36) rows of the same axes, in m/s and rad/s.

    """

    def __init__(self, frame_prefix: str = '', frame: str = BASE_FRAME) -> None:
        """Initialise an odometry at the origin, at rest, at time 0."""
        super().__init__(odometry_layout(frame_prefix, frame))
        record = self._record
        self.position, self.orientation = np.split(record['pose_pose'], [3])
        self.linear, self.angular = np.split(record['twist_twist'], 2)
        self.pose_covariance = record['pose_covariance']
        self.twist_covariance = record['twist_covariance']
        self.orientation[3] = 1.0
