# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A node's health once a second on /diagnostics, as rqt_robot_monitor and Foxglove show it."""

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
    """What a node says of itself: how bad it is, in a word, and figures."""

    level: bytes
    message: str
    values: Mapping[str, str]


def senders(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, one for each publisher."""
    return [
        f'{each.node_namespace.rstrip("/")}/{each.node_name}'
        for each in node.get_publishers_info_by_topic(topic)
    ]


def publish_health(
    node: Node, publisher: Latched, clock: Clock, health: Callable[[], Health]
) -> None:
    """Publish a node's health once a second by a clock that never stands still."""
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
