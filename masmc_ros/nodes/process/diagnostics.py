# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reports of a node on /diagnostics, and counts of rejected messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
import time
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from masmc_ros.control.actions import Throttle
from masmc_ros.nodes.middleware.topics import Latched
from rclpy.clock import Clock
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node


class RejectedMessages:
    """
    Count and log of messages that a node rejects or cannot read.

    Attributes
    ----------
    counts
        Number of rejected messages by topic.

    """

    def __init__(self, log: RcutilsLogger, effect: str = 'rejected') -> None:
        """Initialise with the node's logger and the effect on such a message, for the log."""
        self._log = log
        self._effect = effect
        self._throttle = Throttle(period=1.0)
        self.counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Return the number of rejected messages of all topics."""
        return sum(self.counts.values())

    def figures(self) -> dict[str, str]:
        """Return the counts by topic for /diagnostics."""
        return {f'{topic} rejected': str(count) for topic, count in self.counts.items()}

    def add(self, topic: str, reason: object) -> None:
        """Count a message of a topic; log the reason unless the last line is less than 1 s old."""
        self.counts[topic] += 1
        if self._throttle.is_due(topic, time.monotonic()):
            self._log.error(f'{topic} {self._effect}: {reason}')


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


def several_senders(node: Node, topics: Sequence[str]) -> dict[str, list[str]]:
    """Return the senders of those relative topics that have more than one publisher."""
    named = {topic: senders(node, node.resolve_topic_name(topic)) for topic in topics}
    return {topic: names for topic, names in named.items() if len(names) > 1}


def senders_text(named: Mapping[str, Sequence[str]]) -> str:
    """Return topics with their senders in one line."""
    return '; '.join(f'{topic} from {" and ".join(names)}' for topic, names in named.items())


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
