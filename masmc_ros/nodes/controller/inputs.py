# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions of the controller to states, odometry and references."""

from __future__ import annotations

from collections.abc import Callable
import math
import time

from masmc_ros.aliases import Array
from masmc_ros.control.gates import StateSources
from masmc_ros.errors import InputError
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES, VELOCITY_SOURCE
from masmc_ros.loop.controller_parameters import POSE_FRAME, POSE_SOURCE
from masmc_ros.messages.cdr_layout import checked_stamp, UNREAD
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import odometry_numbers
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import REFERENCE_TOPIC, TRANSFORMS
from masmc_ros.messages.transforms import transforms_of
from masmc_ros.nodes.middleware.ros_topics import (
    deserialized,
    raw_class,
    subscribe_with_past,
    subscription_qos,
)
from masmc_ros.nodes.process.base import RejectedMessages, senders_text, several_senders
from masmc_ros.params.declaration import Values
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
from masmc_ros.robot.dead_reckoning import DeadReckoning
from masmc_ros.robot.mechanisms import driven_joint_names, joint_names
from masmc_ros.robot.robot import Robot
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

_OLDEST_TRANSFORM = 2.0
"""Longest time in s without a transform on /tf; those on /tf_static never expire."""

_STATES, _ODOM = 'joint_states', 'odom'


