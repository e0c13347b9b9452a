# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A viewer as the Foxglove app is one: a client of its WebSocket protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import json
import struct
import time
from typing import Any

from processes import PATIENCE
from websockets.sync.client import ClientConnection, connect

PROTOCOL = 'foxglove.sdk.v1'
_MESSAGE = struct.Struct('<BIQ')
_TIME = struct.Struct('<BQ')
_ASSET = struct.Struct('<BIBI')


class Viewer:
    """Subscribes to every channel that is offered, and keeps what it is sent."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._topics: dict[int, str] = {}
        self._asked = 0
        self._assets: dict[int, tuple[bool, bytes]] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        """Time in ns and message, by topic."""
        self.times: list[int] = []
        self.told: list[dict[str, Any]] = []
        """What came as JSON, channels apart."""

    def until(self, holds: Callable[[], Any], what: str) -> Any:
        """Receive until something is true and return it; AssertionError where it never is."""
        limit = time.monotonic() + PATIENCE
        while not (found := holds()):
            assert time.monotonic() < limit, f'it never came: {what}; {self._summary()}'
            try:
                self._take(self._connection.recv(timeout=0.1))
            except TimeoutError:
                continue
        return found

    def last(self, topic: str) -> bytes:
        """Return the latest message of a topic, once there is one."""
        self.until(lambda: self.messages.get(topic), topic)
        return self.messages[topic][-1][1]

    def statuses(self) -> list[str]:
        """Return what the server complained of."""
        return [each['message'] for each in self.told if each['op'] == 'status']

    def parameters(self, *names: str) -> dict[str, Any]:
        """Ask for parameters, or for all, and return the answer."""
        return self._ask('getParameters', parameterNames=list(names))

    def set_parameter(self, name: str, value: Any) -> Any:
        """Set a parameter; return the value that is shown then."""
        return self._ask('setParameters', parameters=[{'name': name, 'value': value}]).get(name)

    def asset(self, uri: str) -> bytes | None:
        """Ask for a file by its name; return what is in it, None where it is refused."""
        self._asked += 1
        number = self._asked
        self._send('fetchAsset', uri=uri, requestId=number)
        is_refused, content = self.until(lambda: self._assets.get(number), f'an answer on {uri}')
        return None if is_refused else content

    def follow_parameters(self, *names: str) -> None:
        """Subscribe to changes."""
        self._send('subscribeParameterUpdates', parameterNames=list(names))

    def changes(self, name: str) -> list[Any]:
        """Return the values of a parameter that were told without being asked for."""
        return [
            each['value']
            for told in self.told
            if told['op'] == 'parameterValues' and 'id' not in told
            for each in told['parameters']
            if each['name'] == name
        ]

    def _summary(self) -> str:
        counts = {topic: (len(each), each[-1][0]) for topic, each in self.messages.items()}
        return f'number of messages and last time: {counts}'

    def _ask(self, operation: str, **fields: Any) -> dict[str, Any]:
        self._asked += 1
        name = f'{operation} {self._asked}'
        self._send(operation, id=name, **fields)

        def answers() -> list[dict[str, Any]]:
            return [each for each in self.told if each.get('id') == name]

        answer = self.until(answers, f'the answer to {operation}')[0]
        return {each['name']: each['value'] for each in answer['parameters']}

    def _send(self, operation: str, **fields: Any) -> None:
        self._connection.send(json.dumps({'op': operation, **fields}))

    def _take(self, message: str | bytes) -> None:
        if isinstance(message, str):
            told = json.loads(message)
            if told['op'] == 'advertise':
                self._subscribe(told['channels'])
            else:
                self.told.append(told)
        elif message[0] == 1:
            _, subscription, stamp = _MESSAGE.unpack_from(message)
            found = self.messages.setdefault(self._topics[subscription], [])
            found.append((stamp, message[_MESSAGE.size:]))
        elif message[0] == 4:
            _, number, is_refused, size = _ASSET.unpack_from(message)
            self._assets[number] = bool(is_refused), message[_ASSET.size + size:]
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
    """Yield a viewer of the server at a port of this machine."""
    with connect(
        f'ws://127.0.0.1:{port}',
        subprotocols=[PROTOCOL],
        max_size=None,
        # Else the answer to its leave waits behind what nobody takes any more.
        max_queue=None,
        open_timeout=PATIENCE,
    ) as connection:
        yield Viewer(connection)
