# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Pose of the platform from odometry, and its commanded velocities, in logs.

The pose is for states that have the driven joints only.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from masmc_ros.errors import InputError
from masmc_ros.log.read.decode import message_decoder, NO_TIME, Series, Topic
from masmc_ros.log.read.timeline import PassStart
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.platform_messages import (
    odometry_numbers,
    twist_numbers,
    TwistCdr,
    TwistStampedCdr,
)
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import TWIST_STAMPED
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
import numpy as np


def twists(topic: Topic, joint_commands: Series | None, places: Sequence[int]) -> Series:
    """
    Read the numbers of twists in m/s and rad/s.

    A plain twist has no stamp, and its time of arrival in a recording may differ by a tick. The
    controller sends one before every command for the other joints, so twists and commands with
    the same number belong together. If their numbers differ, log times are used.

    Parameters
    ----------
    topic
        messages of either type, in the order of the log.
    joint_commands
        all commands for the other joints in the same order; None if the log has none.
    places
        (n) places of the numbers in a twist: linear x, y, z, then angular.

    Returns
    -------
        (N, n) finite twists, with the stamps of the answered states.

    """
    is_stamped = topic.schema is not None and topic.schema.name == TWIST_STAMPED
    message: TwistStampedCdr | TwistCdr = TwistStampedCdr() if is_stamped else TwistCdr()
    stamps, values, orders = [], [], []
    make = None
    messages = zip(topic.log_times, topic.messages, topic.orders, strict=True)
    for log_time, raw, order in messages:
        # Errors other than InputError: the definition in the log is that of another type.
        with suppress(InputError, AttributeError, TypeError, ValueError):
            twist, stamp = message, log_time
            if not message.load(raw):
                make = make or message_decoder(topic)
                twist = make(raw)
            if is_stamped:
                stamp = header_stamp(raw)
                twist = getattr(twist, 'twist', twist)
            numbers = np.array([float(number) for number in twist_numbers(twist)])
            if np.isfinite(numbers).all() and (is_stamped or log_time != NO_TIME):
                stamps.append(stamp)
                values.append(numbers[list(places)])
                orders.append(order)
    if not is_stamped and joint_commands is not None and len(joint_commands) == len(stamps):
        stamps = joint_commands.stamps.tolist()
    return Series(
        np.array(stamps, np.int64),
        np.array(values).reshape(len(values), len(places)),
        np.array(orders, np.int64),
    )


def with_platform_pose(states: Series, odometry: Topic, pass_start: PassStart) -> Series:
    """
    Add the platform's pose to states, as a controller with `pose_source: odom`.

    Parameters
    ----------
    states
        (N, 3 n) positions, velocities and efforts; stamps ascend.
    odometry
        messages of nav_msgs/Odometry; those that a controller rejects are ignored.
    pass_start
        start of the last pass; earlier poses are void from its first stamp on.

    Returns
    -------
        The states with a pose of nearly the same time.

    Raises
    ------
    InputError
        if no state has one, or if odometry cannot be decoded.

    """
    decode = message_decoder(odometry)
    poses, orders = [], []
    for raw, order in zip(odometry.messages, odometry.orders, strict=True):
        with suppress(InputError, AttributeError, TypeError, ValueError, OverflowError):
            stamp, pose, twist = odometry_numbers(decode(raw))
            poses.append((checked_stamp(stamp), pose, twist))
            orders.append(order)
    stamps = np.array([stamp for stamp, _, _ in poses], np.int64)
    kept = pass_start.kept(np.array(orders, np.int64), stamps)
    waiting = [poses[index] for index in reversed(kept.tolist())]
    base, values = BasePose(), states.values.copy()
    posed = np.zeros(len(states.stamps), bool)
    for index, stamp in enumerate(states.stamps.tolist()):
        # The latest pose; before the first pose, the first.
        while waiting and (base.stamp_ns is None or waiting[-1][0] <= stamp):
            with suppress(InputError):
                base.update(*waiting.pop())
        if base.stamp_ns is not None:
            posed[index] = abs(stamp - base.stamp_ns) <= OLDEST_POSE_NS
            base.write(stamp, values[index], values[index, values.shape[1] // 3:])
    if not posed.any():
        raise InputError(
            f'{odometry.name}: nothing within {OLDEST_POSE_NS * 1e-9:g} s of a joint state, and'
            ' these have no base joints'
        )
    return Series(states.stamps[posed], values[posed])
