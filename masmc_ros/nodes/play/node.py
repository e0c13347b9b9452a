# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The play node: a page with a running robot, plots, and the gains of its controller."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
import sys
import time
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH
from masmc_ros.loop.timing import DURATION
from masmc_ros.messages import topics
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import text_of
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.path import path_points
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.nodes.middleware.ros_topics import (
    DEEP,
    deserialized,
    subscribe,
    subscribe_with_past,
)
from masmc_ros.nodes.parameters.services import ServiceCall
from masmc_ros.nodes.parameters.viewer_parameters import ParameterRequest, ViewerParameters
from masmc_ros.nodes.play import page
from masmc_ros.nodes.play.controls import Controls, PlantControls
from masmc_ros.nodes.play.plots import (
    checked_values,
    DESCRIBING,
    estimate_reference,
    Plots,
    shown_robot,
    ShownRobot,
)
from masmc_ros.nodes.play.report_button import ReportButton
from masmc_ros.nodes.play.samples import Sampler, SampleWindow, TimeSpeed
from masmc_ros.nodes.play.scene import path_of, RobotScene
from masmc_ros.nodes.process.base import RejectedMessages, several_senders, SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.file import parameter_file_text
from masmc_ros.params.presentation import gain_text
from masmc_ros.scenario import node_parameters
from nav_msgs.msg import Path as PathMessage
import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.client import Client
from rclpy.context import Context
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

_ERROR = topics.telemetry_topic('tracking_error')
_ESTIMATE = topics.telemetry_topic('parameter_estimate')

_SINGLE = (topics.STATE_TOPIC, topics.COMMAND_TOPIC, topics.REFERENCE_TOPIC, _ERROR, _ESTIMATE)
"""Topics that have one publisher in a proper run."""

_PATIENCE = 3.0
"""Longest time in s until the response of a service."""


class _Change(NamedTuple):
    """Change of a parameter, or an event, at a time in s, as a line."""

    time: float
    text: str
    is_event: bool = False


class _Called(NamedTuple):
    """Request of a button without a response, with its limit of the monotonic clock."""

    name: str
    call: ServiceCall
    limit: float


