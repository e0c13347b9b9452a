# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Periodic samples of topics with a message at every tick.

A viewer does not need 1 kHz. The middleware keeps the latest message and discards the others
without Python. The subscriptions are best-effort, so the senders repeat nothing for them.
"""

from __future__ import annotations

from collections.abc import Iterator

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

_LATEST = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


class Sampler:
    """Subscriptions without callbacks, on a hidden node without an executor."""

    def __init__(self, node: Node) -> None:
        """Create the hidden node in the context and namespace of `node`."""
        self._node = Node(
            f'_{node.get_name()}_samples',
            context=node.context,
            namespace=node.get_namespace(),
            # The names of the topics are already resolved.
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._subscriptions: dict[str, Subscription] = {}

    def add(self, message_type: type, topic: str) -> None:
        """Subscribe to a topic by its full name."""
        self._subscriptions[topic] = self._node.create_subscription(
            message_type, topic, lambda _: None, _LATEST, raw=True
        )

    def take(self) -> Iterator[tuple[str, bytes]]:
        """Yield topics that have a new message, each with its latest one."""
        for topic, subscription in self._subscriptions.items():
            with subscription.handle:
                result = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if result is not None:
                yield topic, result[0]

    def close(self) -> None:
        """Destroy the hidden node."""
        self._node.destroy_node()
