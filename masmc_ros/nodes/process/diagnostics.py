# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reports of a node on /diagnostics, once a second, for rqt_robot_monitor and Foxglove."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from masmc_ros.nodes.middleware.latched import Latched
from rclpy.clock import Clock
from rclpy.node import Node

PERIOD = 1.0
"""Time in s between two reports."""

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


class Health(NamedTuple):
    """Report of a node: level, message and figures by name."""

    level: bytes
    message: str
    values: Mapping[str, str]


def senders(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, one for each publisher."""
    return [
        f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
        for publisher in node.get_publishers_info_by_topic(topic)
    ]


def publish_health(
    node: Node, publisher: Latched, clock: Clock, health: Callable[[], Health]
) -> None:
    """
    Publish the health of a node once a second.

    Parameters
    ----------
    node
        Node of the report.
    publisher
        Publisher on /diagnostics.
    clock
        Clock of the timer; a steady one, because simulated time may stop.
    health
        Function that returns the report.

    """
    name = node.get_fully_qualified_name()

    def publish() -> None:
        level, message, values = health()
        status = DiagnosticStatus(
            level=level,
            name=name,
            message=message,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        report = DiagnosticArray(status=[status])
        report.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(report)

    node.create_timer(PERIOD, publish, clock=clock)
