# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pose of the platform from odometry, for states that have the driven joints only."""

from __future__ import annotations

from contextlib import suppress

from masmc_ros.errors import InputError
from masmc_ros.log.read.contents import Topic
from masmc_ros.log.read.decode import message_decoder, Series
from masmc_ros.log.read.timeline import PassStart
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.platform_messages import odometry_numbers
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
import numpy as np


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
