# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions to commands: torques on one topic, or velocities and torques on two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
import time
from typing import NamedTuple

from geometry_msgs.msg import Twist, TwistStamped
from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.messages import deserialised, topics
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr, LabelledCdr
from masmc_ros.messages.platform_messages import twist_numbers, TwistCdr, TwistStampedCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import deserialized, subscribe_with_past
from masmc_ros.nodes.process.base import RejectedMessages
from masmc_ros.params.declaration import Values
from masmc_ros.plant.plant_core import CommandPart
from masmc_ros.robot.declaration import Velocity
from masmc_ros.robot.mechanisms import driven_joint_names, FRAME_PREFIX, mechanism_from
import numpy as np
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

OnCommand = Callable[[CommandPart, Array | None, int | None, float], None]
"""Function of a part, its numbers, the stamp of the state in ns, and the arrival time in s."""

_DEPTH = 10
"""
Commands of a topic that wait for the plant.

With depth 1, a command of another node could replace the one for which lock-step waits.
"""


class CommandInput:
    """
    Received commands of a command interface.

    Attributes
    ----------
    interface
        `effort`, `velocity` or `hybrid`.
    sources
        Topics of the command, in the order of its numbers.

    """

    def __init__(self, values: Values, rejected_messages: RejectedMessages) -> None:
        """Initialise the topics of the command interface of checked plant parameters."""
        self.interface = COMMAND_INTERFACE.of(values)
        self._is_stamped = ENABLE_STAMPED_CMD_VEL.of(values)
        self._rejected_messages = rejected_messages
        joints = driven_joint_names(values)
        self.sources = (
            base_sources(
                joints,
                mechanism_from(values).twist,
                FRAME_PREFIX.of(values),
                is_stamped=self._is_stamped,
                is_hybrid=self.interface == 'hybrid',
            )
            if self.interface != 'effort'
            else torque_sources(joints)
        )

    def subscribe(self, node: Node, on_command: OnCommand) -> None:
        """
        Subscribe to all topics.

        With the past: a controller may respond before it has discovered a subscription, and in
        lock-step it does not send that command again.
        """
        self._on_command = on_command
        for source in self.sources:
            callback = partial(self._on_message, source)
            subscribe_with_past(node, source.message_type, source.topic, callback, depth=_DEPTH)

    def _on_message(self, source: Source, raw: bytes) -> None:
        try:
            numbers, stamp = source.read(raw)
        except InputError as error:
            self._rejected_messages.add(source.topic, error)
            return
        self._on_command(source.part, numbers, stamp, time.monotonic())

    def are_sent_by(self, node: Node, name: str) -> bool:
        """Return True if a node of this namespace publishes all topics with their types."""
        return all(
            source.type_name in _sent_types(node, name, source.topic) for source in self.sources
        )

    def disagreement(self, node: Node, name: str) -> str | None:
        """Return a description of the other commands of a node in this namespace, or None."""
        if self.are_sent_by(node, name):
            return None
        used = {source.topic for source in self.sources}
        known = (topics.CMD_VEL_TOPIC, topics.ARM_VELOCITY_TOPIC, topics.COMMAND_TOPIC)
        other = [topic for topic in known if topic not in used]
        sent = [topic for topic in other if _sent_types(node, name, topic)]
        if sent:
            return (
                f'it sends {" and ".join(sent)}, and with {COMMAND_INTERFACE.name} '
                f'{self.interface} the plant uses {" and ".join(s.topic for s in self.sources)}'
            )
        for source in self.sources:
            types = _sent_types(node, name, source.topic)
            if types and source.type_name not in types:
                return (
                    f'its {source.topic} is {types[0]}, and with {ENABLE_STAMPED_CMD_VEL.name} '
                    f'{"true" if self._is_stamped else "false"} the plant uses '
                    f'{source.type_name}'
                )
        return None


def _sent_types(node: Node, name: str, topic: str) -> list[str]:
    """Return the types with which a node of this namespace publishes a topic."""
    return [
        publisher.topic_type
        for publisher in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if publisher.node_name == name and publisher.node_namespace == node.get_namespace()
    ]


