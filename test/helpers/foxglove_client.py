# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Client of Foxglove's WebSocket protocol, as a stand-in for the Foxglove app."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import json
import struct
import time
from typing import Any

from helpers.processes import PATIENCE
from websockets.sync.client import ClientConnection, connect

PROTOCOL = 'foxglove.sdk.v1'
_MESSAGE = struct.Struct('<BIQ')
_TIME = struct.Struct('<BQ')
_ASSET = struct.Struct('<BIBI')


class Viewer:
    """Client that subscribes to every advertised channel and stores the messages."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._topics: dict[int, str] = {}
        self._request_count = 0
        self._assets: dict[int, tuple[bool, bytes]] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        """Time in ns and message, by topic."""
        self.times: list[int] = []
        self.received: list[dict[str, Any]] = []
        """Messages in JSON, except advertised channels."""

    def until(self, holds: Callable[[], Any], awaited: str) -> Any:
        """Receive until `holds` returns a true value; return it, or fail after a timeout."""
        limit = time.monotonic() + PATIENCE
        while not (value := holds()):
            assert time.monotonic() < limit, f'timeout: {awaited}; {self._summary()}'
            try:
                self._take(self._connection.recv(timeout=0.1))
            except TimeoutError:
                continue
        return value

    def last(self, topic: str) -> bytes:
        """Return the latest message of a topic; wait for the first."""
        self.until(lambda: self.messages.get(topic), topic)
        return self.messages[topic][-1][1]

    def statuses(self) -> list[str]:
        """Return the errors and warnings of the server."""
        return [message['message'] for message in self.received if message['op'] == 'status']

    def parameters(self, *names: str) -> dict[str, Any]:
        """Request some or all parameters, and return the response."""
        return self._ask('getParameters', parameterNames=list(names))

    def set_parameter(self, name: str, value: Any) -> Any:
        """Set a parameter; return the value in the response."""
        return self._ask('setParameters', parameters=[{'name': name, 'value': value}]).get(name)

    def asset(self, uri: str) -> bytes | None:
        """Request a file by its name; return its content, None if the server rejects it."""
        self._request_count += 1
        number = self._request_count
        self._send('fetchAsset', uri=uri, requestId=number)
        is_rejected, content = self.until(lambda: self._assets.get(number), f'response on {uri}')
        return None if is_rejected else content

    def follow_parameters(self, *names: str) -> None:
        """Subscribe to changes."""
        self._send('subscribeParameterUpdates', parameterNames=list(names))

    def changes(self, name: str) -> list[Any]:
        """Return the values of a parameter that the server sent without a request."""
        return [
            parameter['value']
            for message in self.received
            if message['op'] == 'parameterValues' and 'id' not in message
            for parameter in message['parameters']
            if parameter['name'] == name
        ]

    def _summary(self) -> str:
        counts = {topic: (len(rows), rows[-1][0]) for topic, rows in self.messages.items()}
        return f'number of messages and last time: {counts}'

    def _ask(self, operation: str, **fields: Any) -> dict[str, Any]:
        self._request_count += 1
        name = f'{operation} {self._request_count}'
        self._send(operation, id=name, **fields)

        def answers() -> list[dict[str, Any]]:
            return [message for message in self.received if message.get('id') == name]

        answer = self.until(answers, f'the answer to {operation}')[0]
        return {parameter['name']: parameter['value'] for parameter in answer['parameters']}

    def _send(self, operation: str, **fields: Any) -> None:
        self._connection.send(json.dumps({'op': operation, **fields}))

    def _take(self, message: str | bytes) -> None:
        if isinstance(message, str):
            content = json.loads(message)
            if content['op'] == 'advertise':
                self._subscribe(content['channels'])
            else:
                self.received.append(content)
        elif message[0] == 1:
            _, subscription, stamp = _MESSAGE.unpack_from(message)
            received = self.messages.setdefault(self._topics[subscription], [])
            received.append((stamp, message[_MESSAGE.size:]))
        elif message[0] == 4:
            _, number, is_rejected, size = _ASSET.unpack_from(message)
            self._assets[number] = bool(is_rejected), message[_ASSET.size + size:]
        elif message[0] == 2:
            self.times.append(_TIME.unpack_from(message)[1])

    def _subscribe(self, channels: list[dict[str, Any]]) -> None:
        for channel in channels:
            number = len(self._topics) + 1
            self._topics[number] = channel['topic']
            self.channels[channel['topic']] = channel
            self._send('subscribe', subscriptions=[{'id': number, 'channelId': channel['id']}])


@contextmanager
def viewer(port: int) -> Iterator[Viewer]:
    """Yield a client of the server at a port of this machine."""
    with connect(
        f'ws://127.0.0.1:{port}',
        subprotocols=[PROTOCOL],
        max_size=None,
        # Otherwise the response to its close frame waits behind messages that are not received.
        max_queue=None,
        open_timeout=PATIENCE,
    ) as connection:
        yield Viewer(connection)
