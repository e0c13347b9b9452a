# SPDX-License-Identifier: Apache-2.0
"""What the controller tells of its ticks: a topic for each vector."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from masmc_ros.loop.controller import Controller
from masmc_ros.messages.names import telemetry_topic
from masmc_ros.messages.telemetry import TelemetryCdr


class ControllerTelemetry:
    """Publishes errors, sliding surface, theta_hat and the torque before its limits."""

    def __init__(
        self, controller: Controller, decimation: int, advertise: Callable[[Any, str], Publisher]
    ) -> None:
        """Create the topics by `advertise`, none where every 0th tick is to be told."""
        vectors = {
            'tracking_error': controller.error,
            'sliding_surface': controller.surface,
            'parameter_estimate': controller.used_estimate,
        }
        if not controller.commands_rates:
            vectors['raw_torque'] = controller.raw_torque
        self._decimation = decimation
        self._topics = [
            (
                advertise(Float64MultiArray, telemetry_topic(label)),
                TelemetryCdr(label, len(values)),
                values,
            )
            for label, values in vectors.items()
            if decimation
        ]

    def send(self, tick: int, stamp: int) -> None:
        """Publish what the controller has computed at a tick with a stamp in ns."""
        if not self._topics or tick % self._decimation:
            return
        for publisher, message, values in self._topics:
            message.set_stamp(stamp)
            message.values[:] = values
            publisher.publish(message.to_bytes())
