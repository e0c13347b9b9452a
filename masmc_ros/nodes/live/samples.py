# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The latest message of topics that come every tick, looked at now and then.

A viewer needs no 1 kHz. The middleware keeps the latest message and throws the others away
by itself; no Python runs for them, and the senders are not held up: they are not asked to
send anything again.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

_LATEST = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


class Samples:
    """Subscriptions without callbacks, on a hidden node that no executor turns."""

    def __init__(self, node: Node) -> None:
        """Create the hidden node in the context and namespace of `node`."""
        self._node = Node(
            f'_{node.get_name()}_samples',
            context=node.context,
            namespace=node.get_namespace(),
            # The names that are subscribed to are resolved already.
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._subscriptions: dict[str, Subscription] = {}

    def add(self, message_type: Any, topic: str) -> None:
        """Take a topic by its full name."""
        self._subscriptions[topic] = self._node.create_subscription(
            message_type, topic, lambda _: None, _LATEST, raw=True
        )

    def take(self) -> Iterator[tuple[str, bytes]]:
        """Yield topics that have a new message, each with its latest one."""
        for topic, subscription in self._subscriptions.items():
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                yield topic, taken[0]

    def close(self) -> None:
        """Leave."""
        self._node.destroy_node()
