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
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import LATE_TICKS, Timing
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.qos import subscription_qos
from masmc_ros.nodes.plant.command_input import CommandInput
from masmc_ros.nodes.plant.command_parts import Part
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.plant.recorder_pace import RecorderPace
from masmc_ros.nodes.plant.state_output import StateOutput
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import Health, publish_health
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.nodes.process.runtime import run
from masmc_ros.nodes.process.throttle import Throttle
from masmc_ros.robot.robot import robot_of
import numpy as np
from rclpy.context import Context
from rclpy.timer import Timer
from std_srvs.srv import SetBool, Trigger

_HELD = 0.02
"""Time in s between two sendings of the same state while the robot's time stands still."""


class PlantNode(SuiteNode):
    """Publishes the robot's state at every tick and moves it by the commands that answer."""

    name = 'plant'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Make the robot and compile its tick."""
        super().__init__(context=context, command_line=command_line)
        self._timing = Timing.from_values(self.values)
        self._robot = SimulatedRobot(robot_of(self.values), self._timing.period, self.values)
        self._lockstep = self.values['pacing'] == 'lockstep'
        self._wait_for = [name for name in self.values['wait_for'] if name]
        # To no consequence, so that the first real tick is not late: it is compiled here.
        for command in (np.zeros(len(self._robot.mechanism.joints)), None):
            self._robot.advance(command)
        self._robot.reset()
        self._output = StateOutput(self._robot, self._timing, self.values)
        self._started = self._paused = self._runs = False
        self._single_steps = 0
        self._refusals = Refusals(self.log)
        self._silences = Throttle(period=5.0)
        self._input = CommandInput(self.values, self._refusals)
        self._health = PlantHealth(self._timing.period)
        self._begun = 0.0
        self._watched = -1
        self._recorder = RecorderPace(self.log)
        self._woken = self._sent = 0.0
        self._anchor = (0.0, 0)
        self._pacer: Timer | None = None

    def connect(self) -> None:
        """Create topics, services and timers; the first state follows once all are there."""
        super().connect()
        self._output.connect(self)
        node = self.node
        self._input.subscribe(node, self._is_for_now, self._on_command)
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
        if self._lockstep:
            node.create_timer(1.0, self._watch_lockstep, clock=self.steady)
        else:
            self.parameters.on_change(lambda _: self._pace())

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
        if not self._lockstep:
            # Where a controller is waited for, time begins with its first command.
            self._runs = not self._wait_for
            self._pace()

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

    # Commands.

    def _is_for_now(self, part: Part, answered: int | None) -> bool:
        """Tell whether a part of a command is for the present, and count it if it is not."""
        if self._is_current(part, answered):
            return True
        self._health.dropped += 1
        self.log.debug(f'{self._health.dropped} commands dropped', throttle_duration_sec=5.0)
        return False

    def _on_command(self) -> None:
        """Go by what has come."""
        if not self._lockstep:
            if not self._runs:
                self._take_anchor()
                self._runs = True
            return
        self._answer()

    def _is_current(self, part: Part, answered: int | None) -> bool:
        """
        Tell whether a command is for the present, by the stamp in ns that it answers.

        In lock-step it must answer the outstanding state; where its messages cannot tell, it
        is taken to do so. In real time it may answer any state within the command timeout, or
        name none.
        """
        if not self._started:
            return False
        if self._lockstep:
            return answered == self._output.stamp or not part.names_state
        oldest = 1e9 * self.values['command_timeout'] * self.values['real_time_factor']
        return answered is None or 0 <= self._output.stamp - answered <= oldest

    def _answer(self) -> None:
        """Apply the command at hand in lock-step, unless something holds the plant up."""
        if self.finished or not self._input.is_complete:
            return
        if self._paused and not self._single_steps:
            return
        if self._recorder.holds_up(self._robot.tick):
            return
        if self._single_steps:
            self._single_steps -= 1
        self._advance(self._input.take())

    def _advance(self, command: np.ndarray | None) -> None:
        if self._robot.tick == self._timing.last:
            self.finished = True
            self._say_pace()
            return
        try:
            self._robot.advance(command)
        except InputError as error:
            self.fail(error if self._lockstep else self._with_figures(error))
            return
        self._output.publish()

    def _with_figures(self, error: InputError) -> InputError:
        """Add what else may be to blame in real time: a machine that does not keep up."""
        age = self._input.age(time.monotonic())
        return InputError(
            f'{error}, and a machine that keeps up with it; {self._health.late} ticks were late,'
            f' the last command came {age:.3f} s ago'
        )

    def _say_pace(self) -> None:
        """Tell how fast the run was, from its first state to the last command."""
        ticks = self._robot.tick
        elapsed = time.monotonic() - self._begun
        self.log.info(
            f'{ticks} ticks in {elapsed:.2f} s: {ticks / elapsed:.0f} ticks/s, '
            f'{ticks * self._timing.period / elapsed:.1f} times real time'
        )

    def _watch_lockstep(self) -> None:
        """Note what lock-step stands still for; leave a silent recorder behind."""
        stands_still = self._robot.tick == self._watched and self._started and not self.finished
        self._watched = self._robot.tick
        if not stands_still or self._paused:
            self.wait(None if self._started else self._waiting)
        elif not self._input.is_complete:
            differs = self._input.disagreement(self.node, 'controller')
            why = self._input.missing() + ('' if differs is None else f'; {differs}')
            self.wait(f"the controller's command ({why})")
        else:
            self.wait('the recorder (recorder/progress)')
            self._answer()

    def _on_recorded(self, raw: bytes) -> None:
        """Note how far the recorder is, and go on if lock-step was held up for it."""
        try:
            stamp = header_stamp(raw)
        except InputError as error:
            self._refusals.add('recorder/progress', error)
            return
        self._recorder.note(round(stamp / (1e9 * self._timing.period)), self._robot.tick)
        if self._lockstep:
            self._answer()

    # Wall clock.

    def _pace(self) -> None:
        """Let a timer run at the factor in force."""
        self._take_anchor()
        if not self._started:
            return
        if self._pacer is not None:
            self.node.destroy_timer(self._pacer)
        period = self._timing.period / max(1.0, self.values['real_time_factor'])
        self._pacer = self.node.create_timer(period, self._on_wall_clock, clock=self.steady)

    def _take_anchor(self) -> None:
        """Let simulated time run on from now at the factor in force."""
        self._anchor = (time.monotonic(), self._robot.tick)

    def _on_wall_clock(self) -> None:
        now, before = time.monotonic(), self._woken
        self._woken = now
        if now - before > max(0.5 * self.values['command_timeout'], 10.0 * self._timing.period):
            # This process was held up, and the robot's time with it; commands may be waiting.
            self._input.touch()
        if self._paused or not self._runs or self.finished:
            self._send_again(now)
            return
        since, tick = self._anchor
        factor = self.values['real_time_factor']
        due = tick + int((now - since) * factor / self._timing.period)
        behind = due - self._robot.tick
        if behind > 1:
            self._health.late += behind - 1  # by a period or more
        if behind > LATE_TICKS * max(1.0, factor):
            self.log.warning(
                f'{behind - 1} ticks late; the plant goes on from here',
                throttle_duration_sec=5.0,
            )
            due = self._robot.tick + 1
            self._anchor = (now, due)
        while self._robot.tick < due and not self.finished:
            self._advance(self._held_command(now))

    def _send_again(self, now: float) -> None:
        """Let nobody take a robot whose time stands still for one that is silent."""
        if not self.finished and now - self._sent > _HELD:
            self._sent = now
            self._output.send_again()

    def _held_command(self, now: float) -> np.ndarray | None:
        """
        Return the last command, None where nothing is commanded or that is too old.

        A command does not grow old while the robot's time stands still.
        """
        timeout = self.values['command_timeout']
        # Topic by topic: the messages of a command come, and grow old, one after the other.
        for topic in [] if self._paused else self._input.drop_old(now, timeout):
            if self._silences.is_due(topic):
                self.log.warning(
                    f'no command on {topic} for {timeout:g} s; the drives hold until one comes'
                )
        return self._input.held()

    def _report_health(self) -> Health:
        return self._health.report(
            self.node,
            [self.node.resolve_topic_name(part.topic) for part in self._input.parts],
            self._refusals,
            state=self._state_text(),
            ticks=self._robot.tick,
            command_age=self._input.age(time.monotonic()),
        )

    def _state_text(self) -> str:
        """Tell what the plant does, in a word."""
        if not self._started:
            return f'waits for {self._waiting or "its beginning"}'
        if self._paused:
            return 'paused'
        if not (self._lockstep or self._runs):
            return 'waits for the first command'
        return 'lock-step' if self._lockstep else 'real time'

    # Services.

    def _on_reset(self, _: Any, response: Any) -> Any:
        self._robot.reset()
        self._input.clear()
        self._recorder.set_back()
        self._take_anchor()
        if self._started:
            self._output.publish()
        response.success, response.message = True, 'the robot is in its initial state, t = 0 s'
        return response

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._paused = request.data
        self._take_anchor()
        self._input.touch()
        response.success = True
        # A request may arrive long after it was sent: the caller learns when it took effect.
        since = f'at t = {self._timing.time(self._robot.tick):g} s'
        if not self._started:
            since = 'before the run has begun'
        response.message = f'{"paused" if self._paused else "running"} {since}'
        if not self._paused and self._lockstep:
            self._answer()
        return response

    def _on_step(self, _: Any, response: Any) -> Any:
        """Advance by one control period while paused."""
        response.success = self._paused and self._started
        if not response.success:
            needed = 'pause with data true first' if self._started else 'again when it has'
            state = 'not paused' if self._started else 'the run has not begun'
            response.message = f'{state}; call {needed}'
            return response
        if self._lockstep:
            self._single_steps += 1
            self._answer()
        else:
            self._advance(self._held_command(time.monotonic()))
        response.message = f't = {self._timing.time(self._robot.tick):g} s'
        return response


def main(arguments: list[str] | None = None) -> int:
    """Run the plant node."""
    return run([PlantNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
