# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What the nodes of this package have in common: parameters, their record, and waiting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
import signal
import time
from typing import Any, NamedTuple

from masmc_ros.errors import InputError, UserError
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.nodes.middleware.latched import Latched
from masmc_ros.nodes.middleware.qos import DEEP, publisher_qos
from masmc_ros.nodes.parameters.ros_parameters import ParameterNode, RosParameters
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.params.node_parameters import declared
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import String

_DELIVERY = 5.0
_PATIENCE = 3.0
_REMINDER = 5.0
_RETRY = 0.02


class Recorded(NamedTuple):
    """A change to be told once its first tick is known."""

    values: Mapping[str, Any]
    """All parameters, as they were right after it."""
    changed: tuple[str, ...] = ()
    """Names of those that are new."""
    event: str = ''
    """What happened where no parameter changed, one of the controller's EVENTS."""


class SuiteNode:
    """A node with its parameters; subclasses add what it does."""

    name: str
    follows = False

    def __init__(
        self,
        *,
        context: Context,
        command_line: CommandLine,
        check: Callable[[Mapping[str, Any]], None] = lambda _: None,
    ) -> None:
        """Create the node and declare its parameters; InputError where one is not right."""
        self.node: Node = ParameterNode(
            self.name, context=context, command_line=command_line
        )
        given = self.node.get_name()
        if given != self.name:
            raise InputError(
                f'__node:={given}: topics, files and other nodes know this one as {self.name}; '
                f'put it into a namespace instead, as in -r __ns:=/{given}'
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
        self, message_type: Any, topic: str, depth: int = DEEP, *, past: bool = True
    ) -> Publisher:
        """
        Create a publisher whose messages are delivered before the node ends.

        With `past`, a late-joining subscription gets the last `depth` messages.
        """
        qos = publisher_qos(depth, past=past)
        publisher = self.node.create_publisher(message_type, topic, qos)
        self._publishers.append(publisher)
        return publisher

    def stream(self, message_type: Any, topic: str) -> Publisher:
        """Create a publisher of messages at every tick, without past messages."""
        return self.publisher(message_type, topic, past=False)

    def latched(self, message_type: Any, topic: str) -> Latched:
        """Create a publisher of messages that hold until the next one."""
        latched = Latched(self.publisher(message_type, topic, 1))
        self._latched.append(latched)
        return latched

    def connect(self) -> None:
        """Publish the parameters in force, and watch what the node waits for."""
        self._record = self.latched(String, '~/parameters')
        self.record_parameters(0, 0)
        self.node.create_timer(1.0, self._remind, clock=self.steady)
        self.node.create_timer(_RETRY, self._send_waiting, clock=self.steady)

    def record_parameters(self, tick: int, stamp: int, change: Recorded | None = None) -> None:
        """
        Publish the parameters, and the first tick that is computed with them.

        `change` is what is new since the last time; without one they are those of the start.
        """
        node = self.node.get_fully_qualified_name()
        values, changed, event = change or Recorded(self.values)
        record = ParameterRecord(node, tick, stamp, dict(values), changed, event)
        self._record.publish(String(data=record.to_text()))

    def wait(self, reason: str | None) -> None:
        """Note what the node waits for (None: nothing); it says so when that takes long."""
        if reason is not None and self._waiting is None:
            self._waiting_since = self._reminded = time.monotonic()
        self._waiting = reason

    def close(self, spin: Callable[[], None]) -> None:
        """
        Deliver what was published to everybody who is listening; raise what ended the node.

        A listener that was killed counts as there for a while yet, so that the time is bounded.
        From here on the node has finished: while others of its process take what is under way,
        its timers and subscriptions do nothing more.
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
        End the process with this error: one line once everything is delivered, status 2.

        An exception from a callback would end it too, but the executor writes a traceback.
        """
        if self.failure is None:
            self.failure = UserError(f'{self.name}: {error}')
            self.finished = True
            # The other nodes of the process end with this one, as on a signal from outside.
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
