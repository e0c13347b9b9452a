# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Subscription to the reference: overlapping windows, and set-points."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.errors import InputError
from masmc_ros.messages.names import REFERENCE_TOPIC
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.process.rejected_messages import RejectedMessages
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray


class ReferenceInput:
    """Subscription to the reference topic."""

    def __init__(
        self,
        node: Node,
        axes: int,
        rejected_messages: RejectedMessages,
        on_reference: Callable[[ReferenceWindow], None],
    ) -> None:
        """
        Subscribe to the topic.

        Parameters
        ----------
        node
            Node of the subscription.
        axes
            Number of task axes.
        rejected_messages
            Counts of rejected messages.
        on_reference
            Function that is called with each window; its InputError rejects the message.

        """
        self._axes = axes
        self._rejected_messages = rejected_messages
        self._on_reference = on_reference
        subscribe_with_past(node, Float64MultiArray, REFERENCE_TOPIC, self._take, depth=100)

    def _take(self, raw: bytes) -> None:
        try:
            window = ReferenceWindow.from_bytes(raw, self._axes)
            if window is None:
                message = deserialized(raw, Float64MultiArray)
                window = ReferenceWindow.from_message(message, self._axes)
            self._on_reference(window)
        except InputError as error:
            self._rejected_messages.add(REFERENCE_TOPIC, error)
