# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A publisher of bytes, to its own process past the middleware where there is an exchange.

What is sent tick by tick and kept for who joins late is an eighth of a tick in one process, in
the middleware, though nobody outside may ever listen. Such a publisher keeps its past itself
until the first listener outside is there; from then on the middleware is given everything.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Any

from masmc_ros.nodes.middleware.topic import Topic
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message

_AT_A_TICK = 4
"""Messages of the past that go with each new one: more than one, so that they end."""

_AT_ONCE = 50
"""Messages of the past that go at a time otherwise, lest ticks wait for milliseconds."""


class ExchangePublisher(Publisher):
    """A publisher whose messages go to this process by an exchange, if there is one."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Take what rclpy gives a publisher."""
        super().__init__(*arguments, **options)
        # rclpy asks for the message's type and locks the publisher at every call, which takes
        # longer than to send what is bytes already.
        self._send = self.handle.publish_raw
        self._count = self.handle.get_subscription_count
        self._is_latched = self.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self._hand_over: Callable[[bytes], None] | None = None
        self._held: _Held | None = None

    def join(self, topic: Topic) -> None:
        """Send by an exchange too."""
        self._topic, self._hand_over = topic, topic.send
        if self._is_latched:
            self._past = topic.past(self.qos_profile.depth)

    def hold_past(self, node: Node) -> None:
        """
        Give the middleware nothing before there is a listener outside; `send_waiting` looks.

        For a transient-local publisher of a node in a process with an exchange; for any other
        it does nothing.
        """
        if self._hand_over is not None and self._is_latched:
            self._held = _Held(self._past, self._wants_past(node))

    def publish(self, msg: Any) -> None:
        """Send a message or its bytes."""
        raw = msg if type(msg) is bytes else serialize_message(msg)
        if self._hand_over is not None:
            self._hand_over(raw)
            if self._is_latched:
                self._past.append(raw)
            if self._held is not None:
                self._held.new += 1
                if self._held.has_begun:
                    self._send_held(_AT_A_TICK)
                return
        # The middleware keeps what is latched for who comes later.
        if self._is_latched or self._count():
            self._send(raw)

    def send_waiting(self) -> None:
        """Send some of what is held, where somebody outside listens by now. Called often."""
        if self._held is None:
            return
        if not self._count():
            self._held.look()
            return
        self._held.begin()
        self._send_held(_AT_ONCE)

    def wait_for_all_acked(self, timeout: Duration | None = None) -> bool:
        """Deliver everything within a time; tell whether it was confirmed."""
        if self._held is not None and self._count():
            self._held.begin()
            self._send_held(len(self._past))
        return bool(super().wait_for_all_acked(timeout or Duration(seconds=-1)))

    def _send_held(self, most: int) -> None:
        assert self._held is not None
        for raw in self._held.taken(most):
            self._send(raw)
        if not self._held.count:
            self._held = None

    def _wants_past(self, node: Node) -> Callable[[], bool]:
        """Return what tells whether anybody outside of this process asks for the past."""

        def wants() -> bool:
            found = node.get_subscriptions_info_by_topic(self.topic_name)
            asked = [each.qos_profile.durability for each in found]
            return asked.count(DurabilityPolicy.TRANSIENT_LOCAL) > self._topic.with_past

        return wants


class _Held:
    """
    How many of the last messages the middleware has not been given.

    Attributes
    ----------
    new
        sent since it was looked last whether somebody listens: who does may wait for them.
    has_begun
        whether somebody does.

    """

    def __init__(self, past: deque[bytes], wants_past: Callable[[], bool]) -> None:
        self._past = past
        self._wants_past = wants_past
        self._old = 0
        self.new = 0
        self.has_begun = False

    @property
    def count(self) -> int:
        return min(self._old + self.new, len(self._past))

    def look(self) -> None:
        """Note that nobody listens yet."""
        self._old, self.new = self.count, 0

    def begin(self) -> None:
        """Let what is old be sent where somebody asks for it, or never."""
        if not self.has_begun:
            self.has_begun = True
            if self._old and not self._wants_past():
                self._old = 0

    def taken(self, most: int) -> list[bytes]:
        """Return the oldest messages, which are sent now."""
        count = self.count
        begin = len(self._past) - count
        some = list(islice(self._past, begin, begin + most))
        self._old, self.new = 0, count - len(some)
        return some
