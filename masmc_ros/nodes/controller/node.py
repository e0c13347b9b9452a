# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The controller node: responds to each state with torques or velocities."""

from __future__ import annotations

from collections.abc import Callable
import math
import sys
import time
from typing import Any, TYPE_CHECKING, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import TransitionEvent
from masmc_ros.aliases import Array
from masmc_ros.control.actions import (
    Actions,
    Command,
    Failure,
    Finish,
    Halt,
    HaltCommand,
    Line,
    NOTHING,
    Record,
    Repeat,
    State,
    StopCommand,
    Telemetry,
    Void,
    Wait,
)
from masmc_ros.control.controller_core import ControllerCore
from masmc_ros.control.layer_watch import LayerWatch
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL, takes_rates
from masmc_ros.law.parts.model import PAYLOAD_MASS
from masmc_ros.law.registry import LAW
from masmc_ros.loop import records
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import (
    APPROACH_SPEED,
    ESTIMATION_TIME,
    HOLD,
    TELEMETRY_DECIMATION,
)
from masmc_ros.loop.law_change import Effect, LawChange, Preparation
from masmc_ros.loop.plant_parameters import MEASUREMENT_DELAY
from masmc_ros.loop.safe_stop import SafeStop
from masmc_ros.loop.simulated_robot import stamp_age
from masmc_ros.loop.timing import PACING, Timing
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import CONTROLLER_STATE_TOPIC, REFERENCE_TOPIC
from masmc_ros.nodes.controller.health import ControllerHealth
from masmc_ros.nodes.controller.inputs import ReferenceInput, StateInput
from masmc_ros.nodes.controller.lifecycle_services import LifecycleServices
from masmc_ros.nodes.controller.live_identification import Background, EffortEcho
from masmc_ros.nodes.controller.output import (
    BaseOutput,
    CommandOutput,
    ControllerTelemetry,
    TorqueOutput,
)
from masmc_ros.nodes.middleware.ros_topics import subscribe_with_past
from masmc_ros.nodes.parameters.ros_parameters import Pending
from masmc_ros.nodes.process.base import (
    Health,
    publish_health,
    RejectedMessages,
    senders_text,
    several_senders,
    SuiteNode,
)
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.robot.mechanisms import driven_joint_names, mechanism_from
from masmc_ros.robot.robot import robot_of
import numpy as np
from rclpy.context import Context
from rclpy.impl.rcutils_logger import RcutilsLogger
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

if TYPE_CHECKING:
    from masmc_ros.nodes.controller.live_identification import PayloadOutput

_WATCH_PERIOD = 0.02
"""Time in s between two checks for missing states and for compiled laws."""

_Response = TypeVar('_Response', SetBool.Response, Trigger.Response)


