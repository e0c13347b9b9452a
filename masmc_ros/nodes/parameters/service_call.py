# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A service request that is repeated until a response arrives.

rmw_fastrtps drops the response to a client that the server does not discover within 0.1 s. This
happens if a client sends its request as soon as it has discovered the server (ros2/ros2 issue
1253). This file can be removed when a server waits for the client or reports the loss to it.
"""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from rclpy.task import Future

_RETRY = 1.0
"""Time in s after which the request is sent again."""


class ServiceCall:
    """
    A service request that the server may process twice.

    The caller polls `response`, which also repeats the request.
    """

    def __init__(self, send: Callable[[], Future]) -> None:
        """Send the request for the first time, by `send`."""
        self._send = send
        self._futures = [send()]
        self._sent = time.monotonic()

    def response(self) -> Any:
        """Return the response, or None before it arrives."""
        for future in self._futures:
            if future.done():
                return future.result()
        if time.monotonic() - self._sent > _RETRY:
            self._futures.append(self._send())
            self._sent = time.monotonic()
        return None
