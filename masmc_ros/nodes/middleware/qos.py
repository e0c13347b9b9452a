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
Quality of service: reliable throughout, publishers and loggers deep, control shallow.

States, commands and the reference are transient-local, so that a node that joins late or
again takes up where the run is; a subscription asks for that only where it wants the past.
What holds until the next message is latched (`latched.py`), telemetry is volatile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

DEEP = 1000


def publisher_qos(depth: int = DEEP, *, past: bool = True) -> QoSProfile:
    """Return the profile of publishers: reliable; with `past`, transient-local."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


def subscription_qos(
    *, depth: int = 1, past: bool = False, best_effort: bool = False
) -> QoSProfile:
    """
    Return the profile of subscriptions: reliable; with `past`, transient-local.

    `best_effort` is for senders that are no better than that.
    """
    kind = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    return QoSProfile(
        depth=depth,
        reliability=kind,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


def subscribe_with_past(
    node: Node,
    message_type: Any,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
) -> None:
    """
    Subscribe raw to a topic, with what was sent before where its publishers offer that.

    A transient-local subscription does not match a volatile publisher. When one turns up, a
    second, volatile subscription serves it; what then comes to both is passed on once.
    """
    volatile: list[Any] = []
    once = _Once(callback, 2 * DEEP)

    def take_past(raw: Any) -> None:
        if volatile:
            once.take(raw, once.by_past, once.by_volatile)
        else:
            callback(raw)

    def take_volatile(raw: Any) -> None:
        once.take(raw, once.by_volatile, once.by_past)

    def serve_volatile(_: Any) -> None:
        if not volatile:
            qos = subscription_qos(depth=depth)
            volatile.append(
                node.create_subscription(message_type, topic, take_volatile, qos, raw=True)
            )

    node.create_subscription(
        message_type,
        topic,
        take_past,
        subscription_qos(depth=depth, past=True),
        raw=True,
        event_callbacks=SubscriptionEventCallbacks(
            incompatible_qos=serve_volatile, use_default_callbacks=False
        ),
    )


class _Once:
    """
    Passes on what two subscriptions to one topic receive, every message once.

    Messages of latched publishers come to both, in any order; those of volatile publishers
    come to the volatile one alone. A copy is known by the hash of its bytes, which takes little
    memory whatever the size of the message: as many of the same are passed on as the one that
    received more of them has received.
    """

    def __init__(self, callback: Callable[..., None], most: int) -> None:
        self._callback = callback
        self._most = most
        self.by_past: dict[int, int] = {}
        """Number of messages of which only the first copy has come, from that subscription."""
        self.by_volatile: dict[int, int] = {}

    def take(self, raw: bytes, mine: dict[int, int], others: dict[int, int]) -> None:
        """Pass a message on unless the other subscription has brought it already."""
        key = hash(raw)
        count = others.pop(key, 0)
        if count:
            if count > 1:
                others[key] = count - 1
            return
        mine[key] = mine.get(key, 0) + 1
        if len(mine) > self._most:
            del mine[next(iter(mine))]
        self._callback(raw)
