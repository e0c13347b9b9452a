# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The controller node: answers every state with a torque, or with rates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.errors import InputError, UserError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET, DEACTIVATED, RESUMED
from masmc_ros.loop.preparation import prepare
from masmc_ros.loop.simulated_robot import diverged
from masmc_ros.loop.stamp_order import Order, StampOrder
from masmc_ros.loop.supervisor import NO_REFERENCE, Supervisor
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.nodes.controller.command_output import CommandOutput, RateOutput, TorqueOutput
from masmc_ros.nodes.controller.health import ControllerHealth
from masmc_ros.nodes.controller.layer_watch import LayerWatch
from masmc_ros.nodes.controller.reference_input import ReferenceInput
from masmc_ros.nodes.controller.state_input import StateInput
from masmc_ros.nodes.controller.supervision import Supervision
from masmc_ros.nodes.controller.telemetry import ControllerTelemetry
from masmc_ros.nodes.middleware.qos import subscribe_with_past
from masmc_ros.nodes.process.base import Recorded, SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import publish_health
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.text import yaml_text
from masmc_ros.reference.approach import Approach
from masmc_ros.robot.names import driven_joint_names
from masmc_ros.robot.robot import robot_of
import numpy as np
from rclpy.context import Context
from std_msgs.msg import String

_WATCH = 0.02
"""Time in s between two looks at how long states and reference have been away."""

_FEWEST_PERIODS = 5
"""Control periods that the state timeout is at least."""

STATES, REFERENCE, LAW = 'states', 'reference', 'law'
"""Causes of faults."""


