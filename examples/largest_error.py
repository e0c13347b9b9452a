# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A custom node: it reads a topic of the controller, and prints the largest error.

Start it before the nodes of the suite or while they run, in the same ROS domain. It prints a line
for each second of the robot's time, and ends 2 s after the last message.
"""

from __future__ import annotations

import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

STAMP = 2
"""Numbers before the data: seconds and nanoseconds of the state that they belong to."""

PATIENCE = 2.0
"""Time in s without messages after which the run has ended."""


class LargestError(Node):
    """Node that prints the largest tracking error of each second."""

    def __init__(self) -> None:
        """Subscribe to the errors of the task coordinates."""
        super().__init__('largest_error')
        self._second: int | None = None
        self._largest = 0.0
        self.is_over = False
        self.create_subscription(
            Float64MultiArray, 'controller/tracking_error', self._on_error, 10
        )
        self._timer = self.create_timer(PATIENCE, self._on_silence)

    def _on_error(self, message: Float64MultiArray) -> None:
        self._timer.reset()
        second = int(message.data[0])
        if self._second is not None and second != self._second:
            self._print()
        self._second = second
        self._largest = max(self._largest, *map(abs, message.data[STAMP:]))

    def _on_silence(self) -> None:
        if self._second is not None:
            self._print()
            self.is_over = True

    def _print(self) -> None:
        print(f'{self._second} s: {1000.0 * self._largest:.3g} mm', flush=True)
        self._largest = 0.0


if __name__ == '__main__':
    rclpy.init()
    node = LargestError()
    while not node.is_over:
        rclpy.spin_once(node)
    rclpy.shutdown()
