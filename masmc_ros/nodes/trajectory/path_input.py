# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions to messages with paths, and to the state of the robot at which a path starts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.loop.controller_parameters import POSE_FRAME
from masmc_ros.messages.cdr_layout import checked_stamp, UNREAD
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import odometry_numbers
from masmc_ros.messages.topics import TRANSFORMS
from masmc_ros.messages.transforms import FrameTree
from masmc_ros.nodes.middleware.ros_topics import (
    deserialized,
    raw_class,
    subscribe,
    subscribe_with_past,
)
from masmc_ros.nodes.process.base import Health, OK, SuiteNode, WARN
from masmc_ros.nodes.trajectory.path_messages import (
    MissingTransformError,
    PathMessages,
    PathRequest,
)
from masmc_ros.robot.base_pose import BasePose, OLDEST_POSE_NS
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import joint_names
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

_STATES = 'joint_states'

_JOINTS = 'trajectory/joint_trajectory'

_PATIENCE = 2.0
"""Longest time in s from a message with poses in another frame to a transform of that frame."""


class _Waiting(NamedTuple):
    """Message that waits for a transform, with the error that it is rejected with."""

    topic: str
    read: Callable[[str, bytes], PathRequest]
    raw: bytes
    error: MissingTransformError


class PathInput:
    """Subscriptions of the trajectory node to paths; rejections are counted for diagnostics."""

    def __init__(
        self,
        node: SuiteNode,
        mechanism: Mechanism,
        frame_prefix: str,
        on_path: Callable[[PathRequest], None],
        on_state: Callable[[int, Array], None],
    ) -> None:
        """
        Subscribe to the topics of paths.

        Parameters
        ----------
        node
            Trajectory node.
        mechanism
            Type of its robot.
        frame_prefix
            Prefix of the names of its frames.
        on_path
            Function that is called with each valid path; an InputError rejects it.
        on_state
            Function that is called with the stamp in ns and the positions of each state, from
            the first path on. The next message overwrites the positions.

        """
        self._node, self._on_path, self._on_state = node, on_path, on_state
        names = joint_names(node.values)
        self._state = JointStateCdr(names)
        self._base_joint = names[0]
        self._mechanism = mechanism
        # The pose of the base replaces the positions of its drives.
        self._driven = names[len(mechanism.base) + len(mechanism.twist):]
        self._base: BasePose | None = None
        self._has_states = False
        self._accepted = self._rejected = self._reported = 0
        self._last = ''
        self._frames: FrameTree | None = None
        self._waiting: _Waiting | None = None
        self._end_of_patience: Timer | None = None
        messages = PathMessages(
            mechanism, names, frame_prefix, POSE_FRAME.of(node.values).lstrip('/'), self._pose_of
        )
        self._topics = messages.topics
        for topic, (kind, read) in self._topics.items():
            subscribe(node.node, kind, topic, partial(self._take, topic, read))

    def reject(self, topic: str, reason: object) -> None:
        """Log and count a rejected message."""
        self._rejected += 1
        self._last = f'{topic} rejected: {reason}'
        self._node.log.warning(self._last)

    def accept(self) -> None:
        """Count a path that has started."""
        self._accepted += 1

    def read_joints(self, topic: str, trajectory: JointTrajectory) -> PathRequest:
        """Return the path of a trajectory of joints from a topic; may raise InputError."""
        _, read = self._topics[_JOINTS]
        return read(topic, serialize_message(trajectory))

    def health(self, followed: str) -> Health:
        """Return the report for /diagnostics; `followed` is the current source of the path."""
        is_worse, self._reported = self._rejected > self._reported, self._rejected
        values = {
            'reference': followed,
            'paths followed': str(self._accepted),
            'paths rejected': str(self._rejected),
            'last rejected path': self._last or 'none',
        }
        return Health(WARN, self._last, values) if is_worse else Health(OK, followed, values)

    def _take(
        self, topic: str, read: Callable[[str, bytes], PathRequest], raw: bytes
    ) -> None:
        # The latest path counts.
        self._reject_waiting()
        try:
            self._on_path(read(topic, raw))
        except MissingTransformError as error:
            self._waiting = _Waiting(topic, read, raw, error)
            self._await_transform()
        except InputError as error:
            self.reject(topic, error)
        else:
            self.follow_states()

    def _await_transform(self) -> None:
        """Take the waiting path again with the next transforms, and reject it after _PATIENCE."""
        self._end_of_patience = self._node.node.create_timer(
            _PATIENCE, self._reject_waiting, clock=self._node.steady
        )
        # Transforms are not needed, and cost time, as long as paths are in the frame of odometry.
        if self._frames is None:
            self._frames = FrameTree()
            kind = raw_class(TRANSFORMS.type_name)
            subscribe(self._node.node, kind, '/tf', self._take_transforms, depth=100)
            subscribe_with_past(
                self._node.node, kind, '/tf_static', self._take_static, depth=100
            )

    def _take_static(self, raw: bytes) -> None:
        self._take_transforms(raw, is_static=True)

    def _take_transforms(self, raw: bytes, *, is_static: bool = False) -> None:
        waiting = self._waiting
        if self._frames is None or not (is_static or waiting):
            return
        try:
            self._frames.add(raw, is_static=is_static)
        except InputError as error:
            self._node.log.warning(f'tf rejected: {error}', throttle_duration_sec=1.0)
        if waiting and self._frames.pose(waiting.error.frame, waiting.error.target) is not None:
            self._stop_waiting()
            self._take(waiting.topic, waiting.read, waiting.raw)
            # Those of the next path must be recent.
            self._frames.forget_moving()

    def _reject_waiting(self) -> None:
        if (waiting := self._waiting) is not None:
            self._stop_waiting()
            self.reject(waiting.topic, waiting.error)
            if self._frames is not None:
                self._frames.forget_moving()

    def _stop_waiting(self) -> None:
        self._waiting = None
        if self._end_of_patience is not None:
            self._node.node.destroy_timer(self._end_of_patience)
            self._end_of_patience = None

    def _pose_of(self, frame: str, target: str) -> Array | None:
        """Return the pose (7) of a frame in another one, None if it is not known."""
        return None if self._frames is None else self._frames.pose(frame, target)

    def follow_states(self) -> None:
        """Subscribe to the states of the robot, at the first path."""
        # States are not needed, and cost time at each tick, as long as there are no paths.
        if not self._has_states:
            self._has_states = True
            subscribe_with_past(self._node.node, JointState, _STATES, self._take_state)

    def _take_state(self, raw: bytes) -> None:
        try:
            stamp = self._state.read(raw)
            if stamp == UNREAD:
                message = deserialized(raw, JointState)
                has_base = self._base_joint in message.name
                joints = None if has_base else self._driven
                self._state.load_message(message, joints, unknown_velocity=0.0)
                stamp = self._state.stamp_ns
                if not (has_base or self._add_pose(stamp)):
                    return
        except InputError as error:
            self._node.log.warning(f'{_STATES} rejected: {error}', throttle_duration_sec=1.0)
            return
        self._on_state(stamp, self._state.position)

    def _add_pose(self, stamp: int) -> bool:
        """
        Add the pose of odometry to a state without the joints of the base.

        Return False if there is none yet, or only an old one. A fixed base is at zero.
        """
        if not self._mechanism.is_planar:
            return True
        if self._base is None:
            self._base = BasePose()
            subscribe_with_past(self._node.node, Odometry, 'odom', self._take_odometry)
        known = self._base.stamp_ns
        if known is None or abs(stamp - known) > OLDEST_POSE_NS:
            return False
        self._base.write(stamp, self._state.position, self._state.velocity)
        return True

    def _take_odometry(self, raw: bytes) -> None:
        if self._base is not None:
            try:
                stamp, pose, twist = odometry_numbers(deserialized(raw, Odometry))
                self._base.update(checked_stamp(stamp), pose, twist)
            except InputError as error:
                self._node.log.warning(f'odom rejected: {error}', throttle_duration_sec=1.0)
