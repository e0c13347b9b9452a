# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Topics that are recorded when they appear, with the types of their publishers.

The nodes that send the messages provide the definitions of types (REP-2016).
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from contextlib import suppress
import time
from typing import Protocol

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import Definition, definition
from masmc_ros.nodes.parameters.services import ServiceCall
from masmc_ros.nodes.process.runtime import without_source
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from type_description_interfaces.msg import (
    Field,
    FieldType,
    IndividualTypeDescription,
    TypeDescription,
)
from type_description_interfaces.srv import GetTypeDescription

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


_SEPARATOR = '=' * 80

_PRIMITIVES = {
    FieldType.FIELD_TYPE_INT8: 'int8',
    FieldType.FIELD_TYPE_UINT8: 'uint8',
    FieldType.FIELD_TYPE_INT16: 'int16',
    FieldType.FIELD_TYPE_UINT16: 'uint16',
    FieldType.FIELD_TYPE_INT32: 'int32',
    FieldType.FIELD_TYPE_UINT32: 'uint32',
    FieldType.FIELD_TYPE_INT64: 'int64',
    FieldType.FIELD_TYPE_UINT64: 'uint64',
    FieldType.FIELD_TYPE_FLOAT: 'float32',
    FieldType.FIELD_TYPE_DOUBLE: 'float64',
    FieldType.FIELD_TYPE_CHAR: 'char',
    FieldType.FIELD_TYPE_BOOLEAN: 'bool',
    FieldType.FIELD_TYPE_BYTE: 'byte',
    FieldType.FIELD_TYPE_STRING: 'string',
    FieldType.FIELD_TYPE_WSTRING: 'wstring',
    FieldType.FIELD_TYPE_BOUNDED_STRING: 'string<=',
    FieldType.FIELD_TYPE_BOUNDED_WSTRING: 'wstring<=',
}

_KIND_SIZE = 48
"""Offset between the numbers of a type and of its array, bounded and unbounded sequence."""

_PATIENCE = 10.0
"""Time in s within which a node must return its definition."""

_DUMMY = 'structure_needs_at_least_one_member'
"""Member that ROS 2 adds to a message without members."""


class DefinitionRequest:
    """A request to a node for the definition of one of its messages, polled by a timer."""

    def __init__(self, node: Node, sender: str, type_name: str, type_hash: str) -> None:
        """
        Initialise the request; `answer` sends it.

        Parameters
        ----------
        node
            Node of the client.
        sender
            Full name of the node that sends the messages.
        type_name
            Name such as `tf2_msgs/msg/TFMessage`.
        type_hash
            Hash of the sender's endpoint, `RIHS01_...`.

        """
        self._node = node
        self._sender = sender
        self._request = GetTypeDescription.Request(type_name=type_name, type_hash=type_hash)
        self._client = node.create_client(
            GetTypeDescription, f'{sender.rstrip("/")}/get_type_description'
        )
        self._service_call: ServiceCall | None = None
        self._limit = time.monotonic() + _PATIENCE

    def answer(self) -> Definition | None:
        """
        Return the definition, or None before it arrives.

        Raises
        ------
        InputError
            If the sender does not return it.

        """
        if self._service_call is None and self._client.service_is_ready():
            self._service_call = ServiceCall(lambda: self._client.call_async(self._request))
        response = None if self._service_call is None else self._service_call.response()
        if response is not None:
            return self._definition(response)
        if time.monotonic() > self._limit:
            raise InputError(
                f'{self._sender} sends no definition of {self._request.type_name}: no response '
                f'from {self._client.srv_name}; install the package of the type'
            )
        return None

    def close(self) -> None:
        """Destroy the client."""
        self._node.destroy_client(self._client)

    def _definition(self, response: GetTypeDescription.Response) -> Definition:
        if not response.successful:
            raise InputError(
                f'{self._sender} sends no definition of {self._request.type_name}: '
                f'{response.failure_reason}'
            )
        try:
            text = definition_text(response.type_description)
        except (KeyError, ValueError, IndexError) as error:
            raise InputError(
                f'{self._request.type_name} has a field of a type that ros2msg cannot describe'
            ) from error
        return Definition(text, self._request.type_hash)


def definition_text(description: TypeDescription) -> str:
    """
    Return a TypeDescription as text in the form `ros2msg`, with the types that it uses.

    Raises KeyError for a field of a type that has no name in that form.
    """
    parts = [_fields(description.type_description)]
    for nested in description.referenced_type_descriptions:
        package, _, name = nested.type_name.split('/')
        parts.append(f'MSG: {package}/{name}\n{_fields(nested)}')
    return f'{_SEPARATOR}\n'.join(parts)


def _fields(description: IndividualTypeDescription) -> str:
    return ''.join(
        f'{_type_text(field.type)} {field.name}{_default(field)}\n'
        for field in description.fields
        if field.name != _DUMMY
    )


def _type_text(field: FieldType) -> str:
    kind, primitive = divmod(field.type_id, _KIND_SIZE)
    if primitive == FieldType.FIELD_TYPE_NESTED_TYPE:
        package, _, name = field.nested_type_name.split('/')
        text = f'{package}/{name}'
    else:
        text = _PRIMITIVES[primitive]
        if text.endswith('<='):
            text += str(field.string_capacity)
    return text + ('', f'[{field.capacity}]', f'[<={field.capacity}]', '[]')[kind]


def _default(field: Field) -> str:
    return f' {field.default_value}' if field.default_value else ''
