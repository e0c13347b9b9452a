# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A run's topics and parameters over the Foxglove WebSocket protocol.

The library serves its clients on threads of its own. What they ask for is queued, and done
when the node turns to it: everything of the run is touched by the node's thread alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
import queue
import threading
from typing import Any, TYPE_CHECKING

from masmc_ros.errors import InputError, UserError
from masmc_ros.messages.definitions import definition

if TYPE_CHECKING:
    from foxglove import Parameter
    from foxglove.websocket import ChannelView, Client

_BACKLOG = 4096
"""Messages that wait for a slow client before the oldest are dropped; each client has its own."""

_FULL = 'viewers'
"""Identifier of the status that there are too many viewers."""

_PATIENCE = 5.0
"""Longest time in s that a client waits for the answer to a change."""


@dataclass
class Change:
    """Parameters that a client wants to set, by name; done when `finish` was called."""

    values: dict[str, Any]
    _finished: threading.Event = field(default_factory=threading.Event)

    def finish(self) -> None:
        """Signal to the client's thread that the current values are ready."""
        self._finished.set()

    def wait(self) -> None:
        """Wait for the end, for a limited time."""
        self._finished.wait(_PATIENCE)


@dataclass(frozen=True)
class _Subscription:
    """A client of a topic, and the number of messages sent before it joined."""

    topic: str
    client: int
    sent: int


@dataclass(frozen=True)
class _Unsubscription:
    """A client that no longer wants a topic, or has disconnected."""

    topic: str
    client: int


_Request = Change | _Subscription | _Unsubscription


class _Topic:
    """A channel and the messages that a client is given when it comes."""

    def __init__(self, channel: Any, kept: int) -> None:
        self.channel = channel
        self.sent = 0
        self._kept: deque[tuple[int, bytes, int]] = deque(maxlen=kept)

    def send(self, raw: bytes, time_ns: int, clients: Sequence[int] | None) -> None:
        """Send a message to these clients; None: to all that are connected."""
        self._kept.append((self.sent, raw, time_ns))
        self.sent += 1
        if clients is None:
            self.channel.log(raw, log_time=time_ns)
            return
        for client in clients:
            self.channel.log(raw, log_time=time_ns, sink_id=client)

    def send_past(self, client: int, until: int) -> None:
        """Send what is kept of the first `until` messages to one client."""
        for number, raw, time_ns in self._kept:
            if number < until:
                self.channel.log(raw, log_time=time_ns, sink_id=client)


