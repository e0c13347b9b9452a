# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions to the robot's state: joints by name, the base pose from joints or odometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES
from masmc_ros.messages.cdr_layout import checked_stamp, UNREAD
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import odometry_numbers
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.process.rejected_messages import RejectedMessages
from masmc_ros.numerics.aliases import Array
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
from masmc_ros.robot.joint_names import driven_joint_names, joint_names
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState


class StateInput:
    """Subscriptions to joint_states, and to odom with `pose_source` odom."""

    def __init__(
        self,
        node: Node,
        values: Mapping[str, Any],
        rejected_messages: RejectedMessages,
        on_state: Callable[[int, Array, Array], None],
    ) -> None:
        """
        Subscribe to the topics.

        Parameters
        ----------
        node
            Node of the subscriptions.
        values
            Current parameters of the controller, which may change. With `velocity_source`
            estimated a state needs no velocities.
        rejected_messages
            Counts of rejected messages.
        on_state
            Function that is called with the stamp in ns, positions and velocities of each state
            that is complete and finite. The next message overwrites these arrays.

        """
        self._values = values
        names = joint_names(values)
        self._state = JointStateCdr(names)
        # The first call compiles the kernel, or loads it.
        self._state.read(self._state.to_bytes())
        self._rejected_messages = rejected_messages
        self._on_state = on_state
        self._base = BasePose() if values['pose_source'] == 'odom' else None
        self._joints = names if self._base is None else driven_joint_names(values)
        self._is_waiting = False
        self._missing_pose: str | None = None
        if self._base is not None:
            subscribe_with_past(node, Odometry, 'odom', self._take_odometry)
        subscribe_with_past(node, JointState, 'joint_states', self._take)

    def _take(self, raw: bytes) -> None:
        if self._missing_pose is not None:
            self._rejected_messages.add('joint_states', self._missing_pose)
            self._missing_pose = None
        state = self._state
        stamp = state.read(raw)
        if stamp == UNREAD:
            try:
                stamp = self._read_any(raw, state)
            except InputError as error:
                self._is_waiting = False
                self._rejected_messages.add('joint_states', error)
                return
        if self._base is not None:
            self._add_pose(self._base, stamp)
        else:
            self._on_state(stamp, state.position, state.velocity)

    def _read_any(self, raw: bytes, state: JointStateCdr) -> int:
        """Read a message of any layout into a state; return its stamp in ns, or InputError."""
        unknown = 0.0 if self._values['velocity_source'] == SOURCES[ESTIMATED] else None
        message = deserialized(raw, JointState)
        state.load_message(message, self._joints, unknown_velocity=unknown)
        return state.stamp_ns

    def _add_pose(self, base: BasePose, stamp: int) -> None:
        """
        Pass on the state with its pose from odometry if one is available, otherwise wait.

        The odometry may arrive later: a missing pose is reported with the next state.
        """
        state = self._state
        pose_stamp = base.stamp_ns
        self._is_waiting = pose_stamp is None or abs(stamp - pose_stamp) > OLDEST_POSE_NS
        self._missing_pose = None
        if self._is_waiting:
            if pose_stamp is not None:
                self._missing_pose = f'odom is {(stamp - pose_stamp) * 1e-9:.3f} s older'
            return
        base.write(stamp, state.position, state.velocity)
        self._on_state(stamp, state.position, state.velocity)

    def _take_odometry(self, raw: bytes) -> None:
        base = self._base
        if base is None:
            return
        try:
            stamp, pose, twist = odometry_numbers(deserialized(raw, Odometry))
            base.update(checked_stamp(stamp), pose, twist)
        except InputError as error:
            self._rejected_messages.add('odom', error)
            return
        if self._is_waiting:
            self._add_pose(base, self._state.stamp_ns)
