# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The state of the robot as it comes: joints by name, the platform's pose from either source."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.layout import checked_stamp, UNREAD
from masmc_ros.messages.platform_motion import odometry_numbers
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.numerics.aliases import Array
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
from masmc_ros.robot.joint_names import driven_joint_names, joint_names
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState


class StateInput:
    """Reads joint_states, and odom where the pose comes from there."""

    def __init__(
        self,
        node: Node,
        values: Mapping[str, Any],
        refusals: Refusals,
        on_state: Callable[[int, Array, Array], None],
    ) -> None:
        """
        Take every state that is complete and finite.

        `values` are the controller's current parameters, which may change: with
        `velocity_source` estimated a state needs no velocities. `on_state` is called with the
        stamp in ns, positions and velocities, which the next message overwrites.
        """
        self._values = values
        names = joint_names(values)
        self._state = JointStateCdr(names)
        # Compiled or loaded here, not at the first state.
        self._state.read(self._state.to_bytes())
        self._refusals = refusals
        self._on_state = on_state
        self._base = BasePose() if values['pose_source'] == 'odom' else None
        self._joints = names if self._base is None else driven_joint_names(values)
        self._is_waiting = False
        self._lacking: str | None = None
        if self._base is not None:
            subscribe_with_past(node, Odometry, 'odom', self._take_odometry)
        subscribe_with_past(node, JointState, 'joint_states', self._take)

    def _take(self, raw: bytes) -> None:
        if self._lacking is not None:
            self._refusals.add('joint_states', self._lacking)
            self._lacking = None
        state = self._state
        stamp = state.read(raw)
        if stamp == UNREAD:
            try:
                stamp = self._read_any(raw, state)
            except InputError as error:
                self._is_waiting = False
                self._refusals.add('joint_states', error)
                return
        if self._base is not None:
            self._add_pose(self._base, stamp)
        else:
            self._on_state(stamp, state.position, state.velocity)

    def _read_any(self, raw: bytes, state: JointStateCdr) -> int:
        """Read a message of any sender into a state; return its stamp in ns, or InputError."""
        unknown = 0.0 if self._values['velocity_source'] == SOURCES[ESTIMATED] else None
        message = deserialized(raw, JointState)
        state.load_message(message, self._joints, unknown_velocity=unknown)
        return state.stamp_ns

    def _add_pose(self, base: BasePose, stamp: int) -> None:
        """
        Take the state with its pose from odometry, once there is one for it.

        Its odometry may arrive later: an error is reported with the next state.
        """
        state = self._state
        posed = base.stamp_ns
        self._is_waiting = posed is None or abs(stamp - posed) > OLDEST_POSE_NS
        self._lacking = None
        if self._is_waiting:
            if posed is not None:
                self._lacking = f'odom is {(stamp - posed) * 1e-9:.3f} s older'
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
            self._refusals.add('odom', error)
            return
        if self._is_waiting:
            self._add_pose(base, self._state.stamp_ns)
