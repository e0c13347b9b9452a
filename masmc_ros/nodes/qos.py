# SPDX-License-Identifier: Apache-2.0
"""Quality of service: reliable throughout, publishers and loggers deep, control shallow.

Publishers are transient-local, so that a node that joins late or again takes up where the
run is. A subscription asks for that only where it wants the past.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

DEEP = 1000


def publisher_qos(depth: int = DEEP) -> QoSProfile:
    """Return the profile of publishers: reliable, transient-local."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def subscription_qos(*, depth: int = 1, past: bool = False) -> QoSProfile:
    """Return the profile of subscriptions: reliable; with `past`, transient-local."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


def subscribe_with_past(
    node: Node,
    message_type: Any,
    topic: str,
    callback: Callable[..., None],
    depth: int = 1,
) -> None:
    """Subscribe raw to a topic, with what was sent before where its publishers offer that.

    A transient-local subscription does not match a volatile publisher. When one turns up, a
    second, volatile subscription serves it.
    """
    volatile: list[Any] = []

    def serve_volatile(_: Any) -> None:
        if not volatile:
            qos = subscription_qos(depth=depth)
            volatile.append(node.create_subscription(message_type, topic, callback, qos, raw=True))

    node.create_subscription(
        message_type,
        topic,
        callback,
        subscription_qos(depth=depth, past=True),
        raw=True,
        event_callbacks=SubscriptionEventCallbacks(
            incompatible_qos=serve_volatile, use_default_callbacks=False
        ),
    )
