# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Subscriptions to past messages that also match publishers without any.

DDS does not match a transient-local subscription with a volatile publisher, not even for new
messages (discussed in ros2/rclcpp pull request 2499). `DurabilityPolicy.BEST_AVAILABLE` of rclpy
looks at the publishers once, when the subscription is created. This file can be removed when
one subscription gets past messages from the publishers that have them, and new ones from all.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.nodes.middleware.qos import DEEP, subscription_qos
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node


def subscribe_with_past(
    node: Node,
    message_type: Any,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
) -> None:
    """
    Subscribe raw to a topic, with the past messages of its transient-local publishers.

    When a volatile publisher appears, a second, volatile subscription serves it. A message that
    arrives at both subscriptions is passed on once.

    Parameters
    ----------
    node
        the node that subscribes.
    message_type
        class of the messages.
    topic
        name of the topic.
    callback
        called with the bytes of each message.
    depth
        number of messages that wait for the callback, the latest ones.

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
        """Numbers of messages with one copy so far, from that subscription, by hash."""
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
