# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions to commands: torques on one topic, or velocities and torques on two."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import time

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, CMD_VEL_TOPIC, COMMAND_TOPIC
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.plant.command_sources import base_sources, Source, torque_sources
from masmc_ros.nodes.process.diagnostics import RejectedMessages
from masmc_ros.params.declaration import Values
from masmc_ros.plant.latest_command import CommandPart
from masmc_ros.robot.joint_names import driven_joint_names, FRAME_PREFIX
from masmc_ros.robot.mechanisms import mechanism_from
from rclpy.node import Node

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
        other = [t for t in (CMD_VEL_TOPIC, ARM_VELOCITY_TOPIC, COMMAND_TOPIC) if t not in used]
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
