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

"""A topic of the exchange within a process: who listens, what waits for them, what was sent."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile

Take = Callable[[Any], None]


class Inbox:
    """Messages that wait for a subscription's callback; the oldest go where there is no room."""

    def __init__(self, callback: Take, depth: int) -> None:
        """Take what is called, and how many messages may wait."""
        self._callback = callback
        self.waiting: deque[bytes] = deque(maxlen=depth)

    def take(self) -> None:
        """Hand over the oldest message, unless it has gone."""
        if self.waiting:
            self._callback(self.waiting.popleft())


class Topic:
    """
    Who of this process listens to a topic, and what was sent to it from here.

    Attributes
    ----------
    with_past
        number of those who listen and asked for the past.

    """

    def __init__(self, due: deque[Inbox]) -> None:
        """Take the queue of inboxes whose turn comes."""
        self._due = due
        self.with_past = 0
        self._inboxes: list[Inbox] = []
        self._pasts: list[deque[bytes]] = []

    def past(self, depth: int) -> deque[bytes]:
        """Return where a transient-local publisher keeps its last messages."""
        self._pasts.append(deque(maxlen=depth))
        return self._pasts[-1]

    def listen(self, callback: Take, qos: QoSProfile) -> Callable[[], None]:
        """Hand every message to a callback from now on; return what ends that."""
        inbox = Inbox(callback, qos.depth)
        self._inboxes.append(inbox)
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            inbox.waiting.extend(raw for past in self._pasts for raw in past)
            self._due.extend([inbox] * len(inbox.waiting))
            self.with_past += 1
        return partial(self._leave, inbox, qos.durability)

    def send(self, raw: bytes) -> None:
        """Hand a message to everybody who listens."""
        for inbox in self._inboxes:
            inbox.waiting.append(raw)
            self._due.append(inbox)

    def _leave(self, inbox: Inbox, durability: DurabilityPolicy) -> None:
        self._inboxes.remove(inbox)
        self.with_past -= durability == DurabilityPolicy.TRANSIENT_LOCAL
