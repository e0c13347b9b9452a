# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Client that sends random requests and messages to all services and topics of nodes."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from benchmarks.hostile import choices_of, interface_class, RandomInput
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

_MOST_WAITING = 200
"""Requests without a response that are kept."""

_MOST_SENT = 20_000
"""Number of own messages that the client remembers."""

_LONGEST_TEXT = 100
_FOLLOWED = ('effort_commands', 'joint_states')
"""Topics that plant and controller follow without knowledge of the sender."""

_DEPTH = 10


class Service(NamedTuple):
    """A service of a node: full names of both, and the class of its type."""

    node: str
    name: str
    kind: Any


class Topic(NamedTuple):
    """A topic that a node subscribes to: full name, and the class of its type."""

    name: str
    kind: Any


class HostileClient:
    """
    Client that sends random input to nodes, and valid requests in between.

    Attributes
    ----------
    services
        all services of the nodes at the last discovery.
    topics
        all subscribed topics of installed types.
    requests
        number of requests by service.
    messages
        number of messages by topic.
    responses
        number of responses by node.

    """

    def __init__(
        self,
        node: Node,
        source: RandomInput,
        targets: Sequence[str],
        fixed: Collection[str] = (),
    ) -> None:
        """
        Initialise the client; nothing is discovered yet.

        Parameters
        ----------
        node
            sends and receives; the caller spins it.
        source
            makes the random values.
        targets
            names of the nodes, all in the root namespace.
        fixed
            parameters that no valid request changes.

        """
        self._node = node
        self._source = source
        self._targets = tuple(targets)
        self._fixed = frozenset(fixed)
        self.services: list[Service] = []
        self.topics: list[Topic] = []
        self._sent: dict[int, None] = {}
        self.requests: dict[str, int] = {}
        self.messages: dict[str, int] = {}
        self.responses: dict[str, int] = dict.fromkeys(self._targets, 0)
        self.known: dict[str, dict[str, ParameterValue]] = {name: {} for name in self._targets}
        self._choices: dict[str, dict[str, tuple[str, ...]]] = {}
        self._changeable: dict[str, list[str]] = {}
        self._clients: dict[str, Any] = {}
        self._publishers: dict[tuple[str, bool], Any] = {}
        self._templates: dict[str, bytes] = {}
        self._watched: dict[str, Any] = {}
        self._waiting: deque[tuple[Any, Future]] = deque()

    # Discovery.

    def discover(self) -> None:
        """Update the services and topics of all nodes."""
        own = {(self._node.get_name(), self._node.get_namespace())}
        present = set(self._node.get_node_names_and_namespaces()) - own
        services, topics = [], {}
        for target in self._targets:
            if (target, '/') not in present:
                continue
            for name, types in self._node.get_service_names_and_types_by_node(target, '/'):
                kind = interface_class(types[0])
                if kind is not None:
                    services.append(Service(target, name, kind))
            for name, types in self._node.get_subscriber_names_and_types_by_node(target, '/'):
                kind = interface_class(types[0])
                if kind is not None:
                    topics[name] = Topic(name, kind)
        self.services, self.topics = services, list(topics.values())
        for topic in self.topics:
            if topic.name not in self._watched:
                self._watch(topic)

    def learn_parameters(self, target: str) -> None:
        """Request names, values and descriptions of a node's parameters, one after the other."""

        def on_names(future: Future) -> None:
            names = list(future.result().result.names)
            values = self._call(GetParameters, f'/{target}/get_parameters', names=names)
            values.add_done_callback(lambda f: on_values(names, f))

        def on_values(names: list[str], future: Future) -> None:
            self.known[target] = dict(zip(names, future.result().values, strict=False))
            service = f'/{target}/describe_parameters'
            descriptions = self._call(DescribeParameters, service, names=names)
            descriptions.add_done_callback(on_descriptions)

        def on_descriptions(future: Future) -> None:
            descriptors = future.result().descriptors
            self._changeable[target] = [d.name for d in descriptors if not d.read_only]
            self._choices[target] = {
                d.name: choices_of(d.additional_constraints) for d in descriptors
            }

        self._call(ListParameters, f'/{target}/list_parameters').add_done_callback(on_names)

    def is_known(self, target: str) -> bool:
        """Return True if the parameters of a node are known."""
        return target in self._changeable

    def limit_choices(self, name: str, choices: Sequence[str]) -> None:
        """Restrict the choices of a parameter of all nodes to fewer strings."""
        for known in self._choices.values():
            if name in known:
                known[name] = tuple(choices)

    def _watch(self, topic: Topic) -> None:
        """Keep the latest message of a topic as a template."""

        def keep(raw: Any) -> None:
            if not self.has_sent(raw):
                self._templates[topic.name] = bytes(raw)

        self._watched[topic.name] = self._node.create_subscription(
            topic.kind, topic.name, keep, QoSProfile(depth=1), raw=True
        )

    # Actions.

    def random_request(self) -> str:
        """Send a random request to a random service; return a short description."""
        service = self._source.random.choice(self.services)
        return self.request(service)

    def request(self, service: Service) -> str:
        """Send a random request to a service; return a short description."""
        request = self._source.request(service.kind, self.known[service.node])
        self._send(service, request)
        return f'{service.name} {_short(request)}'

    def valid_change(self, target: str, scale: float = 2.0) -> str | None:
        """Change a parameter of a node within its range; return None if that is impossible."""
        names = [n for n in self._changeable.get(target, ()) if n not in self._fixed]
        if not names:
            return None
        name = self._source.random.choice(names)
        value = self._source.valid_value(
            self.known[target][name], self._choices[target].get(name, ()), scale
        )
        if value is None:
            return None
        request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
        self._send(Service(target, f'/{target}/set_parameters', SetParameters), request)
        return f'/{target}/set_parameters {name} {_short(value)}'

    def call(self, target: str, service: str, **fields: Any) -> str | None:
        """Call a service of a node by its last name; return None if the node lacks it."""
        name = f'/{target}/{service}'
        for known in self.services:
            if known.name == name:
                self._send(known, known.kind.Request(**fields))
                return f'{name} {fields or ""}'.rstrip()
        return None

    def random_message(self) -> str:
        """Publish a random message on a random topic; return a short description."""
        topic = self._source.random.choice(self.topics)
        return self.publish(topic)

    def publish(self, topic: Topic) -> str:
        """Publish a random message on a topic; return a short description."""
        raw = self._source.message(topic.kind, self._templates.get(topic.name))
        if topic.name.rpartition('/')[2] in _FOLLOWED:
            raw = self._source.disarmed(topic.kind, raw)
        publisher = self._publisher(topic, is_latched=self._source.random.random() < 0.5)
        self._sent[hash(raw)] = None
        if len(self._sent) > _MOST_SENT:
            del self._sent[next(iter(self._sent))]
        # Fast DDS does not send more bytes than the maximum size of a bounded type.
        with suppress(RuntimeError):
            publisher.publish(raw)
        self.messages[topic.name] = self.messages.get(topic.name, 0) + 1
        return f'{topic.name} {len(raw)} bytes {raw[:24].hex()}'

    def has_sent(self, raw: bytes) -> bool:
        """Return True if this client has sent the message."""
        return hash(bytes(raw)) in self._sent

    def _publisher(self, topic: Topic, *, is_latched: bool) -> Any:
        key = topic.name, is_latched
        if key not in self._publishers:
            durability = (
                DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE
            )
            self._publishers[key] = self._node.create_publisher(
                topic.kind, topic.name, QoSProfile(depth=_DEPTH, durability=durability)
            )
        return self._publishers[key]

    # Requests and responses.

    def _call(self, kind: Any, name: str, **fields: Any) -> Future:
        node = name.split('/')[1]
        return self._send(Service(node, name, kind), kind.Request(**fields))

    def _send(self, service: Service, request: Any) -> Future:
        if service.name not in self._clients:
            self._clients[service.name] = self._node.create_client(service.kind, service.name)
        client = self._clients[service.name]
        future = client.call_async(request)
        future.add_done_callback(lambda _: self._count_response(service.node))
        self._waiting.append((client, future))
        if len(self._waiting) > _MOST_WAITING:
            other, oldest = self._waiting.popleft()
            other.remove_pending_request(oldest)
        self.requests[service.name] = self.requests.get(service.name, 0) + 1
        return future

    def _count_response(self, node: str) -> None:
        self.responses[node] += 1


def _short(message: Any) -> str:
    """Return the non-empty fields of a message in one short line."""
    parts = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, '__len__') and not isinstance(value, str):
            if not len(value):
                continue
            value = f'{len(value)} × {value[0]}' if len(value) else ''
        text = f'{name}={value}'.replace('\n', ' ')
        parts.append(f'{text[:_LONGEST_TEXT]}…' if len(text) > _LONGEST_TEXT else text)
    return ' '.join(parts)