class PlayNode(SuiteNode):
    """Node that shows a run on a page until it is stopped."""

    name = 'play'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Create the node; its page is served from `connect` on."""
        super().__init__(context=context, command_line=command_line)
        self._records: dict[str, ParameterRecord] = {}
        self._changes: deque[_Change] = deque(maxlen=page.MOST)
        self._in_flight: ParameterRequest | None = None
        self._called: list[_Called] = []
        self._rejected_messages = RejectedMessages(self.log, 'is not shown')
        self._state_text = ''
        self._sources: tuple[str, ...] = ()
        self._problems: tuple[str, ...] = ()
        self._described: dict[str, MutableValues] = {}
        self._report: ReportButton | None = None
        self._shown: ShownRobot | None = None
        self._scene: RobotScene | None = None
        self._plots: Plots | None = None
        self._desired: bytes | None = None
        self._actual = SampleWindow(3, page.MOST)
        self._speed = TimeSpeed()
        self._stamp: float | None = None
        self._is_served = False
        self._updates = 0

    def connect(self) -> None:
        """Serve the page and subscribe to the topics of the run."""
        super().connect()
        host = node_parameters.HOST.of(self.values)
        self._may_command = page.is_local(host) or node_parameters.ALLOW_COMMANDS.of(self.values)
        self._page = page.Page(page.PlayServer(host, node_parameters.PORT.of(self.values)))
        self._is_served = True
        self._controls = Controls(
            self._page.server,
            self.node.resolve_service_name('controller'),
            may_command=self._may_command,
            asks_first=node_parameters.ASKS_FIRST.of(self.values),
            saved=self._saved_text,
        )
        self._plant = PlantControls(
            self._page.server, self.node.resolve_service_name('plant'), self._controls
        )
        if recording := node_parameters.RECORDING.of(self.values):
            kept = node_parameters.RECORDED_TIME.of(self.values)
            self._report = ReportButton(self._page.server, Path(recording), kept)
        self._parameters = ViewerParameters(self.node, self._controls, self.log.error)
        self._samples = Sampler(self.node)
        for topic, message_type in (
            (topics.STATE_TOPIC, JointState),
            (_ERROR, Float64MultiArray),
            (_ESTIMATE, Float64MultiArray),
        ):
            self._samples.add(message_type, self.node.resolve_topic_name(topic))
        for name in topics.PARAMETER_NODES:
            on_parameters = partial(self._on_parameters, name)
            self._subscribe(String, topics.parameters_topic(name), on_parameters)
        self._subscribe(String, topics.CONTROLLER_STATE_TOPIC, self._on_state_text)
        self._subscribe(PathMessage, topics.DESIRED_PATH_TOPIC, self._on_desired)
        on_event = partial(self._handle, '/parameter_events', self._parameters.on_event)
        subscribe(self.node, ParameterEvent, '/parameter_events', lambda r: on_event(r), DEEP)
        enable = self.node.create_client(SetBool, 'controller/enable')
        self._services: dict[str, tuple[Client, object]] = {
            'enable': (enable, SetBool.Request(data=True)),
            'disable': (enable, SetBool.Request(data=False)),
            'reset_adaptation': self._trigger('controller/reset_adaptation'),
            'reset_robot': self._trigger('plant/reset'),
        }
        self.node.create_timer(1.0 / page.RATE, self._update, clock=self.steady)
        self.node.create_timer(1.0, self._check_sources, clock=self.steady)
        self.log.info(f'open {self._page.server.address} in a browser')
        if not self._may_command:
            self.log.info(
                f'host = {host}: viewers can watch only; allow_commands:=true lets every machine'
                ' that reaches this one change gains'
            )
        self.wait('the parameters of the plant or of the controller')

    def _subscribe(
        self, message_type: type, topic: str, handle: Callable[[bytes], None]
    ) -> None:
        """Subscribe to all messages of a topic; invalid ones are counted."""
        resolved = self.node.resolve_topic_name(topic)

        # A function, because rclpy inspects the signature of a callback.
        def on_message(raw: bytes) -> None:
            self._handle(resolved, handle, raw)

        subscribe_with_past(self.node, message_type, topic, on_message, DEEP)

    def _handle(self, topic: str, handle: Callable[[bytes], None], raw: bytes) -> None:
        try:
            handle(raw)
        except InputError as error:
            self._rejected_messages.add(topic, error)

    def close(self, spin: Callable[[], None]) -> None:
        """Disconnect the viewers; the run continues without them."""
        if self._is_served:
            if self._report is not None:
                self._report.close()
            self._page.server.stop()
            self._samples.close()
        super().close(spin)

    def _on_state_text(self, raw: bytes) -> None:
        self._state_text = text_of(raw)

    def _on_desired(self, raw: bytes) -> None:
        self._desired = raw

    def _on_parameters(self, name: str, raw: bytes) -> None:
        """Show the values of a node, mark its changes, and show its robot if it is another one."""
        record = self._parameters.on_record(self.node.resolve_service_name(name), raw)
        # Replaced, never modified: viewers that save a file read it on other threads.
        self._records = {**self._records, name: record}
        time_s = record.stamp / NANOSECONDS
        for changed, value in record.changes.items():
            text = page.change_text(time_s, f'{changed} = {gain_text(value)}')
            self._changes.append(_Change(time_s, text))
        if record.changes and self._plots is not None:
            self._plots.note_change(time_s)
        if record.event:
            text = page.change_text(time_s, record.event)
            self._changes.append(_Change(time_s, text, is_event=True))
        if name == 'trajectory':
            return
        try:
            self._show_robot()
        except InputError as error:
            self._problems = (f'{name}: {error}',)
            raise

    def _show_robot(self) -> None:
        """Build scene, plots and controls for the robot of the records, if it is another one."""
        parameters = {name: record.parameters for name, record in self._records.items()}
        described = {
            node: {n: v for n, v in parameters[node].items() if n.startswith('robot.')}
            for node in DESCRIBING
            if node in parameters
        }
        if described == self._described:
            self._renew_references(parameters)
            return
        self._described, self._problems = described, ()
        shown = shown_robot(parameters)
        if shown is None:
            return
        self._scene = self._page.add_scene(shown, self.log.warning)
        self._shown, self._actual = shown, SampleWindow(3, page.MOST)
        if shown.plant is not None:
            mechanism = shown.robot.mechanism
            declared = {p.name: p for p in node_parameters.declared('plant', mechanism)}
            self._plant.build(mechanism, declared[PAYLOAD_MASS.name], shown.plant)
        self._state = JointStateCdr(shown.joints)
        reference = estimate_reference(parameters, shown.robot)
        if reference is not None:
            mechanism = reference.mechanism
            self._plots = self._page.add_plots(reference)
            self._error = TelemetryCdr('tracking_error', len(mechanism.axes))
            self._estimate = TelemetryCdr('parameter_estimate', len(mechanism.theta))
            declarations = {p.name: p for p in node_parameters.declared('controller', mechanism)}
            self._controls.build(declarations, reference.values)
        self.wait(None)

    def _renew_references(self, parameters: Mapping[str, Values]) -> None:
        """Use the current payload for further estimates, and the current push for arrows."""
        if self._shown is None:
            return
        if self._shown.plant is not None:
            plant = checked_values('plant', parameters['plant'])
            self._shown = self._shown._replace(plant=plant)
        reference = estimate_reference(parameters, self._shown.robot)
        if self._plots is not None and reference is not None:
            self._plots.theta = reference.theta

    def _update(self) -> None:
        """Show the latest state; send the requests of viewers; several times, show all else."""
        for topic, raw in self._samples.take():
            handler = self._on_state if topic.endswith(topics.STATE_TOPIC) else self._on_telemetry
            self._handle(topic, partial(handler, topic), raw)
        self._send_requests()
        self._updates += 1
        if self._updates % page.SLOW:
            return
        if self._stamp is not None:
            self._speed.add(time.monotonic(), self._stamp)
        self._controls.refresh()
        self._plant.refresh()
        if self._report is not None:
            self._report.update(self._controls)
        if self._page.is_viewed:
            with self._page.server.atomic():
                self._show_all()

    def _on_state(self, topic: str, raw: bytes) -> None:
        if self._shown is None or self._scene is None:
            return
        robot = self._shown.robot
        state = self._state
        if not state.load(raw):
            state.load_message(deserialized(raw, JointState))
        stamp = state.stamp_ns / NANOSECONDS
        self._stamp = stamp
        self._actual.append(stamp, path_of(robot, state.position[None])[0])
        torque = state.effort[-len(robot.mechanism.joints):]
        if self._plots is not None:
            self._plots.add_torque(stamp, torque)
        if self._page.is_viewed:
            self._scene.is_followed = self._page.is_followed
            with self._page.server.atomic():
                self._scene.move(state.position)
                if self._page.has_arrows:
                    self._scene.show_torques(torque, self._shown.disturbance(stamp))
                else:
                    self._scene.hide_torques()

    def _on_telemetry(self, topic: str, raw: bytes) -> None:
        if self._plots is None:
            return
        is_error = topic.endswith(_ERROR)
        message = self._error if is_error else self._estimate
        if not message.load(raw):
            message.load_message(deserialized(raw, Float64MultiArray))
        add: Callable[[float, Array], None] = (
            self._plots.add_error if is_error else self._plots.add_estimate
        )
        add(message.stamp_ns / NANOSECONDS, message.values)

    def _send_requests(self) -> None:
        """Send the requests of viewers; one change at a time, so the last one remains."""
        self._parameters.update()
        if self._in_flight is None or self._in_flight.is_finished:
            self._in_flight = None
            if changes := self._controls.changes():
                self._in_flight = ParameterRequest(changes)
                self._parameters.request(self._in_flight)
        for service in self._controls.services():
            self._call(service)
        for called in tuple(self._called):
            response = called.call.response()
            if response is None and time.monotonic() < called.limit:
                continue
            self._called.remove(called)
            if response is None:
                self._controls.show_error(called.name, 'its node does not answer')
            elif response.success:
                self._controls.clear_error(called.name)
            else:
                self._controls.show_error(called.name, response.message)

    def _trigger(self, service: str) -> tuple[Client, object]:
        return self.node.create_client(Trigger, service), Trigger.Request()

    def _call(self, service: str) -> None:
        client, request = self._services[service]
        if not client.service_is_ready():
            self._controls.show_error(service, f'{client.srv_name} is not there')
            return
        call = ServiceCall(partial(client.call_async, request))
        self._called.append(_Called(service, call, time.monotonic() + _PATIENCE))

    def _show_all(self) -> None:
        """Show plots, paths, changes and notices."""
        state = f'controller: {self._state_text}' if self._state_text else 'no controller yet'
        access = () if self._may_command else ('this page shows only; commands are not allowed',)
        speed = self._speed.text if self._shown is not None and self._shown.plant else ''
        lines = (state, speed, *access, *self._problems, *self._sources)
        self._controls.show_notices(tuple(filter(None, lines)))
        changes = list(self._changes)
        self._controls.show_history(tuple(change.text for change in changes[-page.CHANGES:]))
        if self._plots is not None:
            self._page.compare(self._plots)
            self._plots.send([change.time for change in changes if not change.is_event])
        if self._scene is None:
            return
        self._scene.show_actual(self._actual.values)
        if self._desired is not None:
            raw, self._desired = self._desired, None
            self._handle(topics.DESIRED_PATH_TOPIC, self._show_desired, raw)

    def _show_desired(self, raw: bytes) -> None:
        points = path_points(raw)
        if points is None:
            poses = deserialized(raw, PathMessage).poses[:page.MOST_POINTS]
            places = [(p.pose.position.x, p.pose.position.y, p.pose.position.z) for p in poses]
            points = np.array(places).reshape(-1, 3)
        if self._scene is not None:
            self._scene.show_desired(points[:page.MOST_POINTS])

    def _check_sources(self) -> None:
        """Note the topics with several publishers."""
        self._sources = tuple(
            f'{self.node.resolve_topic_name(topic)} has {len(names)} sources: '
            f'{", ".join(sorted(names))}'
            for topic, names in several_senders(self.node, _SINGLE).items()
        )

    def _saved_text(self) -> str | None:
        """Return the parameters of the run as a parameter file; None before there are any."""
        records = self._records
        if not records:
            return None
        nodes = {name: _storable(record.parameters) for name, record in records.items()}
        return parameter_file_text(nodes, [f'Saved by masmc play: {", ".join(nodes)}.'])


def _storable(values: Values) -> MutableValues:
    """
    Return values for a file.

    An endless run has no duration, which a simulation chooses. A run starts without a push.
    """
    omitted = {PUSH.name, *([DURATION.name] if values.get(DURATION.name) == 0.0 else [])}
    return {n: v for n, v in values.items() if n not in omitted}


def main(arguments: list[str] | None = None) -> int:
    """Run the play node."""
    return run([PlayNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
