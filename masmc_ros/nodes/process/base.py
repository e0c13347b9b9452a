# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Base of the nodes of this package: parameters, their records, publishers, waiting and diagnostics.

Nodes report on /diagnostics, and count rejected messages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
import signal
import time
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from masmc_ros.control.actions import Record, Throttle
from masmc_ros.errors import InputError, UserError
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.nodes.middleware.ros_topics import DEEP, Latched, publisher_qos
from masmc_ros.nodes.parameters.ros_parameters import ParameterNode, RosParameters
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.params.declaration import Values
from masmc_ros.scenario.node_parameters import declared
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import String


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


_DELIVERY = 5.0
"""Longest time in s for the delivery of all messages at the end."""

_PATIENCE = 3.0
"""Time in s after which the node logs the reason why it waits."""

_REMINDER = 5.0
"""Time in s between two such log lines."""

_RETRY = 0.02
"""Time in s between two attempts to send waiting messages of latched topics."""


class SuiteNode:
    """
    Base class of the nodes: a ROS 2 node with its parameters.

    Attributes
    ----------
    name
        Name of the node and of its block in parameter files.
    follows
        True if the node ends with the other nodes of its process.
    node
        ROS 2 node.
    finished
        True if the run of this node is over.
    failure
        Error that ended the node; None without one.
    parameters, values
        Parameters and their current checked values.
    log
        Logger of the node.
    steady
        Monotonic clock, for timers.

    """

    name: str
    follows = False

    def __init__(
        self,
        *,
        context: Context,
        command_line: CommandLine,
        check: Callable[[Values], None] = lambda _: None,
    ) -> None:
        """
        Create the node and declare its parameters.

        Parameters
        ----------
        context
            Context of the process.
        command_line
            Files and settings with the start values of the parameters.
        check
            Function that raises InputError for invalid combinations of parameters.

        Raises
        ------
        InputError
            If a parameter is invalid, or if a remapping changes the name of the node.

        """
        self.node: Node = ParameterNode(
            self.name, context=context, command_line=command_line
        )
        remapped = self.node.get_name()
        if remapped != self.name:
            raise InputError(
                f'__node:={remapped}: topics, files and other nodes know this one as {self.name}; '
                f'put it into a namespace instead, as in -r __ns:=/{remapped}'
            )
        self.finished = False
        self.parameters = RosParameters(
            self.node,
            partial(declared, self.name),
            command_line=command_line,
            check=check,
        )
        self.values = self.parameters.values
        self.log = self.node.get_logger()
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._publishers: list[Publisher] = []
        self._latched: list[Latched] = []
        self._waiting: str | None = None
        self._waiting_since = 0.0
        self._reminded = 0.0
        self.failure: UserError | None = None

    def publisher(
        self, message_type: type, topic: str, depth: int = DEEP, *, past: bool = True
    ) -> Publisher:
        """
        Create a publisher whose messages are delivered before the node ends.

        With `past`, a late-joining subscription gets the last `depth` messages.
        """
        qos = publisher_qos(depth, past=past)
        publisher = self.node.create_publisher(message_type, topic, qos)
        self._publishers.append(publisher)
        return publisher

    def stream(self, message_type: type, topic: str) -> Publisher:
        """Create a publisher of messages at every tick, without past messages."""
        return self.publisher(message_type, topic, past=False)

    def latched(self, message_type: type, topic: str) -> Latched:
        """Create a publisher of messages that are valid until the next one."""
        latched = Latched(self.publisher(message_type, topic, 1))
        self._latched.append(latched)
        return latched

    def connect(self) -> None:
        """Publish the parameters and start the timers."""
        self._record = self.latched(String, '~/parameters')
        self.record_parameters(Record(0, 0, self.values))
        self.node.create_timer(1.0, self._remind, clock=self.steady)
        self.node.create_timer(_RETRY, self._send_waiting, clock=self.steady)

    def record_parameters(self, record: Record) -> None:
        """Publish parameters, or an event, with the first tick that is computed with them."""
        tick, stamp, values, changed, event = record
        node = self.node.get_fully_qualified_name()
        message = ParameterRecord(node, tick, stamp, dict(values), changed, event)
        self._record.publish(String(data=message.to_text()))

    def wait(self, reason: str | None) -> None:
        """Set the reason why the node waits, None if it does not; it is logged after 3 s."""
        if reason is not None and self._waiting is None:
            self._waiting_since = self._reminded = time.monotonic()
        self._waiting = reason

    def close(self, spin: Callable[[], None]) -> None:
        """
        Deliver all published messages to the current subscriptions; raise `failure`, if any.

        The time is bounded, because DDS keeps a killed subscription for a while. The node is
        finished from here on: its timers and subscriptions have no effect while other nodes of
        the process handle their last messages by `spin`.
        """
        self.finished = True
        limit = time.monotonic() + _DELIVERY
        publishers: list[Latched | Publisher] = [*self._latched, *self._publishers]
        for publisher in publishers:
            left = max(0.0, limit - time.monotonic())
            publisher.wait_for_all_acked(Duration(seconds=left))
        if self.failure is not None:
            raise self.failure

    def fail(self, error: UserError) -> None:
        """
        End the process with status 2, and this error as one line after the delivery.

        An exception from a callback would end it too, but the executor writes a traceback.
        """
        if self.failure is None:
            self.failure = UserError(f'{self.name}: {error}')
            self.finished = True
            # The signal ends the other nodes of the process as well.
            signal.raise_signal(signal.SIGTERM)

    def _send_waiting(self) -> None:
        for latched in self._latched:
            latched.send_waiting()

    def _remind(self) -> None:
        now = time.monotonic()
        if self.finished or self._waiting is None or now - self._waiting_since < _PATIENCE:
            return
        if self._reminded > self._waiting_since and now - self._reminded < _REMINDER:
            return
        self._reminded = now
        self.log.info(f'waiting for {self._waiting} ({now - self._waiting_since:.0f} s)')