class ControllerNode(SuiteNode):
    """Node that computes commands from joint_states and the reference."""

    name = 'controller'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Create the controller and compile its tick."""
        super().__init__(context=context, command_line=command_line, check=_check_law)
        values = self.values
        timing = Timing.from_values(values)
        robot = robot_of(values)
        self._controller = controller = Controller(robot, timing.period, values)
        approach = Approach(robot, APPROACH_SPEED.of(values))
        self._core = ControllerCore(controller, approach, LayerWatch(controller), timing, values)
        self._rejected_messages = RejectedMessages(self.log)
        joints = driven_joint_names(values)
        self._health = ControllerHealth(timing.period, self.node.get_clock(), joints)
        self._output: CommandOutput = (
            BaseOutput(controller, values, joints)
            if controller.by_velocity.any()
            else TorqueOutput(controller, joints)
        )
        self._background = Background()
        self._echo = EffortEcho(controller, self._background)
        self._payload: PayloadOutput | None = None
        if ESTIMATION_TIME.of(values):
            # Imported here: other controllers need no identification.
            from masmc_ros.nodes.controller.live_identification import PayloadOutput

            self._payload = PayloadOutput(controller, values, self._background, self.log)
        self._performers: dict[type, Callable[[Any], None]] = {
            Command: self._send,
            StopCommand: self._send_stop,
            Void: self._send_void,
            Halt: lambda action: self._output.send_void(action.stamp),
            HaltCommand: lambda action: self._output.send(action.stamp),
            Telemetry: lambda action: self._telemetry.send(action.stamp),
            Repeat: lambda _: self._output.repeat(),
            Record: self.record_parameters,
            State: self._publish_state,
            Line: lambda action: _log(self.log, action.level, action.text),
            Wait: lambda action: self.wait(action.reason),
            Failure: lambda action: self.fail(action.error),
            Finish: self._finish,
        }
        self._compile()
        self._preparation = Preparation(controller.mechanism)
        for note in controller.mechanism.notes:
            self.log.warning(note)
        self._law_change = LawChange(controller, self._preparation)
        self._has_plant_parameters = False
        self._senders = ''

    def connect(self) -> None:
        """Create the publishers, services, timers and subscriptions."""
        super().connect()
        node, core = self.node, self._core
        self._output.connect(self.publisher)
        self._telemetry = ControllerTelemetry(
            self._controller, TELEMETRY_DECIMATION.of(self.values), self.stream
        )
        if self._payload is not None:
            self._payload.connect(node, self.steady, self.stream)
        self._state = self.latched(String, CONTROLLER_STATE_TOPIC)
        node.create_service(SetBool, '~/enable', self._on_enable)
        node.create_service(SetBool, '~/hand_guide', self._on_guide)
        node.create_service(Trigger, '~/emergency_stop', self._on_stop)
        node.create_service(Trigger, '~/clear_fault', self._on_clear)
        node.create_service(Trigger, '~/reset_adaptation', self._on_reset)
        self._lifecycle = LifecycleServices(
            node,
            self.stream(TransitionEvent, '~/transition_event'),
            lambda: core.lifecycle,
            self._change_state,
        )
        self._perform(core.start())
        self._perform(core.on_code(self._awaited, time.monotonic()))
        self.parameters.on_request(self._request)
        self.parameters.on_change(lambda changed: self._perform(core.on_parameters(changed)))
        node.create_timer(_WATCH_PERIOD, self._watch, clock=self.steady)
        publish_health(
            node,
            self.latched(DiagnosticArray, '/diagnostics'),
            self.steady,
            self._report_health,
        )
        subscribe_with_past(
            node, String, 'plant/parameters', self._on_plant_parameters, depth=100
        )
        axes = len(self._controller.mechanism.axes)
        ReferenceInput(node, axes, self._rejected_messages, self._on_reference)
        self._states = StateInput(
            node,
            self.values,
            self._controller.robot,
            self._rejected_messages,
            self._on_state,
            lambda: self._perform(core.on_jump(time.monotonic())),
            self._on_mixed_states,
        )
        self._echo.watch(self._states.effort)
        core.missing_source = lambda: self._states.missing
        self.wait('the plant (joint_states)')

    def close(self, spin: Callable[[], None]) -> None:
        """Send a void command in real time, deliver all messages, and stop compiling."""
        if not self.finished:
            self._perform(self._core.on_shutdown())
        self._law_change.close()
        self._preparation.close()
        self._background.close()
        super().close(spin)

    def _compile(self) -> None:
        """Compute a tick and a safe stop without effect, so the first ones are not late."""
        sizes = self._controller.mechanism.sizes
        position, velocity = np.ones(sizes['positions']), np.zeros(sizes['positions'])
        reference = np.zeros(sizes['desired'])
        self._controller.tick(position, velocity, reference)
        stop = SafeStop(self._controller)
        stop.start(HOLD, 0, position, velocity)
        stop.update(0, position, velocity)
        self._controller.reset()
        approach = Approach(self._controller.robot, 1.0)
        for stamp in range(2):
            approach.start()
            approach.watch(stamp, reference.copy())
            approach.follow(stamp, position, np.zeros(sizes['joints']), reference)
        # A stamp between two samples, as a real robot sends them.
        windows = ReferenceWindows(len(self._controller.mechanism.axes))
        windows.add(0, 1e-6, np.zeros((2, sizes['desired'])))
        windows.at(500)

    def _request(self, values: MutableValues) -> Pending:
        """Apply requested values, those that need other compiled code when it is ready."""
        effect = self._law_change.request(values, waits=self._is_lockstep)
        self._apply(effect)
        return Pending(effect.text, effect.withdrawn)

    def _apply(self, effect: Effect) -> None:
        if effect.withdrawn:
            self.log.warning(effect.text)
        elif effect.text:
            self.log.info(effect.text)
        self.parameters.take_effect(effect.values)
        self._perform(self._core.on_code(self._awaited, time.monotonic()))

    @property
    def _awaited(self) -> str:
        """Return what the next tick of a run in lock-step needs; '' for nothing."""
        if not self._is_lockstep:
            return ''
        # The prediction depends on the delay before the stamps.
        if self._controller.is_compensated and not self._has_plant_parameters:
            return 'the parameters of the plant'
        return self._law_change.awaited

    @property
    def _is_lockstep(self) -> bool:
        return not self._core.pacing.is_timed

    def _report_health(self) -> Health:
        figures = self._echo.figures()
        if self._payload is not None:
            figures |= self._payload.figures()
        return self._health.report(
            self.node,
            self._output,
            self._core,
            self._rejected_messages,
            figures=figures,
            wrong_latency=self._echo.warning(),
            sources=self._sources(),
        )

    def _sources(self) -> str:
        """Return the inputs with more than one sender; log them when they change."""
        named = several_senders(self.node, [REFERENCE_TOPIC])
        text = '; '.join(filter(None, (self._states.check_sources(), senders_text(named))))
        if text != self._senders:
            self._senders = text
            if text:
                self.log.warning(f'more than one sender: {text}')
        return text

    # Events.

    def _on_state(
        self, stamp: int, position: Array, velocity: Array
    ) -> None:
        self._perform(self._core.on_state(stamp, position, velocity, time.monotonic()))

    def _on_mixed_states(self, senders: str) -> bool:
        actions = self._core.on_mixed_states(senders, time.monotonic())
        self._perform(actions or NOTHING)
        return actions is not None

    def _on_reference(self, window: ReferenceWindow) -> None:
        self._perform(self._core.on_reference(window, time.monotonic()))

    def _watch(self) -> None:
        if self.finished:
            return
        if self._core.states.arrival == math.inf and self._states.missing != 'joint_states':
            self.wait(f'the robot ({self._states.missing})')
        self._perform(self._core.on_timer(time.monotonic()))
        effect = self._law_change.poll()
        if effect is not None:
            if effect.withdrawn:
                self.parameters.withdraw(effect.withdrawn)
            self._apply(effect)

    def _on_enable(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        obstacle = self._core.enable_refusal(enabled=request.data)
        if obstacle:
            return _rejected(response, obstacle)
        actions = self._core.on_enable(time.monotonic(), enabled=request.data)
        return self._respond(response, actions)

    def _on_guide(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        obstacle = self._core.guide_refusal(enabled=request.data)
        if obstacle:
            return _rejected(response, obstacle)
        actions = self._core.on_guide(time.monotonic(), enabled=request.data)
        return self._respond(response, actions)

    def _on_stop(self, _: object, response: Trigger.Response) -> Trigger.Response:
        return self._respond(response, self._core.on_stop(time.monotonic()))

    def _on_clear(self, _: object, response: Trigger.Response) -> Trigger.Response:
        supervisor = self._core.supervisor
        if not supervisor.is_fault:
            return _rejected(response, f'{supervisor.text}; there is no fault')
        return self._respond(response, self._core.on_clear(time.monotonic()))

    def _on_reset(self, _: object, response: Trigger.Response) -> Trigger.Response:
        actions = self._core.on_reset_adaptation()
        return self._respond(response, actions, 'theta_hat is that of the nominal model')

    def _change_state(self, number: int, label: str) -> bool:
        actions = self._core.on_transition(number, label, time.monotonic())
        self._perform(actions or NOTHING)
        return actions is not None

    def _respond(self, response: _Response, actions: Actions, message: str = '') -> _Response:
        self._perform(actions)
        response.success, response.message = True, message or self._core.supervisor.text
        return response

    def _on_plant_parameters(self, raw: bytes) -> None:
        """
        Adopt real time from a plant, and log differences to its parameters.

        Lock-step is not adopted: a message must not disable the timeouts.
        """
        try:
            plant_values = record_of(raw).parameters
        except InputError as error:
            self._rejected_messages.add('plant/parameters', error)
            return
        pacing, own_pacing = plant_values.get(PACING.name), self._core.pacing.name
        self._perform(self._core.on_plant(str(pacing)))
        self._has_plant_parameters = True
        self._controller.set_stamp_age(_stamp_age(plant_values, self._controller.period))
        self._perform(self._core.on_code(self._awaited, time.monotonic()))
        if pacing == 'lockstep' and own_pacing == 'realtime':
            self.log.warning(
                'pacing = realtime, and a plant has lockstep: a missing state raises a timeout '
                'fault here; use the same pacing in both nodes'
            )
        for name in (COMMAND_INTERFACE.name, ENABLE_STAMPED_CMD_VEL.name):
            own_value = self.values[name]
            plant_value = plant_values.get(name, own_value)
            if plant_value != own_value:
                self.log.error(
                    f'{name} = {yaml_text(own_value)}, and the plant has '
                    f'{yaml_text(plant_value)}: it ignores the commands of this controller; '
                    'use the same value in both nodes'
                )

    # Actions.

    def _perform(self, actions: Actions) -> None:
        for action in actions:
            self._performers[type(action)](action)

    def _send(self, action: Command) -> None:
        self._output.send(action.stamp)
        self._health.add_tick(self._controller)
        self._health.add_response(action.stamp, self._core.states.arrival)
        # A simulated plant in lock-step has a known latency, and waits for every answer.
        if self._core.pacing.is_timed:
            self._echo.add(action.stamp)
        if self._payload is not None:
            self._payload.add(action.stamp)

    def _send_stop(self, action: StopCommand) -> None:
        self._output.send(action.stamp)
        self._health.add_response(action.stamp, self._core.states.arrival)

    def _send_void(self, action: Void) -> None:
        self._output.send_void(action.stamp)
        self._health.add_response(action.stamp, self._core.states.arrival)

    def _publish_state(self, action: State) -> None:
        if action.level:
            _log(self.log, action.level, action.text)
        self._state.publish(String(data=action.text))
        self._lifecycle.publish(action.lifecycle)

    def _finish(self, _: Finish) -> None:
        self.finished = True


def _rejected(response: _Response, reason: str) -> _Response:
    response.success, response.message = False, reason
    return response


def _log(log: RcutilsLogger, level: str, text: str) -> None:
    # rclpy identifies a log line by its position, which must have one level.
    if level == 'error':
        log.error(text)
    elif level == 'warning':
        log.warning(text)
    else:
        log.info(text)


def _stamp_age(plant_values: Values, period: float) -> float:
    """Return the delay of a simulated plant before its stamps in s."""
    delay = plant_values.get(MEASUREMENT_DELAY.name, 0.0)
    is_valid = isinstance(delay, float) and 0.0 <= delay <= 1.0
    return stamp_age(delay, period) if is_valid else 0.0


def _check_law(values: Values) -> None:
    """Raise InputError for a law that cannot be loaded, or does not support the robot."""
    registry.load_for(LAW.of(values), mechanism_from(values))
    # Raises InputError for a command interface whose latency cannot be compensated.
    records.is_compensated(values)
    if PAYLOAD_MASS.of(values) > 0.0:
        # Raises InputError for a type of robot without payloads.
        records.nominal_theta(robot_of(values), values)
    if ESTIMATION_TIME.of(values) and takes_rates(values):
        raise InputError(
            f'payload.estimation_time = {ESTIMATION_TIME.of(values):g}: expected 0 with '
            'commanded velocities, whose torques are unknown'
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the controller node."""
    return run([ControllerNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
