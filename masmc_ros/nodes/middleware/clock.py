# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A node that survives wrong messages on /clock.

The time source of rclpy 7 raises ValueError for a negative time, and a typed subscription
raises for bytes that are not a message. An exception from a callback ends the executor. This
file can be removed when rclpy's time source rejects such messages itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.nodes.middleware.ros_topics import deserialized
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

_PERIOD = 1.0
"""Time in s between two log lines about rejected messages."""


def clock_reader(callback: Callable[[Clock], None], log: RcutilsLogger) -> Callable[[bytes], None]:
    """Return a callback for raw messages that passes on valid times and logs the others."""

    def read(raw: bytes) -> None:
        try:
            message = deserialized(raw, Clock)
            if message.clock.sec < 0:
                raise InputError(f'{message.clock.sec} s is negative; expected >= 0')
        except InputError as error:
            log.error(f'/clock rejected: {error}', throttle_duration_sec=_PERIOD)
            return
        callback(message)

    return read


class CheckedClockNode(Node):
    """A node whose subscriptions to Clock, such as rclpy's time source, get only valid times."""

    def create_subscription(
        self,
        msg_type: type,
        topic: str,
        callback: Callable[[Any], None],
        *arguments: object,
        raw: bool = False,
        **options: object,
    ) -> Any:
        """Create a subscription as `Node` does."""
        if msg_type is Clock and not raw:
            callback, raw = clock_reader(callback, self.get_logger()), True
        create: Any = super().create_subscription
        return create(msg_type, topic, callback, *arguments, raw=raw, **options)
