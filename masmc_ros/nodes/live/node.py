# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The live node: topics and parameters of a running robot in Foxglove."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import sys
import time

from masmc_ros.errors import InputError
from masmc_ros.messages.names import (
    ARM_VELOCITY_TOPIC,
    CLOCK_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    DESCRIPTION_TOPIC,
    STATE_TOPIC,
    TELEMETRY,
    telemetry_topic,
)
from masmc_ros.messages.stamps import stamp_reader, StampReader
from masmc_ros.messages.string_message import text_of
from masmc_ros.messages.topics import (
    PARAMETER_NODES,
    parameters_topic,
    SYSTEM_TOPICS,
    Topic,
    TOPICS,
    TRANSFORMS,
)
from masmc_ros.nodes.live.server import LiveServer
from masmc_ros.nodes.live.state_transforms import StateTransforms
from masmc_ros.nodes.middleware.messages import message_class
from masmc_ros.nodes.middleware.past import subscribe, subscribe_with_past
from masmc_ros.nodes.middleware.qos import DEEP
from masmc_ros.nodes.middleware.sampling import Sampler
from masmc_ros.nodes.parameters.viewer_parameters import ViewerParameters
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import RejectedMessages
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.declaration import check_all
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.meshes import mesh_files
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.throttle import Throttle
from rclpy.context import Context

SAMPLED = frozenset(
    {
        STATE_TOPIC,
        COMMAND_TOPIC,
        CMD_VEL_TOPIC,
        ARM_VELOCITY_TOPIC,
        'odom',
        'base_twist',
        CLOCK_TOPIC,
        *(telemetry_topic(label) for label in TELEMETRY),
    }
)
"""Topics with the latest message at a viewer's rate; viewers get all messages of others."""

_DISCOVERY_PERIOD = 0.5
"""Time in s between two checks for new publishers."""

_KEPT = {
    'reference': 20,
    '/rosout': 500,
    '/parameter_events': 0,
    **{parameters_topic(node): 500 for node in PARAMETER_NODES},
}
"""Number of past messages for a late-joining viewer, for topics with more than one.

All of them must fit into the queue of a viewer (`_BACKLOG` in `server.py`).
"""