_COMPONENTS = tuple(f'{part}.{c}' for part in ('linear', 'angular') for c in 'xyz')


class ReceivedCommand(NamedTuple):
    """Command of a valid message."""

    numbers: Array | None
    """Numbers of the command; None for a void one."""
    stamp: int | None
    """Stamp in ns of the state to which it responds; None if it names none."""


class Source(NamedTuple):
    """A topic with commands for one part; `read` raises InputError."""

    part: CommandPart
    type_name: str
    message_type: type
    read: Callable[[bytes], ReceivedCommand]

    @property
    def topic(self) -> str:
        """Topic, relative to the robot."""
        return self.part.topic


def torque_sources(joints: tuple[str, ...]) -> list[Source]:
    """Return the source of torques of the driven joints."""
    part = CommandPart(topics.COMMAND_TOPIC, len(joints))
    return [Source(part, topics.FLOAT_ARRAY, Float64MultiArray, _labelled(EffortCdr(joints)))]


def base_sources(
    joints: tuple[str, ...],
    twist: Sequence[Velocity],
    frame_prefix: str,
    *,
    is_stamped: bool,
    is_hybrid: bool,
) -> list[Source]:
    """
    Return the sources of a twist of the base, and of velocities or torques of the other joints.

    Parameters
    ----------
    joints
        Names of the driven joints; those that the twist replaces come first.
    twist
        Velocities of the base.
    frame_prefix
        Prefix of frame names. A TwistStamped with this prefix is read by compiled code.
    is_stamped
        True if twists are TwistStamped.
    is_hybrid
        True if the other joints receive torques. Without them, drives hold the base as well.

    """
    places = [velocity.place for velocity in twist]
    others = joints[len(places):]
    base = CommandPart(
        topics.CMD_VEL_TOPIC, len(places), names_state=is_stamped, is_zero_unlabelled=is_stamped
    )
    topic = topics.COMMAND_TOPIC if is_hybrid else topics.ARM_VELOCITY_TOPIC
    joints_part = CommandPart(topic, len(others), is_required=is_hybrid)
    reader = EffortCdr(others) if is_hybrid else ArmVelocityCdr(others)
    return [
        Source(base, topics.TWIST_STAMPED, TwistStamped, _stamped_twist(frame_prefix, places))
        if is_stamped
        else Source(base, topics.TWIST, Twist, _twist(places)),
        Source(joints_part, topics.FLOAT_ARRAY, Float64MultiArray, _labelled(reader)),
    ]


def _labelled(command: LabelledCdr) -> Callable[[bytes], ReceivedCommand]:
    # The first call compiles the kernel, or loads it.
    command.load(command.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        if not command.load(raw):
            command.load_message(deserialized(raw, Float64MultiArray))
        return ReceivedCommand(None if command.is_void else command.data, command.stamp_ns)

    return read


def _twist(places: Sequence[int]) -> Callable[[bytes], ReceivedCommand]:
    buffer = TwistCdr()
    buffer.load(buffer.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        twist = buffer if buffer.load(raw) else deserialized(raw, Twist)
        return ReceivedCommand(_velocities(twist, places), None)

    return read


def _stamped_twist(
    frame_prefix: str, places: Sequence[int]
) -> Callable[[bytes], ReceivedCommand]:
    buffer = TwistStampedCdr(frame_prefix)
    buffer.load(buffer.to_bytes())

    def read(raw: bytes) -> ReceivedCommand:
        if buffer.load(raw):
            return ReceivedCommand(_velocities(buffer, places), checked_stamp(buffer.stamp_ns))
        message = deserialized(raw, TwistStamped)
        return ReceivedCommand(_velocities(message.twist, places), header_stamp(raw))

    return read


def _velocities(
    twist: TwistCdr | TwistStampedCdr | deserialised.Twist, places: Sequence[int]
) -> Array:
    """Return the components of a twist that move this base."""
    numbers = twist_numbers(twist)
    for name, number in zip(_COMPONENTS, numbers, strict=True):
        if not math.isfinite(number):
            raise InputError(f'{name} = {number}: expected a finite number')
    return np.array([numbers[place] for place in places])