class ControllerNode(SuiteNode):
    """Turns joint_states and reference into commands, tick by tick."""

    name = 'controller'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Make the controller and compile its tick."""
        super().__init__(context=context, command_line=command_line, check=_check_law)
        values = self.values
        self._timing = Timing.from_values(values)
        robot = robot_of(values)
        self._mechanism = robot.mechanism
        self._controller = Controller(robot, self._timing.period, values)
        last = self._timing.last
        self._last_stamp = None if last is None else self._timing.stamp(last)
        self._order = StampOrder()
        self._supervisor = Supervisor(active=values['active_on_start'])
        self._activations = self._supervisor.activations
        self._computes: bool | None = self._supervisor.is_active
        self._computed: int | None = None
        self._layer = LayerWatch(self._controller, self.log)
        self._approach = Approach(robot, values['approach_speed'])
        self._refusals = Refusals(self.log)
        joints = driven_joint_names(values)
        self._health = ControllerHealth(self._timing.period, self.node.get_clock(), joints)
        self._pending: int | None = None
        self._may_finish = True
        self._was_silent = False
        self._held_since: float | None = None
        self._untold: list[Recorded] = []
        self._was_singular = False
        self._output: CommandOutput = (
            RateOutput(self._controller, values)
            if self._controller.commands_rates
            else TorqueOutput(self._controller, joints)
        )
        self._compile()
        self._preparation = prepare(self._controller.mechanism)

    def connect(self) -> None:
        """Create the topics: commands and telemetry out, reference and states in."""
        super().connect()
        self._output.connect(self.publisher)
        self._telemetry = ControllerTelemetry(
            self._controller, self.values['telemetry_decimation'], self.stream
        )
        self._supervision = Supervision(
            self.node,
            self._supervisor,
            self.latched(String, 'controller/state'),
            reset=self._reset_adaptation,
            stopped=self._on_stopped,
        )
        self.parameters.on_change(self._change)
        self._set_pacing(is_realtime=self.values['pacing'] == 'realtime')
        self.node.create_timer(_WATCH, self._watch, clock=self.steady)
        publish_health(
            self.node,
            self.latched(DiagnosticArray, '/diagnostics'),
            self.steady,
            lambda: self._health.report(
                self.node, self._output, self._supervisor, self._controller, self._refusals
            ),
        )
        subscribe_with_past(
            self.node, String, 'plant/parameters', self._on_plant_parameters, depth=100
        )
        self._reference = ReferenceInput(
            self.node,
            len(self._mechanism.axes),
            self._refusals,
            lambda: self._order.last,
            self._on_reference,
        )
        self._input = StateInput(
            self.node, self.values, self._refusals, self._accepts, self._on_state
        )
        self.wait('the plant (joint_states)')

    def close(self, spin: Callable[[], None]) -> None:
        """Deliver what was published; compile no further."""
        if self._preparation is not None:
            self._preparation.kill()
            self._preparation.wait()
        super().close(spin)

    def _compile(self) -> None:
        """Compute a tick of no consequence, so that the first real one is not late."""
        sizes = self._mechanism.sizes
        position, velocity = np.ones(sizes['positions']), np.zeros(sizes['positions'])
        reference = np.zeros(sizes['desired'])
        self._controller.tick(position, velocity, reference)
        self._controller.reset()
        approach = Approach(self._controller.robot, 1.0)
        for stamp in range(2):
            approach.begin()
            approach.watch(stamp, reference.copy())
            approach.follow(stamp, position, np.zeros(sizes['joints']), reference)

    def _change(self, values: dict[str, Any]) -> None:
        self._controller.change(values)
        self._note(changed=tuple(values))
        self._set_pacing(is_realtime=self._is_realtime)
        self._layer.begin()

    def _reset_adaptation(self) -> None:
        self._controller.forget()
        self._note(ADAPTATION_RESET)

    def _note(self, event: str = '', changed: tuple[str, ...] = ()) -> None:
        """Note what is to be told on ~/parameters with the next tick that is answered."""
        self._untold.append(Recorded(dict(self.values), changed, event))

    # Pacing.

    def _set_pacing(self, *, is_realtime: bool) -> None:
        """Judge stamps and silence as the pacing needs it; in lock-step nothing is too late."""
        self._is_realtime = is_realtime
        self._order.gap_ns = round(1e9 * self._state_timeout()) if self._is_realtime else None

    def _state_timeout(self) -> float:
        """Return the timeout in s; five periods at least, lest every state is late."""
        return max(self.values['state_timeout'], _FEWEST_PERIODS * self._timing.period)

    def _on_plant_parameters(self, raw: bytes) -> None:
        """
        Go by the wall clock where a plant does, and tell where it differs.

        Never the other way: what anybody sends must not switch off the timeouts.
        """
        try:
            told = record_of(raw).parameters
        except InputError as error:
            self._refusals.add('plant/parameters', error)
            return
        pacing = told.get('pacing')
        if pacing == 'realtime' and not self._is_realtime:
            self._set_pacing(is_realtime=True)
        elif pacing == 'lockstep' and self._is_realtime:
            self.log.warning(
                'pacing = realtime, and a plant has lockstep: its silence is a fault here; '
                'start both with the same'
            )
        for name in (COMMAND_INTERFACE.name, ENABLE_STAMPED_CMD_VEL.name):
            mine, theirs = self.values[name], told.get(name, self.values[name])
            if mine != theirs:
                self.log.error(
                    f'{name} = {yaml_text(mine)}, and the plant has {yaml_text(theirs)}: it does '
                    'not take what is sent here; start both with the same'
                )

    def _watch(self) -> None:
        """In real time, note when states have been away for too long."""
        if self.finished or not (self._is_realtime and self._supervisor.is_active):
            return
        timeout = self._state_timeout()
        is_silent = self._health.silence() > timeout
        # To a controller that was held up itself, states have come that it takes before its
        # next look.
        if is_silent and self._was_silent:
            self._supervision.fail(STATES, f'no usable joint_states for {timeout:g} s')
        self._was_silent = is_silent

    def _on_stopped(self) -> None:
        """Command nothing at once; in lock-step as the answer to the state that waits for one."""
        last = self._order.last
        if self._is_realtime and last is not None:
            self._send_none(last)
        elif self._pending is not None:
            self._answer(self._pending)

    # Input.

    def _on_reference(self) -> None:
        if self._pending is not None:
            self._answer(self._pending)

    def _accepts(self, stamp: int) -> bool:
        """Tell whether a state is to be answered, by its stamp in ns beside those before it."""
        self._health.saw_state(stamp)
        order = self._order.judge(stamp)
        # A single stamp far ahead may be wrong, and the next one tells; but for the run's last
        # state, which comes so to a controller that was held up at the end, there is no next.
        # In lock-step every state comes, the last one too.
        is_near = self._is_realtime and order is not Order.AHEAD
        self._may_finish = is_near or stamp == self._last_stamp
        if order is Order.NEXT:
            return True
        if order is Order.LATE:
            self._health.late += 1
            return False
        if order is not Order.REPEATED:
            self._start_anew(order)
        elif self._pending is None:
            self._health.repeated += 1
            self._output.repeat()
            return False
        return True

    def _on_state(self, stamp: int) -> None:
        if not self._supervisor.is_active:
            self._supervision.recover(STATES, is_anew=False)
        self._answer(stamp)

    def _start_anew(self, order: Order) -> None:
        if order is Order.BACK:
            self.log.info('the robot was set back; the controller starts anew')
        else:
            self._health.gaps += 1
            self.log.warning(
                'states were missing for long; the controller starts anew',
                throttle_duration_sec=1.0,
            )
        self._pending = None
        self._activations = -1
        self._computes = None

    # Answer.

    def _answer(self, stamp: int) -> None:
        """Compute and publish the command for the state at hand."""
        reference = self._look_up(stamp)
        if self._supervisor.is_active:
            if reference is None:
                self._pending = stamp
                self.wait('the trajectory (reference)')
                if self._is_realtime and self._computed is not None:
                    # A robot that was moved before must not go on with its last torque.
                    self._send_none(stamp)
                    self._approach.begin()
                return
            self._compute(stamp, reference)
            if self.failure is not None:
                return
        self._pending = None
        self.wait(None)
        if self._supervisor.is_active:
            self._output.send(stamp)
            self._health.computed(self._controller)
        else:
            self._send_none(stamp)
        self._health.answered()
        tick = round(stamp / (1e9 * self._timing.period))
        if self._supervisor.is_active:
            self._telemetry.send(tick, stamp)
        for change in self._untold:
            self.record_parameters(tick, stamp, change)
        self._untold.clear()
        if self._timing.last is not None and tick >= self._timing.last and self._may_finish:
            self.finished = True

    def _look_up(self, stamp: int) -> Any:
        """
        Return the reference to follow at a stamp; None where there is none yet.

        In lock-step the plant waits for the command, and the reference is on its way. In real
        time, and where a newer state while one is unanswered tells that the plant does not
        wait, the last position is held. To one that has commanded nothing yet, newer states
        may be those of the past, which a successor is given.
        """
        reference = self._reference.windows.at(stamp)
        if reference is not None:
            self._held_since = None
            if not self._supervisor.is_active:
                self._supervision.recover(REFERENCE, is_anew=True)
            return reference
        begins = self._computed is None
        if not self._is_realtime and (begins or self._pending in (None, stamp)):
            return None
        reference = self._reference.windows.held_after(stamp)
        timeout = self.values['reference_timeout']
        if reference is not None and self._is_realtime:
            now = time.monotonic()
            self._held_since = since = self._held_since or now
            if 0.0 < timeout < now - since:
                self._supervision.fail(REFERENCE, f'{NO_REFERENCE} for {timeout:g} s')
        return reference

    def _compute(self, stamp: int, reference: Any) -> None:
        """Compute the command; in real time, what cannot be computed is a fault."""
        controller, state = self._controller, self._input.state
        is_first = self._computed is None
        if self._activations != self._supervisor.activations:
            self._activations = self._supervisor.activations
            controller.reset()
            # In lock-step the beginning of a run is what was asked for.
            if self._is_realtime or self._computes is False:
                self._approach.begin()
            self._note(ACTIVATED)
        elif is_first and self._is_realtime:
            self._approach.begin()
        elif not self._computes:
            self._note(RESUMED)
        elif self._is_realtime and self._computed is not None:
            left_out = round((stamp - self._computed) / (1e9 * self._timing.period)) - 1
            if left_out > 0:
                controller.skip(left_out)
            self._layer.held(max(left_out, 0) + 1, state.position)
        self._computes, self._computed = True, stamp
        if self._is_realtime:
            self._approach.watch(stamp, reference)
        if self._approach.is_on:
            rates = controller.rates(state.velocity)
            reference = self._approach.follow(stamp, state.position, rates, reference)
        try:
            singular = controller.tick(state.position, state.velocity, reference)
            if not self._output.is_finite():
                raise diverged(stamp * 1e-9)
        except Exception as error:
            if not self._is_realtime:
                if not isinstance(error, UserError):
                    raise
                self.fail(error)
                return
            # A plugged-in law may fail in any way, and must not take the node with it.
            self._supervision.fail(LAW, ' '.join(str(error).split()), is_latched=True)
            return
        if singular != self._was_singular:
            self._was_singular = singular
            self._say_singular(stamp, singular)

    def _send_none(self, stamp: int) -> None:
        self._controller.rest()
        if self._computes is not False:
            self._computes = False
            self._note(DEACTIVATED)
        self._output.send_none(stamp)

    def _say_singular(self, stamp: int, singular: bool) -> None:
        if singular:
            self.log.warning(
                f'at t = {stamp * 1e-9:.3f} s {self._mechanism.lost} is close to singular '
                f'({self._mechanism.singular}); motion along the lost direction is damped'
            )
        else:
            lost = self._mechanism.lost
            self.log.info(f'at t = {stamp * 1e-9:.3f} s {lost} has left the singularity')


def _check_law(values: Mapping[str, Any]) -> None:
    """Refuse a plugged-in law that cannot be loaded."""
    registry.load(values['law'])


def main(arguments: list[str] | None = None) -> int:
    """Run the controller node."""
    return run([ControllerNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