class LiveNode(SuiteNode):
    """Node that serves the topics and parameters of a run until it is stopped."""

    name = 'live'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Create the server; UserError if foxglove-sdk is not installed."""
        super().__init__(context=context, command_line=command_line)
        throttle = Throttle(period=1.0)
        self._server = LiveServer(
            self.node.get_fully_qualified_name(),
            max_viewers=self.values['max_viewers'],
            warn=lambda text: (
                throttle.is_due('viewers', time.monotonic()) and self.log.warning(text)
            ),
        )
        self._samples = Sampler(self.node)
        self._stamps: dict[str, StampReader] = {}
        self._transforms: StateTransforms | None = None
        self._latest = 0
        self._rejected_messages = RejectedMessages(self.log, 'is shown unmodified')
        self._is_served = False
        self._awaited: list[Topic] = []

    def connect(self) -> None:
        """Start the server and subscribe to all topics."""
        super().connect()
        port = self._server.start(self.values['host'], self.values['port'])
        self._is_served = True
        self._parameters = ViewerParameters(self.node, self._server, self.log.error)
        self._states = self.node.resolve_topic_name(STATE_TOPIC)
        for topic in (*TOPICS, *SYSTEM_TOPICS):
            if topic.turns_up:
                self._awaited.append(topic)
            elif topic != TRANSFORMS:
                self._serve(topic)
        self.node.create_timer(_DISCOVERY_PERIOD, self._discover, clock=self.steady)
        # Computed from the shown states, so the robot and the plots are of the same tick.
        self._server.add_topic(TRANSFORMS.name, TRANSFORMS.type_name)
        self.node.create_timer(1.0 / self.values['rate'], self._update, clock=self.steady)
        address = f'ws://{self.values["host"]}:{port}'
        self.log.info(f'open {address} in Foxglove, as {self._server.app_url} does')
        self.wait('the plant (joint_states)')

    def close(self, spin: Callable[[], None]) -> None:
        """Send the last messages and disconnect the viewers."""
        if self._is_served:
            self._update()
        self._server.stop()
        self._samples.close()
        super().close(spin)

    def _discover(self) -> None:
        """Serve the topics of only some runs when they have a publisher."""
        for topic in tuple(self._awaited):
            resolved = self.node.resolve_topic_name(topic.name)
            senders = self.node.get_publishers_info_by_topic(resolved)
            if senders:
                self._awaited.remove(topic)
                self._serve(topic._replace(type_name=senders[0].topic_type))
                # foxglove-sdk may lose the subscription of a connected viewer.
                self.log.info(
                    f'{topic.name} turned up; reconnect the viewer if it does not show the topic'
                )

    def _serve(self, topic: Topic) -> None:
        try:
            message_type = message_class(topic.type_name)
        except InputError as error:
            self.log.info(f'{topic.name} is not shown: {error}')
            return
        resolved = self.node.resolve_topic_name(topic.name)
        self._stamps[resolved] = stamp_reader(topic.name, topic.type_name)
        self._server.add_topic(resolved, topic.type_name, _KEPT.get(topic.name, 1))
        if topic.name in SAMPLED:
            self._samples.add(message_type, resolved)
            return
        handlers: dict[str, Callable[[bytes], object]] = {
            '/parameter_events': self._parameters.on_event,
            DESCRIPTION_TOPIC: self._on_description,
            **{parameters_topic(n): partial(self._on_parameters, n) for n in PARAMETER_NODES},
        }
        handle = handlers.get(topic.name)

        # A function, because rclpy inspects the signature of a callback.
        def on_message(raw: bytes) -> None:
            if handle is not None:
                try:
                    handle(raw)
                except InputError as error:
                    self._rejected_messages.add(resolved, error)
            self._send(resolved, raw)

        if topic.is_latched:
            subscribe_with_past(self.node, message_type, topic.name, on_message, DEEP)
        else:
            subscribe(self.node, message_type, topic.name, on_message, DEEP)

    def _on_description(self, raw: bytes) -> None:
        self._server.meshes = mesh_files(text_of(raw))

    def _on_parameters(self, name: str, raw: bytes) -> None:
        full_name = self.node.resolve_service_name(name)
        values = self._parameters.on_record(full_name, raw).parameters
        if name == 'plant' and 'tf_decimation' in values:
            declarations = declared(name, mechanism_from(values))
            known = {p.name: values[p.name] for p in declarations if p.name in values}
            checked = check_all(declarations, known, integers_for_doubles=True)
            # The decimation is that of the states: every shown state moves the frames.
            self._transforms = StateTransforms({**checked, 'tf_decimation': 1})

    def _update(self) -> None:
        """Send new messages to the viewers and process their requests."""
        for topic, raw in self._samples.take():
            if topic == self._states:
                self._on_state(raw)
            self._send(topic, raw)
        self._server.send_time(self._latest)
        for change in self._server.requests():
            self._parameters.request(change)
        self._parameters.update()

    def _on_state(self, raw: bytes) -> None:
        """Update the robot's time and send the transforms of a state."""
        stamp = self._stamp(self._states, raw)
        if stamp is None:
            return
        self._latest = stamp
        self.wait(None)
        transforms = None if self._transforms is None else self._transforms.of_state(raw)
        if transforms is not None:
            self._server.send(TRANSFORMS.name, transforms, self._latest)

    def _stamp(self, topic: str, raw: bytes) -> int | None:
        """Return the stamp in ns of a message, None if it has no valid one."""
        try:
            return self._stamps[topic](raw)
        except InputError as error:
            self._rejected_messages.add(topic, error)
            return None

    def _send(self, topic: str, raw: bytes) -> None:
        stamp = self._stamp(topic, raw)
        self._server.send(topic, raw, self._latest if stamp is None else stamp)


def main(arguments: list[str] | None = None) -> int:
    """Run the live node."""
    return run([LiveNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