class StateInput:
    """Subscriptions to joint_states, and to odom and tf with `pose_source` odom."""

    def __init__(
        self,
        node: Node,
        values: Values,
        robot: Robot,
        rejected_messages: RejectedMessages,
        on_state: Callable[[int, Array, Array], None],
        on_jump: Callable[[], None],
        on_mixed: Callable[[str], bool],
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
        robot
            Robot of the controller, whose wheels move the base between two odometry messages.
        rejected_messages
            Counts of rejected messages.
        on_state
            Function that is called with the stamp in ns, positions and velocities of each state
            that is complete and finite. The next message overwrites these arrays.
        on_jump
            Function that is called before the first state after a jump of the pose.
        on_mixed
            Function that is called with the names of the nodes if states come from two robots.
            It returns True if such states are not used.

        """
        self._values = values
        names = joint_names(values)
        self._state = JointStateCdr(names)
        # The first call compiles the kernel, or loads it.
        self._state.read(self._state.to_bytes())
        self._rejected_messages = rejected_messages
        self._on_state, self._on_jump, self._on_mixed = on_state, on_jump, on_mixed
        self._on_usable = on_state
        self._node = node
        self._sources = StateSources(len(self._state.position))
        self._named: dict[str, list[str]] = {}
        self._base: BasePose | None = None
        self._reckoning: DeadReckoning | None = None
        self._joints, self._moves_freely = names, False
        self._driven = driven_joint_names(values)
        self._is_fixed = not robot.mechanism.twist
        self._is_waiting = False
        self._missing_pose: str | None = None
        self._frame = POSE_FRAME.of(values)
        self._odom_frame = ''
        # Transform to each frame of odometry, and its time of arrival; infinite if it is static.
        self._transforms: dict[str, tuple[Array, float]] = {}
        if POSE_SOURCE.of(values) == _ODOM:
            self._joints = self._driven
            kind = robot.mechanism
            # An omnidirectional base has no joints: its twist stands for theirs.
            self._moves_freely = kind.joints[0].unit == 'm'
            if self._moves_freely:
                self._joints = self._joints[len(kind.twist):]
            else:
                self._reckoning = DeadReckoning(robot)
                # The first motion compiles the kernel, or loads it.
                for stamp in range(2):
                    self._reckoning.add(stamp, self._state.position)
            self._base = BasePose(self._reckoning)
            subscribe_with_past(
                node, Odometry, _ODOM, self._take_odometry, on_matched=self.check_sources
            )
            if self._frame:
                message_type = raw_class(TRANSFORMS.type_name)
                # The next transform replaces a lost one.
                qos = subscription_qos(depth=100, best_effort=True)
                node.create_subscription(message_type, '/tf', self._take_transforms, qos, raw=True)
                subscribe_with_past(node, message_type, '/tf_static', self._take_static, 100)
        subscribe_with_past(
            node, JointState, _STATES, self._take, on_matched=self.check_sources
        )

    @property
    def missing(self) -> str:
        """Return the source without which states are not complete."""
        if self._is_waiting and self._base is not None:
            return self._missing_source(self._base, self._state.stamp_ns) or _STATES
        return _STATES

    @property
    def effort(self) -> Array:
        """Return the array of the efforts in the last state, with the driven joints last."""
        return self._state.effort

    def check_sources(self) -> str:
        """
        Return the topics with more than one publisher and their nodes, '' for none.

        To be called rarely. Only meanwhile each state is compared with the previous one.
        """
        topics = [_STATES] if self._base is None else [_STATES, _ODOM]
        self._named = several_senders(self._node, topics)
        if self._named:
            self._on_state = self._compare
        elif self._on_state != self._on_usable:
            self._on_state = self._on_usable
            self._sources.restart()
        return senders_text(self._named)

    def _compare(self, stamp: int, position: Array, velocity: Array) -> None:
        """Pass on a state unless states come from two robots."""
        self._sources.add(stamp, position, velocity, time.monotonic())
        if self._sources.are_mixed and self._on_mixed(senders_text(self._named)):
            self._rejected_messages.add(
                _STATES, f'states of two robots: {senders_text(self._named)}; stop one of them'
            )
            return
        self._on_usable(stamp, position, velocity)

    def _take(self, raw: bytes) -> None:
        if self._missing_pose is not None:
            self._rejected_messages.add(_STATES, self._missing_pose)
            self._missing_pose = None
        state = self._state
        # A message in the layout of all joints contains a pose, which is not used with odom.
        stamp = UNREAD if self._moves_freely else state.read(raw)
        if stamp == UNREAD:
            try:
                stamp = self._read_any(raw, state)
            except InputError as error:
                self._is_waiting = False
                self._rejected_messages.add(_STATES, error)
                return
        if self._base is not None:
            if self._reckoning is not None:
                self._reckoning.add(stamp, state.position)
            self._add_pose(self._base, stamp)
        else:
            self._on_state(stamp, state.position, state.velocity)

    def _read_any(self, raw: bytes, state: JointStateCdr) -> int:
        """Read a message of any layout into a state; return its stamp in ns, or InputError."""
        unknown = 0.0 if self._values[VELOCITY_SOURCE.name] == SOURCES[ESTIMATED] else None
        message = deserialized(raw, JointState)
        joints = self._joints
        # The driver of an arm on a table publishes no pose of its base, which is then zero.
        if self._is_fixed and joints[0] not in message.name:
            joints = self._driven
        state.load_message(message, joints, unknown_velocity=unknown)
        return state.stamp_ns

    def _missing_source(self, base: BasePose, stamp: int) -> str:
        """Return the source that is missing or too old for a state; empty if none is."""
        if base.stamp_ns is None or abs(stamp - base.stamp_ns) > OLDEST_POSE_NS:
            return _ODOM
        _, arrival = self._transforms.get(self._odom_frame, (None, -math.inf))
        if self._frame and time.monotonic() - arrival > _OLDEST_TRANSFORM:
            return f'/tf ({self._frame} to {self._odom_frame})'
        return ''

    def _add_pose(self, base: BasePose, stamp: int) -> None:
        """
        Pass on the state with its pose from odometry if one is available, otherwise wait.

        The odometry may arrive later: a missing pose is reported with the next state.
        """
        state = self._state
        missing = self._missing_source(base, stamp)
        self._is_waiting, self._missing_pose = bool(missing), None
        if missing:
            if missing != _ODOM:
                self._missing_pose = f'no transform on {missing}'
            elif base.stamp_ns is not None:
                self._missing_pose = f'odom is {(stamp - base.stamp_ns) * 1e-9:.3f} s older'
            return
        base.write(stamp, state.position, state.velocity)
        if self._moves_freely:
            base.write_motion(stamp, state.position, state.velocity)
        if base.has_jumped:
            base.has_jumped = False
            self._on_jump()
        self._on_state(stamp, state.position, state.velocity)

    def _take_odometry(self, raw: bytes) -> None:
        base = self._base
        if base is None:
            return
        try:
            message = deserialized(raw, Odometry)
            stamp, pose, twist = odometry_numbers(message)
            base.update(checked_stamp(stamp), pose, twist)
        except InputError as error:
            self._rejected_messages.add(_ODOM, error)
            return
        frame = message.header.frame_id.lstrip('/')
        if frame != self._odom_frame:
            self._odom_frame = frame
            self._correct(base)
        if self._is_waiting:
            self._add_pose(base, self._state.stamp_ns)

    def _take_static(self, raw: bytes) -> None:
        self._take_transforms(raw, expires=False)

    def _take_transforms(self, raw: bytes, *, expires: bool = True) -> None:
        """Use the transform from the frame of the path to that of the odometry."""
        try:
            for parent, child, numbers in transforms_of(raw):
                if parent.lstrip('/') == self._frame:
                    arrival = time.monotonic() if expires else math.inf
                    self._transforms[child.lstrip('/')] = numbers, arrival
                    if self._base is not None and child.lstrip('/') == self._odom_frame:
                        self._correct(self._base)
        except InputError as error:
            self._rejected_messages.add('tf', error)

    def _correct(self, base: BasePose) -> None:
        """Move the frame of the odometry by the last transform to it."""
        if self._odom_frame in self._transforms:
            base.correct(self._transforms[self._odom_frame][0])


class ReferenceInput:
    """Subscription to the reference topic."""

    def __init__(
        self,
        node: Node,
        axes: int,
        rejected_messages: RejectedMessages,
        on_reference: Callable[[ReferenceWindow], None],
    ) -> None:
        """
        Subscribe to the topic.

        Parameters
        ----------
        node
            Node of the subscription.
        axes
            Number of task axes.
        rejected_messages
            Counts of rejected messages.
        on_reference
            Function that is called with each window; its InputError rejects the message.

        """
        self._axes = axes
        self._rejected_messages = rejected_messages
        self._on_reference = on_reference
        subscribe_with_past(node, Float64MultiArray, REFERENCE_TOPIC, self._take, depth=100)

    def _take(self, raw: bytes) -> None:
        try:
            window = ReferenceWindow.from_bytes(raw, self._axes)
            if window is None:
                message = deserialized(raw, Float64MultiArray)
                window = ReferenceWindow.from_message(message, self._axes)
            self._on_reference(window)
        except InputError as error:
            self._rejected_messages.add(REFERENCE_TOPIC, error)
