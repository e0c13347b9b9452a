# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of deserialised messages, as far as this package reads them.

All deserialisers create such objects, that of ROS 2 or of an MCAP reader.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Time(Protocol):
    """builtin_interfaces/Time."""

    sec: int
    nanosec: int


class Header(Protocol):
    """std_msgs/Header."""

    stamp: Time


class JointState(Protocol):
    """sensor_msgs/JointState."""

    header: Header
    name: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]


class Dimension(Protocol):
    """std_msgs/MultiArrayDimension."""

    label: str
    size: int


class ArrayLayout(Protocol):
    """std_msgs/MultiArrayLayout."""

    dim: Sequence[Dimension]
    data_offset: int


class Float64MultiArray(Protocol):
    """std_msgs/Float64MultiArray."""

    layout: ArrayLayout
    data: Sequence[float]


class Vector3(Protocol):
    """geometry_msgs/Vector3 or Point."""

    x: float
    y: float
    z: float


class Quaternion(Vector3, Protocol):
    """geometry_msgs/Quaternion."""

    w: float


class Twist(Protocol):
    """geometry_msgs/Twist."""

    linear: Vector3
    angular: Vector3


class Pose(Protocol):
    """geometry_msgs/Pose."""

    position: Vector3
    orientation: Quaternion


class PoseWithCovariance(Protocol):
    """geometry_msgs/PoseWithCovariance."""

    pose: Pose


class TwistWithCovariance(Protocol):
    """geometry_msgs/TwistWithCovariance."""

    twist: Twist


class Odometry(Protocol):
    """nav_msgs/Odometry."""

    header: Header
    pose: PoseWithCovariance
    twist: TwistWithCovariance
