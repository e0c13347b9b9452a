# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Subscriptions to past messages that also match publishers without any, and best-effort ones.

DDS does not match a transient-local subscription with a volatile publisher, not even for new
messages (discussed in ros2/rclcpp pull request 2499). `DurabilityPolicy.BEST_AVAILABLE` of rclpy
looks at the publishers once, when the subscription is created. This file can be removed when
one subscription gets past messages from the publishers that have them, and new ones from all.

A reliable subscription does not match a best-effort publisher, such as a driver with the profile
of sensor data. A best-effort one matches all publishers, but loses messages. It is therefore
created only when a best-effort publisher appears, and the reliable one with the past remains.
"""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.nodes.middleware.qos import DEEP, subscription_qos
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node


def subscribe(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
    on_matched: Callable[[], object] | None = None,
) -> None:
    """
    Subscribe raw to the new messages of all publishers of a topic.

    When a best-effort publisher appears, a best-effort subscription replaces the reliable one.
    The parameters are those of `subscribe_with_past`.
    """
    subscriptions: list[object] = []

    def serve(*, best_effort: bool) -> None:
        position = len(subscriptions)

        def take(raw: bytes) -> None:
            # The best-effort subscription receives the messages of all publishers.
            if position == len(subscriptions) - 1:
                callback(raw)

        qos = subscription_qos(depth=depth, best_effort=best_effort)
        events = None if best_effort else _events(serve_best_effort, on_matched)
        subscriptions.append(
            node.create_subscription(
                message_type, topic, take, qos, raw=True, event_callbacks=events
            )
        )

    def serve_best_effort(_: object) -> None:
        if len(subscriptions) == 1:
            serve(best_effort=True)

    serve(best_effort=False)


def subscribe_with_past(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
    on_matched: Callable[[], object] | None = None,
) -> None:
    """
    Subscribe raw to a topic, with the past messages of its transient-local publishers.

    When a volatile publisher appears, a second subscription, that of `subscribe`, serves it. A
    message that arrives at both is passed on once.

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
    on_matched
        Function that is called when a publisher appears or disappears.

    """
    has_second = False
    duplicates = _DuplicateFilter(callback, 2 * DEEP)

    def on_past(raw: bytes) -> None:
        if has_second:
            duplicates.process(raw, duplicates.by_past, duplicates.by_volatile)
        else:
            callback(raw)

    def on_volatile(raw: bytes) -> None:
        duplicates.process(raw, duplicates.by_volatile, duplicates.by_past)

    def serve_volatile(_: object) -> None:
        nonlocal has_second
        if not has_second:
            has_second = True
            subscribe(node, message_type, topic, on_volatile, depth, on_matched)

    node.create_subscription(
        message_type,
        topic,
        on_past,
        subscription_qos(depth=depth, past=True),
        raw=True,
        event_callbacks=_events(serve_volatile, on_matched),
    )


def _events(
    incompatible_qos: Callable[[object], None], on_matched: Callable[[], object] | None
) -> SubscriptionEventCallbacks:
    def on_match(_: object) -> None:
        if on_matched is not None:
            on_matched()

    return SubscriptionEventCallbacks(
        incompatible_qos=incompatible_qos,
        matched=None if on_matched is None else on_match,
        use_default_callbacks=False,
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
