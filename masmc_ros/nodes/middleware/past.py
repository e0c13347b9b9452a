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

from masmc_ros.nodes.middleware.qos import DEEP, subscription_qos
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node


def subscribe_with_past(
    node: Node,
    message_type: type,
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
        Node that subscribes.
    message_type
        Class of the messages.
    topic
        Name of the topic.
    callback
        Function that is called with the bytes of each message.
    depth
        Number of messages that wait for the callback; newer ones replace the oldest.

    """
    volatile: list[object] = []
    duplicates = _DuplicateFilter(callback, 2 * DEEP)

    def on_past(raw: bytes) -> None:
        if volatile:
            duplicates.process(raw, duplicates.by_past, duplicates.by_volatile)
        else:
            callback(raw)

    def on_volatile(raw: bytes) -> None:
        duplicates.process(raw, duplicates.by_volatile, duplicates.by_past)

    def serve_volatile(_: object) -> None:
        if not volatile:
            qos = subscription_qos(depth=depth)
            volatile.append(
                node.create_subscription(message_type, topic, on_volatile, qos, raw=True)
            )

    node.create_subscription(
        message_type,
        topic,
        on_past,
        subscription_qos(depth=depth, past=True),
        raw=True,
        event_callbacks=SubscriptionEventCallbacks(
            incompatible_qos=serve_volatile, use_default_callbacks=False
        ),
    )


class _DuplicateFilter:
    """
    Filter that passes on each message of two subscriptions to one topic once.

    Messages of transient-local publishers arrive at both subscriptions, in any order. Those of
    volatile publishers arrive at the volatile one only. A copy is recognised by the hash of its
    bytes, which takes little memory for messages of any size. Of several equal messages, as many
    are passed on as one subscription has received at most.
    """

    def __init__(self, callback: Callable[..., None], capacity: int) -> None:
        self._callback = callback
        self._capacity = capacity
        self.by_past: dict[int, int] = {}
        """Numbers of messages without a copy so far, by hash, of the transient-local one."""
        self.by_volatile: dict[int, int] = {}

    def process(self, raw: bytes, own: dict[int, int], other: dict[int, int]) -> None:
        """Pass a message on unless it is the copy of one from the other subscription."""
        key = hash(raw)
        count = other.pop(key, 0)
        if count:
            if count > 1:
                other[key] = count - 1
            return
        own[key] = own.get(key, 0) + 1
        if len(own) > self._capacity:
            del own[next(iter(own))]
        self._callback(raw)
