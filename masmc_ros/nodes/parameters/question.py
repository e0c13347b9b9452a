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

_AGAIN = 1.0
"""Time in s after which the request is made again."""


class Question:
    """For requests that may be carried out twice; looked after by who waits for the answer."""

    def __init__(self, ask: Callable[[], Future]) -> None:
        """Ask for the first time; `ask` makes the request."""
        self._ask = ask
        self._futures = [ask()]
        self._asked = time.monotonic()

    def answer(self) -> Any:
        """Return the response, None while there is none."""
        for future in self._futures:
            if future.done():
                return future.result()
        if time.monotonic() - self._asked > _AGAIN:
            self._futures.append(self._ask())
            self._asked = time.monotonic()
        return None
