# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics that are recorded when they appear, with the types of their publishers."""

from __future__ import annotations

from collections.abc import Container, Iterable
from contextlib import suppress
from typing import Protocol

from masmc_ros.errors import InputError
from masmc_ros.messages.definitions import Definition, definition
from masmc_ros.nodes.middleware.type_description import DefinitionRequest
from masmc_ros.nodes.process.runtime import without_source
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

_NOT_FOUND_YET = '_NODE_NAME_UNKNOWN_'
"""Name of a node that was discovered after its topics."""


class Record(Protocol):
    """Function that starts to record a topic; InputError if that is not possible."""

    def __call__(
        self,
        topic: str,
        type_name: str,
        *,
        is_latched: bool,
        holds: bool,
        best_effort: bool,
        defined: Definition,
    ) -> None:
        """Record the messages of the topic unmodified."""


class ExtraTopics:
    """Topics without a publisher so far."""

    def __init__(self, node: Node, names: Iterable[str], holds: dict[str, bool]) -> None:
        """
        Initialise the topics.

        Parameters
        ----------
        node
            node that resolves the names.
        names
            values of `extra_topics`.
        holds
            whether messages are valid until the next one, of known topics by name.

        Raises
        ------
        InputError
            if a name is invalid.

        """
        self._holds = holds
        self._names = {_resolved(node, name): name for name in names if name}
        # Known topics are handled by their names.
        self._names |= {node.resolve_topic_name(name): name for name in holds}
        self._requests: dict[str, DefinitionRequest] = {}

    def look(
        self, node: Node, log: RcutilsLogger, record: Record, recorded: Container[str]
    ) -> None:
        """Record topics that have appeared and are not in `recorded`, with their QoS."""
        for resolved, topic in tuple(self._names.items()):
            if resolved in recorded:
                del self._names[resolved]
                continue
            senders = node.get_publishers_info_by_topic(resolved)
            if not senders:
                continue
            try:
                defined = self._definition(node, topic, senders[0])
                if defined is None:
                    continue
                self._record(record, topic, senders, defined)
            except InputError as error:
                log.error(f'{resolved} is not recorded: {error}')
            del self._names[resolved]
            request = self._requests.pop(topic, None)
            if request is not None:
                request.close()

    def _record(
        self, record: Record, topic: str, senders: list[TopicEndpointInfo], defined: Definition
    ) -> None:
        offered = [sender.qos_profile for sender in senders]
        is_latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        record(
            topic,
            senders[0].topic_type,
            is_latched=is_latched,
            holds=self._holds.get(topic, is_latched),
            best_effort=any(qos.reliability == ReliabilityPolicy.BEST_EFFORT for qos in offered),
            defined=defined,
        )

    def _definition(self, node: Node, topic: str, sender: TopicEndpointInfo) -> Definition | None:
        """
        Return the definition of a topic's type; None until the sender has sent it.

        The sender is not asked for a type of Jazzy, unless it has another version of it.
        """
        type_hash = str(sender.topic_type_hash)
        with suppress(InputError):
            known = definition(sender.topic_type)
            if type_hash in (known.type_hash, ''):
                return known
        if sender.node_name == _NOT_FOUND_YET:
            return None
        if topic not in self._requests:
            name = f'{sender.node_namespace.rstrip("/")}/{sender.node_name}'
            self._requests[topic] = DefinitionRequest(node, name, sender.topic_type, type_hash)
        return self._requests[topic].answer()


def _resolved(node: Node, name: str) -> str:
    """Return the full name of an extra topic; InputError if its name is invalid."""
    try:
        return node.resolve_topic_name(name)
    except RuntimeError as error:
        reason = without_source(error).removeprefix('failed to resolve name: ')
        raise InputError(
            f'extra_topics = {name}: {reason}; expected names such as scan or /camera/image_raw'
        ) from error
