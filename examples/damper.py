# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A controller in another process: a node that answers states with torques.

Start it, then compare it with laws, in the same ROS domain:

    masmc compare config/paper.yaml --laws smc:implicit --trials ideal --controller topics:damper

It only brakes the joints, so it follows no path; the torques are where a real one computes.
"""

from __future__ import annotations

from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

DAMPING = 0.5
"""Torque over velocity of a joint in N·m·s/rad."""

JOINTS = 4
"""Number of driven joints, the last ones of a state."""


class Damper(Node):
    """Node that brakes the driven joints."""

    def __init__(self) -> None:
        """Subscribe to states and references; each state is answered once."""
        super().__init__('damper')
        self._torques = self.create_publisher(Float64MultiArray, 'effort_commands', 10)
        self.create_subscription(Float64MultiArray, 'reference', self._on_reference, 1)
        self.create_subscription(JointState, 'joint_states', self._on_state, 1)

    def _on_reference(self, message: Float64MultiArray) -> None:
        """Store x_d and its two derivatives, after seconds, nanoseconds and period."""
        self.reference = message.data[3:]

    def _on_state(self, state: JointState) -> None:
        if state.header.stamp.sec == state.header.stamp.nanosec == 0:
            self.get_logger().info('a new run')  # a controller with memory forgets it here
        torques = [-DAMPING * velocity for velocity in state.velocity[-JOINTS:]]
        self._torques.publish(Float64MultiArray(data=torques))


if __name__ == '__main__':
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Damper())
