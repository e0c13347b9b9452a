# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Topics and parameters of a run over the Foxglove WebSocket protocol.

The library serves its clients on separate threads. Their requests are queued and processed on
the node's thread, which alone accesses the state of the run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
import queue
from typing import Any, TYPE_CHECKING

from masmc_ros.errors import InputError, UserError
from masmc_ros.messages.definitions import definition
from masmc_ros.nodes.parameters.viewer_parameters import ParameterRequest
from masmc_ros.params.declaration import Values

if TYPE_CHECKING:
    from foxglove import Parameter
    from foxglove.websocket import ChannelView, Client

_BACKLOG = 4096
"""Length of the message queue of each client; a slow client loses the oldest messages."""

_TOO_MANY = 'viewers'
"""Identifier of the status that there are too many viewers."""

@dataclass(frozen=True)
class _Subscription:
    """A client of a topic, and the number of messages sent before it joined."""

    topic: str
    client: int
    sent: int


@dataclass(frozen=True)
class _Unsubscription:
    """A client that has unsubscribed from a topic, or has disconnected."""

    topic: str
    client: int


_Request = ParameterRequest | _Subscription | _Unsubscription


class _Topic:
    """A channel and its past messages for new clients."""

    def __init__(self, channel: Any, kept: int) -> None:
        self.channel = channel
        self.sent = 0
        self._kept: deque[tuple[int, bytes, int]] = deque(maxlen=kept)

    def send(self, raw: bytes, time_ns: int, clients: Sequence[int] | None) -> None:
        """Send a message to these clients; None: to all connected clients."""
        self._kept.append((self.sent, raw, time_ns))
        self.sent += 1
        if clients is None:
            self.channel.log(raw, log_time=time_ns)
            return
        for client in clients:
            self.channel.log(raw, log_time=time_ns, sink_id=client)

    def send_past(self, client: int, until: int) -> None:
        """Send those of the first `until` messages that are kept to one client."""
        for number, raw, time_ns in self._kept:
            if number < until:
                self.channel.log(raw, log_time=time_ns, sink_id=client)