class LiveServer:
    """
    Serves topics and parameters to all subscribed clients.

    The library accepts any number of clients and has a queue for each. Messages therefore go to
    the first clients alone if there are more than a limit; others follow when one of those leaves.
    """

    def __init__(
        self, name: str, *, most_viewers: int, complain: Callable[[str], object]
    ) -> None:
        """
        Initialise a server that does not listen yet.

        Parameters
        ----------
        name
            of the server, as viewers show it.
        most_viewers
            number of clients to which messages are sent.
        complain
            called with a line if there are more.

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
        self._most_viewers = most_viewers
        self._complain = complain
        self._viewers: dict[int, set[str]] = {}
        """The topics that clients want, in the order in which the clients came."""
        self._served: list[int] | None = None
        """The clients to which messages are sent; None: all, as they are not too many."""
        self.in_force: Mapping[str, Any] = {}
        """Parameter values by names such as `/controller.k_s1`; replaced, never changed."""
        self.meshes: Mapping[str, Path] = {}
        """Files that viewers may ask for, by the names in the description; replaced, as those."""
        self._server: Any = None
        self._time_ns = 0

    def start(self, host: str, port: int) -> int:
        """Listen; return the port. InputError where that is not possible."""
        from foxglove.websocket import Capability

        # Any: the library's protocol has methods that are for capabilities not offered here.
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
        """Return what is in the file of a mesh; None where there is none of that name."""
        try:
            return self.meshes[name].read_bytes()
        except (KeyError, OSError):
            return None

    def add_topic(self, topic: str, type_name: str, kept: int = 1) -> None:
        """Offer a topic by its full name; late clients get its last `kept` messages."""
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

    def tell_time(self, time_ns: int) -> None:
        """Send the robot's time, by which viewers order messages."""
        if time_ns != self._time_ns:
            self._time_ns = time_ns
            self._server.broadcast_time(time_ns)

    def set_in_force(self, values: Mapping[str, Any]) -> None:
        """Show parameter values, by names such as `/controller.k_s1`, as the current ones."""
        changed = {n: v for n, v in values.items() if self.in_force.get(n) != v}
        self.in_force = {**self.in_force, **changed}
        if changed:
            self._server.publish_parameter_values(self.parameters(list(changed)))

    def parameters(self, names: Sequence[str] = ()) -> list[Parameter]:
        """Return the current values of these parameters, if they exist, or of all."""
        values = self.in_force
        chosen = [name for name in names or sorted(values) if name in values]
        return [self._foxglove.Parameter(name, value=values[name]) for name in chosen]

    def refuse(self, name: str, reason: str) -> None:
        """Send to all clients the reason why a parameter was not set."""
        level = self._foxglove.StatusLevel.Error
        self._server.publish_status(f'{name}: {reason}', level, name)

    def accept(self, name: str) -> None:
        """Take back what was said of a parameter's last value."""
        self._server.remove_status([name])

    def requests(self) -> list[Change]:
        """Return changes that clients want, after giving new clients what they missed."""
        changes = []
        while not self._requests.empty():
            request = self._requests.get()
            if isinstance(request, Change):
                changes.append(request)
            elif isinstance(request, _Subscription):
                self._subscribe(request)
            else:
                self._unsubscribe(request)
        return changes

    def _subscribe(self, request: _Subscription) -> None:
        """Send a client what it missed of a topic, unless there are too many clients."""
        is_new = request.client not in self._viewers
        self._viewers.setdefault(request.client, set()).add(request.topic)
        if is_new:
            self._choose_served()
        if self._served is None:
            self._send_past(request.topic, request.client, request.sent)
        elif request.client in self._served:
            self._send_past(request.topic, request.client, self._topics[request.topic].sent)

    def _unsubscribe(self, request: _Unsubscription) -> None:
        """Forget a client that wants no topic any more; the next one takes its place."""
        topics = self._viewers.get(request.client, set())
        topics.discard(request.topic)
        if topics or request.client not in self._viewers:
            return
        del self._viewers[request.client]
        before = self._served
        self._choose_served()
        if before is None:
            return
        for client in set(self._viewers if self._served is None else self._served) - set(before):
            for topic in self._viewers[client]:
                self._send_past(topic, client, self._topics[topic].sent)

    def _choose_served(self) -> None:
        """Note to which clients messages are sent, and report if some are left out."""
        count, most = len(self._viewers), self._most_viewers
        if count > most:
            self._served = list(self._viewers)[:most]
            text = (
                f'{count} viewers, of which {count - most} get no messages; expected at most '
                f'{most}: close some, or start the node with a larger max_viewers'
            )
            self._server.publish_status(text, self._foxglove.StatusLevel.Warning, _FULL)
            self._complain(text)
        elif self._served is not None:
            self._served = None
            self._server.remove_status([_FULL])

    def _send_past(self, topic: str, client: int, until: int) -> None:
        self._topics[topic].send_past(client, until)
        self._server.broadcast_time(self._time_ns)

    def stop(self) -> None:
        """Let all clients go."""
        while not self._requests.empty():
            request = self._requests.get()
            if isinstance(request, Change):
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
        change = Change({each.name: each.get_value() for each in parameters})
        self._requests.put(change)
        change.wait()
        return self._parameters([each.name for each in parameters])

    def on_parameters_subscribe(self, param_names: list[str]) -> None:
        pass

    def on_parameters_unsubscribe(self, param_names: list[str]) -> None:
        pass


def plain(value: Any) -> Any:
    """Return a parameter's value as the protocol knows it: arrays as lists, floats finite."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return [plain(each) for each in value]
