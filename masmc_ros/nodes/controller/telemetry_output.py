# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Telemetry of the controller: one topic for each signal of a tick."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.messages.names import telemetry_topic
from masmc_ros.messages.telemetry import TelemetryCdr
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray


class ControllerTelemetry:
    """Publishers of the signals."""

    def __init__(
        self, controller: Controller, decimation: int, advertise: Callable[[type, str], Publisher]
    ) -> None:
        """Create the topics by `advertise`; none if the decimation is 0."""
        signals = (
            (signal.label, controller.signals[signal.name].reshape(-1))
            for signal in PUBLISHED
            if not (signal.of_torques and controller.commands_rates)
        )
        self._topics = [
            (
                advertise(Float64MultiArray, telemetry_topic(label)),
                TelemetryCdr(label, len(values)).writer(values),
            )
            for label, values in signals
            if decimation
        ]

    def send(self, stamp: int) -> None:
        """Publish the signals of the tick whose state has a stamp in ns."""
        for publisher, to_bytes in self._topics:
            publisher.publish(to_bytes(stamp))