class LiveServer:
    """
    Server of topics and parameters for all subscribed clients.

    The library accepts any number of clients and has a queue for each. Above a limit, only the
    first clients get messages; another one follows when one of those leaves.

    Attributes
    ----------
    values
        Parameter values by names such as `/controller.k_s1`; replaced, never modified.
    meshes
        Mesh files by their names in the robot's description; replaced, never modified.

    """

    def __init__(
        self, name: str, *, max_viewers: int, warn: Callable[[str], object]
    ) -> None:
        """
        Initialise a server that does not listen yet.

        Parameters
        ----------
        name
            Name of the server in viewers.
        max_viewers
            Largest number of clients that get messages.
        warn
            Function that logs a line if there are more.

        Raises
        ------
        UserError
            if foxglove-sdk is not installed.

        """
        try:
            import foxglove
        except ImportError as error:
            raise UserError(
                f'foxglove-sdk cannot be imported ({error}); install it with '
                'pip install foxglove-sdk'
            ) from error
        self._foxglove = foxglove
        self._name = name
        self._context = foxglove.Context()
        self._topics: dict[str, _Topic] = {}
        self._requests: queue.SimpleQueue[_Request] = queue.SimpleQueue()
        self._max_viewers = max_viewers
        self._warn = warn
        # Topics of each client, in the order in which the clients subscribed.
        self._viewers: dict[int, set[str]] = {}
        # Clients that get messages; None: all.
        self._served: list[int] | None = None
        self.values: Values = {}
        self.meshes: Mapping[str, Path] = {}
        self._server: Any = None
        self._time_ns = 0

    def start(self, host: str, port: int) -> int:
        """Listen and return the port; InputError if that is impossible."""
        from foxglove.websocket import Capability

        # Any: the library's protocol also has the methods of unused capabilities.
        listener: Any = _Listener(self._requests, self._topics, self.parameters)
        try:
            self._server = self._foxglove.start_server(
                name=self._name,
                host=host,
                port=port,
                capabilities=[Capability.Parameters, Capability.Time],
                server_listener=listener,
                asset_handler=self._mesh,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except RuntimeError as error:
            raise InputError(
                f'host = {host}, port = {port}: {error}; name a free port of this machine'
            ) from error
        return int(self._server.port)

    @property
    def app_url(self) -> str:
        """Return the address under which the Foxglove app opens this server."""
        return str(self._server.app_url())

    def _mesh(self, name: str) -> bytes | None:
        """Return the content of a mesh file; None if there is no such file."""
        try:
            return self.meshes[name].read_bytes()
        except (KeyError, OSError):
            return None

    def add_topic(self, topic: str, type_name: str, kept: int = 1) -> None:
        """Add a topic by its full name; late-joining clients get its last `kept` messages."""
        schema = self._foxglove.Schema(
            name=type_name, encoding='ros2msg', data=definition(type_name).text.encode()
        )
        channel = self._foxglove.Channel(
            topic, message_encoding='cdr', schema=schema, context=self._context
        )
        self._topics[topic] = _Topic(channel, kept)

    def send(self, topic: str, raw: bytes, time_ns: int) -> None:
        """Send a message, as CDR with its encapsulation header, with its time in ns."""
        self._topics[topic].send(raw, time_ns, self._served)

    def send_time(self, time_ns: int) -> None:
        """Send the robot's time in ns, by which viewers order messages."""
        if time_ns != self._time_ns:
            self._time_ns = time_ns
            self._server.broadcast_time(time_ns)

    def show_values(self, values: Values) -> None:
        """Show current parameter values by names such as `/controller.k_s1`."""
        changed = {n: v for n, v in values.items() if self.values.get(n) != v}
        self.values = {**self.values, **changed}
        if changed:
            self._server.publish_parameter_values(self.parameters(list(changed)))

    def parameters(self, names: Sequence[str] = ()) -> list[Parameter]:
        """Return the current values of these parameters, if they exist, or of all."""
        values = self.values
        return [
            self._foxglove.Parameter(name, value=values[name])
            for name in names or sorted(values)
            if name in values
        ]

    def show_error(self, name: str, reason: str) -> None:
        """Show to all clients the reason why a parameter was not set."""
        level = self._foxglove.StatusLevel.Error
        self._server.publish_status(f'{name}: {reason}', level, name)

    def clear_error(self, name: str) -> None:
        """Remove the error of a parameter."""
        self._server.remove_status([name])

    def requests(self) -> list[ParameterRequest]:
        """Send past messages to new clients; return the requested changes of parameters."""
        changes = []
        while not self._requests.empty():
            request = self._requests.get()
            if isinstance(request, ParameterRequest):
                changes.append(request)
            elif isinstance(request, _Subscription):
                self._subscribe(request)
            else:
                self._unsubscribe(request)
        return changes

    def _subscribe(self, request: _Subscription) -> None:
        """Send a client the past messages of a topic, unless there are too many clients."""
        is_new = request.client not in self._viewers
        self._viewers.setdefault(request.client, set()).add(request.topic)
        if is_new:
            self._update_served()
        if self._served is None:
            self._send_past(request.topic, request.client, request.sent)
        elif request.client in self._served:
            self._send_past(request.topic, request.client, self._topics[request.topic].sent)

    def _unsubscribe(self, request: _Unsubscription) -> None:
        """Remove a client without topics; the next one takes its place."""
        topics = self._viewers.get(request.client, set())
        topics.discard(request.topic)
        if topics or request.client not in self._viewers:
            return
        del self._viewers[request.client]
        previous = self._served
        self._update_served()
        if previous is None:
            return
        served = self._viewers if self._served is None else self._served
        for client in set(served) - set(previous):
            for topic in self._viewers[client]:
                self._send_past(topic, client, self._topics[topic].sent)

    def _update_served(self) -> None:
        """Select the clients that get messages; warn if some get none."""
        count, limit = len(self._viewers), self._max_viewers
        if count > limit:
            self._served = list(self._viewers)[:limit]
            text = (
                f'{count} viewers: {count - limit} get no messages; expected at most {limit}; '
                'close some, or start the node with a larger max_viewers'
            )
            self._server.publish_status(text, self._foxglove.StatusLevel.Warning, _TOO_MANY)
            self._warn(text)
        elif self._served is not None:
            self._served = None
            self._server.remove_status([_TOO_MANY])

    def _send_past(self, topic: str, client: int, until: int) -> None:
        self._topics[topic].send_past(client, until)
        self._server.broadcast_time(self._time_ns)

    def stop(self) -> None:
        """Disconnect all clients and stop the server."""
        while not self._requests.empty():
            request = self._requests.get()
            if isinstance(request, ParameterRequest):
                request.finish()
        if self._server is not None:
            self._server.stop()


class _Listener:
    """Callbacks that the library calls on its own threads."""

    def __init__(
        self,
        requests: queue.SimpleQueue[_Request],
        topics: Mapping[str, _Topic],
        parameters: Callable[[Sequence[str]], list[Parameter]],
    ) -> None:
        self._requests = requests
        self._topics = topics
        self._parameters = parameters

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        sent = self._topics[channel.topic].sent
        self._requests.put(_Subscription(channel.topic, client.id, sent))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        self._requests.put(_Unsubscription(channel.topic, client.id))

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        return self._parameters(param_names)

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        values = {parameter.name: parameter.get_value() for parameter in parameters}
        change = ParameterRequest(values)
        self._requests.put(change)
        change.wait()
        return self._parameters(list(change.values))

    def on_parameters_subscribe(self, param_names: list[str]) -> None:
        pass

    def on_parameters_unsubscribe(self, param_names: list[str]) -> None:
        pass
