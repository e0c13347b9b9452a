# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The plant node: simulated robot with joint_states as output and commands as input."""

from __future__ import annotations

from collections.abc import Callable
import sys
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.aliases import Array
from masmc_ros.control.actions import Failure, Line, Record, Wait
from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import MAX_REAL_TIME_FACTOR, PUSH, REAL_TIME_FACTOR, WAIT_FOR
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.timing import PACING, Timing
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import subscription_qos
from masmc_ros.nodes.parameters.ros_parameters import Pending
from masmc_ros.nodes.plant.command_input import CommandInput
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.plant.state_output import StateOutput
from masmc_ros.nodes.process.base import Health, publish_health, RejectedMessages, SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.plant import plant_core
from masmc_ros.plant.lockstep import LockStep, PacedLockStep
from masmc_ros.plant.plant_core import CommandPart, Commands
from masmc_ros.plant.real_time import RealTime
from rclpy.context import Context
from rclpy.timer import Timer
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_srvs.srv import SetBool, Trigger


class PlantNode(SuiteNode):
    """Node that publishes the robot's state at every tick and moves the robot by commands."""

    name = 'plant'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Create the robot and compile its tick."""
        super().__init__(context=context, command_line=command_line)
        self._timing = Timing.from_values(self.values)
        self._robot = plant_of(self.values, self._timing.period)
        self._wait_for = [name for name in WAIT_FOR.of(self.values) if name]
        # The first tick must not be late.
        self._robot.compile()
        self._output = StateOutput(self._robot, self._timing, self.values)
        self._rejected_messages = RejectedMessages(self.log)
        self._input = CommandInput(self.values, self._rejected_messages)
        self._core = core = self._new_core()
        self._timer: Timer | None = None
        self._health = PlantHealth(self._timing.period, core.lateness)
        self._performers: dict[type, Callable[[Any], None]] = {
            plant_core.Publish: lambda _: self._output.publish(core.stamp),
            plant_core.PublishAgain: lambda _: self._output.send_again(),
            plant_core.AwaitCommand: self._await_command,
            Wait: lambda action: self.wait(action.reason),
            # All lines are warnings: rclpy identifies a log line by its position.
            Line: lambda action: self.log.warning(action.text),
            Failure: lambda action: self.fail(action.error),
            plant_core.EndPush: self._end_push,
            plant_core.Done: self._finish,
        }

    def _new_core(self) -> plant_core.PlantCore:
        commands = Commands([source.part for source in self._input.sources])
        parts = self._robot, self._timing, self.values, commands
        if PACING.of(self.values) == 'lockstep':
            is_limited = MAX_REAL_TIME_FACTOR.of(self.values) > 0.0
            return PacedLockStep(*parts) if is_limited else LockStep(*parts)
        # If the plant waits for a controller, time starts with its first command.
        return RealTime(*parts, waits=bool(self._wait_for))

    def connect(self) -> None:
        """Create topics, services and timers; the first state waits for `wait_for`."""
        super().connect()
        self._output.connect(self)
        node = self.node
        self._input.subscribe(node, self._on_command)
        node.create_subscription(
            Time, 'recorder/progress', self._on_recorded, subscription_qos(past=True), raw=True
        )
        node.create_service(Trigger, '~/reset', self._on_reset)
        node.create_service(SetBool, '~/pause', self._on_pause)
        node.create_service(Trigger, '~/step', self._on_step)
        self._gate = node.create_timer(0.02, self._start_when_ready, clock=self.steady)
        publish_health(
            node,
            self.latched(DiagnosticArray, '/diagnostics'),
            self.steady,
            self._report_health,
        )
        self.parameters.on_request(self._decide)
        self.parameters.on_change(self._on_parameters)

    # Start.

    def _start_when_ready(self) -> None:
        if self._core.has_started:
            # The last call of the destroyed timer.
            return
        missing = [name for name in self._wait_for if not self._is_there(name)]
        if missing:
            self.wait(' and '.join(map(self._described, missing)))
            return
        self.wait(None)
        self.node.destroy_timer(self._gate)
        self._perform(self._core.start(time.monotonic()))
        self._start_timer()

    def _start_timer(self) -> None:
        if self._timer is not None:
            self.node.destroy_timer(self._timer)
        period = self._core.timer_period
        self._timer = self.node.create_timer(period, self._on_time, clock=self.steady)

    def _is_there(self, name: str) -> bool:
        """Return True if a node of this namespace has discovered its topics."""
        if name == 'recorder':
            return self._core.recorder.is_there
        node = self.node
        if name == 'controller':
            subscriptions = node.get_subscriptions_info_by_topic(self._output.topic)
            return self._has_node(subscriptions, name) and self._input.are_sent_by(node, name)
        if name == 'trajectory':
            publishers = node.get_publishers_info_by_topic(node.resolve_topic_name('reference'))
            return self._has_node(publishers, name)
        return (name, node.get_namespace()) in node.get_node_names_and_namespaces()

    def _described(self, name: str) -> str:
        """Return the name of a missing node, and its disagreement with this one, if any."""
        disagreement = self._input.disagreement(self.node, name) if name == 'controller' else None
        return name if disagreement is None else f'{name}: {disagreement}'

    def _has_node(self, endpoints: list[TopicEndpointInfo], name: str) -> bool:
        namespace = self.node.get_namespace()
        return any(e.node_name == name and e.node_namespace == namespace for e in endpoints)

    # Run.

    def _on_command(
        self, part: CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> None:
        if not self.finished:
            self._perform(self._core.on_command(part, numbers, answered, now))

    def _on_time(self) -> None:
        core, now = self._core, time.monotonic()
        if self.finished:
            return
        self._perform(core.on_timer(now))
        while core.is_due:
            self._perform(core.on_due(now))

    def _decide(self, requested: MutableValues) -> Pending:
        """Use requested parameters from the current state on, unless the robot cannot."""
        try:
            self._robot.check_change({**self.values, **requested})
        except InputError as error:
            return Pending(str(error), tuple(requested))
        self.parameters.take_effect(requested)
        return Pending()

    def _end_push(self, _: plant_core.EndPush) -> None:
        self.parameters.take_effect({PUSH.name: (0.0,) * len(PUSH.of(self.values))})
        # The services return 0 as well.
        self.parameters.withdraw([PUSH.name])

    def _on_parameters(self, changed: Values) -> None:
        core = self._core
        self._perform(core.on_parameters(changed, time.monotonic()))
        record = Record(0, 0, self.values)
        if core.has_started:
            record = Record(core.robot.tick, core.stamp, self.values, tuple(changed))
        self.record_parameters(record)
        if self._timer is not None and REAL_TIME_FACTOR.name in changed:
            self._start_timer()

    def _on_recorded(self, raw: bytes) -> None:
        if self.finished:
            return
        try:
            stamp = header_stamp(raw)
        except InputError as error:
            self._rejected_messages.add('recorder/progress', error)
            return
        self._perform(self._core.on_recorded(stamp, time.monotonic()))

    def _perform(self, actions: plant_core.Actions) -> None:
        for action in actions:
            self._performers[type(action)](action)

    def _await_command(self, action: plant_core.AwaitCommand) -> None:
        disagreement = self._input.disagreement(self.node, 'controller')
        details = action.topics + ('' if disagreement is None else f'; {disagreement}')
        self.wait(f"the controller's command ({details})")

    def _finish(self, action: plant_core.Done) -> None:
        self.finished = True
        ticks, seconds = action
        self.log.info(
            f'{ticks} ticks in {seconds:.2f} s: {ticks / seconds:.0f} ticks/s, '
            f'{ticks * self._timing.period / seconds:.1f} times real time'
        )

    def _report_health(self) -> Health:
        core = self._core
        return self._health.report(
            self.node,
            [self.node.resolve_topic_name(source.topic) for source in self._input.sources],
            self._rejected_messages,
            state=self._state_text(),
            is_over=core.is_over,
            ticks=core.robot.tick,
            dropped=core.dropped,
            command_age=core.commands.age(time.monotonic()),
            slip=self._output.slip_since(),
        )

    def _state_text(self) -> str:
        if not self._core.has_started:
            return f'waits for {self._waiting or "its start"}'
        if self._core.is_over:
            return 'without a finite state, until a reset'
        return 'paused' if self._core.is_paused else self._core.text

    # Services.

    def _on_reset(self, _: object, response: Trigger.Response) -> Trigger.Response:
        self._perform(self._core.on_reset(time.monotonic()))
        response.success, response.message = True, 'the robot is in its initial state, t = 0 s'
        return response

    def _on_pause(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        # A request may arrive long after it was sent: the response has the time of its effect.
        since = f'at {self._time()}' if self._core.has_started else 'before the start of the run'
        self._perform(self._core.on_pause(time.monotonic(), is_paused=request.data))
        response.success = True
        response.message = f'{"paused" if request.data else "running"} {since}'
        return response

    def _on_step(self, _: object, response: Trigger.Response) -> Trigger.Response:
        obstacle = self._core.step_refusal()
        response.success = not obstacle
        if not obstacle:
            self._perform(self._core.on_step(time.monotonic()))
        response.message = obstacle or self._time()
        return response

    def _time(self) -> str:
        return f't = {self._timing.time(self._robot.tick):g} s'


def main(arguments: list[str] | None = None) -> int:
    """Run the plant node."""
    return run([PlantNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
