# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Latched topics: a late-joining subscription gets the last message only, all others every message.

A transient-local publisher has one history for two purposes: past messages for late-joining
subscriptions, and repetition of lost messages. A publisher of depth 1 drops a message that
another one replaces, even if a subscription has not received it (ros2/rmw_fastrtps issue 338,
"Reliable publisher/subscriber-connection drops messages in high frequency scenarios"). So
`Latched` sends the next message when all subscriptions have confirmed the last one. This file
can be removed when ROS 2 has a separate depth for past messages (the DDS policy
DURABILITY_SERVICE).
"""

from __future__ import annotations

from collections import deque
import time

from rclpy.duration import Duration
from rclpy.publisher import Publisher

_PATIENCE = 4.0
"""Time in s after which a subscription without a confirmation is considered dead.

Fast DDS repeats a lost message with its heartbeat, up to 3 s later.
"""

_NO_WAIT = Duration()


class Latched:
    """A publisher of depth 1 that loses no message to its current subscriptions."""

    def __init__(self, publisher: Publisher) -> None:
        """Initialise with a transient-local publisher of depth 1."""
        self._publisher = publisher
        self._waiting: deque[object] = deque()
        self._sent = -_PATIENCE
        self._is_confirmed = True

    @property
    def topic_name(self) -> str:
        """Full name of the topic."""
        return str(self._publisher.topic_name)

    def publish(self, message: object) -> None:
        """Send a message, or keep it until the previous one has arrived."""
        self._waiting.append(message)
        self.send_waiting()

    def send_waiting(self) -> None:
        """
        Send the next waiting messages if the last one has arrived; to be called periodically.

        A subscription without a confirmation delays the others once, not at every message.
        """
        while self._waiting and (self._has_arrived() or self._has_waited_enough()):
            self._publisher.publish(self._waiting.popleft())
            if self._is_confirmed:
                self._sent = time.monotonic()
            self._is_confirmed = False

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        """Deliver all messages within a time; return True if all were confirmed."""
        limit = time.monotonic() + timeout.nanoseconds * 1e-9
        while True:
            left = max(0.0, limit - time.monotonic())
            self._is_confirmed = self._publisher.wait_for_all_acked(Duration(seconds=left))
            if not self._waiting:
                return self._is_confirmed
            self._publisher.publish(self._waiting.popleft())

    def _has_arrived(self) -> bool:
        self._is_confirmed = self._is_confirmed or self._publisher.wait_for_all_acked(_NO_WAIT)
        return self._is_confirmed

    def _has_waited_enough(self) -> bool:
        return time.monotonic() - self._sent > _PATIENCE
