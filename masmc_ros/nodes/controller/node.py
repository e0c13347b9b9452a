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
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_events import ADAPTATION_RESET
from masmc_ros.loop.preparation import Effect, LawChange, prepare
from masmc_ros.loop.supervisor import Supervisor
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.nodes.controller.answers import Answers
from masmc_ros.nodes.controller.command_output import CommandOutput, RateOutput, TorqueOutput
from masmc_ros.nodes.controller.health import ControllerHealth
from masmc_ros.nodes.controller.layer_watch import LayerWatch
from masmc_ros.nodes.controller.lockstep import LockStep
from masmc_ros.nodes.controller.pacing import Control, Stamps
from masmc_ros.nodes.controller.reference_input import ReferenceInput
from masmc_ros.nodes.controller.state_input import StateInput
from masmc_ros.nodes.controller.supervision import Supervision
from masmc_ros.nodes.controller.telemetry import ControllerTelemetry
from masmc_ros.nodes.controller.wall_clock import WallClock
from masmc_ros.nodes.middleware.qos import subscribe_with_past
from masmc_ros.nodes.parameters.ros_parameters import Pending
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import publish_health
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.nodes.process.runtime import run
from masmc_ros.params.text import yaml_text
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.robot.names import driven_joint_names
from masmc_ros.robot.registry import chosen
from masmc_ros.robot.robot import robot_of
import numpy as np
from rclpy.context import Context
from std_msgs.msg import String

_WATCH = 0.02
"""Time in s between two looks at how long states and reference have been away."""


class ControllerNode(SuiteNode):
    """Turns joint_states and reference into commands, tick by tick."""

    name = 'controller'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Make the controller and compile its tick."""
        super().__init__(context=context, command_line=command_line, check=_check_law)
        values = self.values
        self._timing = Timing.from_values(values)
        robot = robot_of(values)
        self._controller = Controller(robot, self._timing.period, values)
        self._stamps = Stamps()
        self._supervisor = Supervisor(active=values['active_on_start'])
        self._layer = LayerWatch(self._controller, self.log)
        self._approach = Approach(robot, values['approach_speed'])
        self._refusals = Refusals(self.log)
        joints = driven_joint_names(values)
        self._health = ControllerHealth(self._timing.period, self.node.get_clock(), joints)
        self._output: CommandOutput = (
            RateOutput(self._controller, values)
            if self._controller.commands_rates
            else TorqueOutput(self._controller, joints)
        )
        self._compile()
        self._law_change = LawChange(self._controller)
        self._preparation = prepare(self._controller.mechanism)

    def connect(self) -> None:
        """Create the topics: commands and telemetry out, reference and states in."""
        super().connect()
        self._output.connect(self.publisher)
        telemetry = ControllerTelemetry(
            self._controller, self.values['telemetry_decimation'], self.stream
        )
        self._supervision = Supervision(
            self.node,
            self._supervisor,
            self.latched(String, 'controller/state'),
            reset=self._reset_adaptation,
            stopped=lambda: self._answers.pacing.stopped(),
        )
        self.parameters.on_request(self._request)
        self.parameters.on_change(self._change)
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
            len(self._controller.mechanism.axes),
            self._refusals,
            lambda: self._stamps.order.last,
            lambda: self._answers.take_reference(),
        )
        self._control = self._new_control()
        kind = WallClock if self.values['pacing'] == WallClock.name else LockStep
        self._answers = Answers(
            self, self._control, kind(self._control), self._timing, self._output, telemetry
        )
        self._answers.awaited = self._awaited
        self._input = StateInput(
            self.node,
            self.values,
            self._refusals,
            self._answers.accepts,
            self._answers.take_state,
        )
        self.wait('the plant (joint_states)')

    def _new_control(self) -> Control:
        return Control(
            self.values,
            self._controller,
            self._supervisor,
            self._supervision,
            self._health,
            self._approach,
            self._layer,
            self._reference.windows,
            self._stamps,
            lambda: self._input.state,
            lambda stamp: self._answers.answer(stamp),
            lambda stamp: self._answers.send_none(stamp),
            self.fail,
        )

    def close(self, spin: Callable[[], None]) -> None:
        """Deliver what was published; compile no further."""
        if self._preparation is not None:
            self._preparation.kill()
            self._preparation.wait()
        self._law_change.close()
        super().close(spin)

    def _compile(self) -> None:
        """Compute a tick of no consequence, so that the first real one is not late."""
        sizes = self._controller.mechanism.sizes
        position, velocity = np.ones(sizes['positions']), np.zeros(sizes['positions'])
        reference = np.zeros(sizes['desired'])
        self._controller.tick(position, velocity, reference)
        self._controller.reset()
        approach = Approach(self._controller.robot, 1.0)
        for stamp in range(2):
            approach.begin()
            approach.watch(stamp, reference.copy())
            approach.follow(stamp, position, np.zeros(sizes['joints']), reference)
        # A reference between two samples, which a robot's own stamps ask for sooner or later.
        windows = ReferenceWindows(len(self._controller.mechanism.axes))
        windows.add(0, 1e-6, np.zeros((2, sizes['desired'])))
        windows.at(500)

    def _request(self, values: dict[str, Any]) -> Pending:
        """Let requested values take effect, those that need other code when it is ready."""
        effect = self._law_change.request(values, waits=self._is_lockstep)
        self._carry_out(effect)
        return Pending(effect.text, effect.withdrawn)

    def _carry_out(self, effect: Effect) -> None:
        if effect.withdrawn:
            self.log.warning(effect.text)
        elif effect.text:
            self.log.info(effect.text)
        self.parameters.take_effect(effect.values)
        if not self._law_change.is_pending:
            self._answers.take_code()

    @property
    def _is_lockstep(self) -> bool:
        return self._answers.pacing.name == LockStep.name

    def _awaited(self) -> str:
        """
        Return the code that the next tick waits for, '' for none.

        Lock-step takes its time, and a change counts from the next tick on. By the wall clock
        the law in force continues.
        """
        return self._law_change.awaited if self._is_lockstep else ''

    def _change(self, values: dict[str, Any]) -> None:
        self._answers.note(changed=tuple(values))
        self._answers.pace(self._answers.pacing)
        self._layer.begin()

    def _reset_adaptation(self) -> None:
        self._controller.forget()
        self._answers.note(ADAPTATION_RESET)

    def _watch(self) -> None:
        if self.finished:
            return
        self._answers.pacing.watch()
        effect = self._law_change.poll()
        if effect is not None:
            if effect.withdrawn:
                self.parameters.withdraw(effect.withdrawn)
            self._carry_out(effect)

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
        pacing, mine = told.get('pacing'), self._answers.pacing.name
        if pacing == WallClock.name and mine == LockStep.name:
            self._answers.pace(WallClock(self._control))
        elif pacing == LockStep.name and mine == WallClock.name:
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


def _check_law(values: Mapping[str, Any]) -> None:
    """Refuse a law that cannot be loaded, or that is none for this robot."""
    registry.load_for(values['law'], chosen(values))


def main(arguments: list[str] | None = None) -> int:
    """Run the controller node."""
    return run([ControllerNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
