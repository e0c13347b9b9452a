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

"""The plant node: the simulated robot behind joint_states and the commands that answer."""

from __future__ import annotations

import sys
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.errors import InputError
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.qos import subscription_qos
from masmc_ros.nodes.plant.command_input import CommandInput
from masmc_ros.nodes.plant.command_parts import Part
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.plant.lockstep import LockStep
from masmc_ros.nodes.plant.pacing import Pacing, Plant
from masmc_ros.nodes.plant.recorder_pace import RecorderPace
from masmc_ros.nodes.plant.state_output import StateOutput
from masmc_ros.nodes.plant.wall_clock import WallClock
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import Health, publish_health
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.nodes.process.runtime import run
import numpy as np
from rclpy.context import Context
from std_srvs.srv import SetBool, Trigger


class PlantNode(SuiteNode):
    """Publishes the robot's state at every tick and moves it by the commands that answer."""

    name = 'plant'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Make the robot and compile its tick."""
        super().__init__(context=context, command_line=command_line)
        self._timing = Timing.from_values(self.values)
        self._robot = plant_of(self.values, self._timing.period)
        self._wait_for = [name for name in self.values['wait_for'] if name]
        # To no consequence, so that the first real tick is not late: it is compiled here.
        for command in (np.zeros(len(self._robot.mechanism.joints)), None):
            self._robot.advance(command)
        self._robot.reset()
        self._output = StateOutput(self._robot, self._timing, self.values)
        self._started = False
        self._refusals = Refusals(self.log)
        self._input = CommandInput(self.values, self._refusals)
        self._health = PlantHealth(self._timing.period)
        self._begun = 0.0
        self._recorder = RecorderPace(self.log)
        self._pacing = self._new_pacing()

    def _new_pacing(self) -> Pacing:
        plant = Plant(
            self.node,
            self.steady,
            self.values,
            self._timing,
            self._robot,
            self._input,
            self._output,
            self._health,
            self._recorder,
            self.wait,
            self._advance,
            lambda: self.finished,
        )
        if self.values['pacing'] == 'lockstep':
            return LockStep(plant)
        # Where a controller is waited for, time begins with its first command.
        return WallClock(plant, waits=bool(self._wait_for))

    def connect(self) -> None:
        """Create topics, services and timers; the first state follows once all are there."""
        super().connect()
        self._output.connect(self)
        node = self.node
        self._input.subscribe(node, self._is_for_now, self._pacing.on_command)
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
        self._pacing.connect()
        self.parameters.on_change(lambda _: self._pacing.change())

    # Start.

    def _start_when_ready(self) -> None:
        if self._started:
            return  # a destroyed timer's last call may be under way already
        missing = [name for name in self._wait_for if not self._is_there(name)]
        if missing:
            self.wait(' and '.join(map(self._described, missing)))
            return
        self.wait(None)
        self.node.destroy_timer(self._gate)
        self._started = True
        self._begun = time.monotonic()
        self._output.publish()
        self._pacing.begin()

    def _is_there(self, name: str) -> bool:
        """Tell whether a node of this namespace has found its topics."""
        if name == 'recorder':
            return self._recorder.is_there
        node = self.node
        if name == 'controller':
            listens = node.get_subscriptions_info_by_topic(self._output.topic)
            return self._names(listens, name) and self._input.are_sent_by(node, name)
        if name == 'trajectory':
            sends = node.get_publishers_info_by_topic(node.resolve_topic_name('reference'))
            return self._names(sends, name)
        return (name, node.get_namespace()) in node.get_node_names_and_namespaces()

    def _described(self, name: str) -> str:
        """Return the name of a node that is waited for, and why if it is there."""
        differs = self._input.disagreement(self.node, name) if name == 'controller' else None
        return name if differs is None else f'{name}: {differs}'

    def _names(self, endpoints: list[Any], name: str) -> bool:
        here = self.node.get_namespace()
        return any(e.node_name == name and e.node_namespace == here for e in endpoints)

    # Run.

    def _is_for_now(self, part: Part, answered: int | None) -> bool:
        """Tell whether a part of a command is for the present, and count it if it is not."""
        if self._pacing.is_current(part, answered):
            return True
        self._health.dropped += 1
        self.log.debug(f'{self._health.dropped} commands dropped', throttle_duration_sec=5.0)
        return False

    def _advance(self, command: np.ndarray | None) -> None:
        if self._robot.tick == self._timing.last:
            self.finished = True
            self._say_pace()
            return
        try:
            self._robot.advance(command)
        except InputError as error:
            self.fail(self._pacing.explained(error))
            return
        self._output.publish()

    def _say_pace(self) -> None:
        """Tell how fast the run was, from its first state to the last command."""
        ticks = self._robot.tick
        elapsed = time.monotonic() - self._begun
        self.log.info(
            f'{ticks} ticks in {elapsed:.2f} s: {ticks / elapsed:.0f} ticks/s, '
            f'{ticks * self._timing.period / elapsed:.1f} times real time'
        )

    def _on_recorded(self, raw: bytes) -> None:
        """Note how far the recorder is, and go on if lock-step was held up for it."""
        try:
            stamp = header_stamp(raw)
        except InputError as error:
            self._refusals.add('recorder/progress', error)
            return
        self._recorder.note(round(stamp / (1e9 * self._timing.period)), self._robot.tick)
        self._pacing.go_on()

    def _report_health(self) -> Health:
        return self._health.report(
            self.node,
            [self.node.resolve_topic_name(part.topic) for part in self._input.parts],
            self._refusals,
            state=self._state_text(),
            ticks=self._robot.tick,
            command_age=self._input.age(time.monotonic()),
            slip=self._output.slip_since(),
        )

    def _state_text(self) -> str:
        """Tell what the plant does, in a word."""
        if not self._started:
            return f'waits for {self._waiting or "its beginning"}'
        if self._pacing.is_paused:
            return 'paused'
        return self._pacing.text

    # Services.

    def _on_reset(self, _: Any, response: Any) -> Any:
        self._robot.reset()
        self._input.clear()
        self._recorder.set_back()
        self._pacing.set_anchor()
        if self._started:
            self._output.publish()
        response.success, response.message = True, 'the robot is in its initial state, t = 0 s'
        return response

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._pacing.is_paused = is_paused = request.data
        self._pacing.set_anchor()
        self._input.touch()
        response.success = True
        # A request may arrive long after it was sent: the caller learns when it took effect.
        since = f'at t = {self._timing.time(self._robot.tick):g} s'
        if not self._started:
            since = 'before the run has begun'
        response.message = f'{"paused" if is_paused else "running"} {since}'
        if not is_paused:
            self._pacing.go_on()
        return response

    def _on_step(self, _: Any, response: Any) -> Any:
        """Advance by one control period while paused."""
        response.success = self._pacing.is_paused and self._started
        if not response.success:
            needed = 'pause with data true first' if self._started else 'again when it has'
            state = 'not paused' if self._started else 'the run has not begun'
            response.message = f'{state}; call {needed}'
            return response
        self._pacing.step()
        response.message = f't = {self._timing.time(self._robot.tick):g} s'
        return response


def main(arguments: list[str] | None = None) -> int:
    """Run the plant node."""
    return run([PlantNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
