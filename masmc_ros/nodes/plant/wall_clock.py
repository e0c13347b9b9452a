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

"""The wall clock: the robot moves when a period is over, by the last command that has come."""

from __future__ import annotations

import time

from masmc_ros.errors import InputError
from masmc_ros.loop.timing import LATE_TICKS
from masmc_ros.nodes.plant.command_parts import Part
from masmc_ros.nodes.plant.pacing import Plant
from masmc_ros.nodes.process.throttle import Throttle
import numpy as np
from rclpy.timer import Timer

_HELD = 0.02
"""Time in s between two sendings of the same state while the robot's time stands still."""


class WallClock:
    """Moves the robot by time, and holds a command until it is too old."""

    def __init__(self, plant: Plant, *, waits: bool) -> None:
        """Take what is paced, and whether time begins with the first command."""
        self._plant = plant
        self._log = plant.node.get_logger()
        self.is_paused = False
        self._has_begun = False
        self._runs = not waits
        self._silences = Throttle(period=5.0)
        self._woken = self._sent = 0.0
        self._anchor = (0.0, 0)
        self._timer: Timer | None = None

    def connect(self) -> None:
        """Wait for the beginning."""

    def begin(self) -> None:
        """Let time run, or begin with the first command."""
        self._has_begun = True
        self.change()

    def is_current(self, part: Part, answered: int | None) -> bool:
        """Tell whether a command answers a state within the command timeout, or names none."""
        values = self._plant.values
        oldest = 1e9 * values['command_timeout'] * values['real_time_factor']
        is_recent = answered is None or 0 <= self._plant.output.stamp - answered <= oldest
        return self._has_begun and is_recent

    def on_command(self) -> None:
        """Let time begin with the first one."""
        if not self._runs:
            self.set_anchor()
            self._runs = True

    def go_on(self) -> None:
        """Do nothing: time does."""

    def change(self) -> None:
        """Let a timer run at the factor in force."""
        self.set_anchor()
        if not self._has_begun:
            return
        plant = self._plant
        if self._timer is not None:
            plant.node.destroy_timer(self._timer)
        period = plant.timing.period / max(1.0, plant.values['real_time_factor'])
        self._timer = plant.node.create_timer(period, self._on_time, clock=plant.steady)

    def set_anchor(self) -> None:
        """Let simulated time run on from now at the factor in force."""
        self._anchor = (time.monotonic(), self._plant.robot.tick)

    def step(self) -> None:
        """Advance by the command at hand."""
        self._plant.advance(self._held_command(time.monotonic()))

    def explained(self, error: InputError) -> InputError:
        """Add what else may be to blame: a machine that does not keep up."""
        plant = self._plant
        late = plant.health.lateness.total
        return InputError(
            f'{error}, and a machine that keeps up with it; {late} ticks were late,'
            f' the last command came {plant.commands.age(time.monotonic()):.3f} s ago'
        )

    @property
    def text(self) -> str:
        """Say what the plant does, in a word."""
        return 'real time' if self._runs else 'waits for the first command'

    def _on_time(self) -> None:
        plant, period = self._plant, self._plant.timing.period
        now, before = time.monotonic(), self._woken
        self._woken = now
        if now - before > max(0.5 * plant.values['command_timeout'], 10.0 * period):
            # This process was held up, and the robot's time with it; commands may be waiting.
            plant.commands.touch()
        if plant.is_over():
            return
        if self.is_paused or not self._runs:
            self._send_again(now)
            return
        since, tick = self._anchor
        factor = plant.values['real_time_factor']
        due = tick + int((now - since) * factor / period)
        behind = due - plant.robot.tick
        if behind > 1:
            plant.health.lateness.add_late(behind - 1)  # by a period or more
        if behind > LATE_TICKS * max(1.0, factor):
            self._log.warning(
                f'{behind - 1} ticks late; the plant goes on from here',
                throttle_duration_sec=5.0,
            )
            plant.health.lateness.add_given_up(behind - 1)
            due = plant.robot.tick + 1
            self._anchor = (now, due)
        while plant.robot.tick < due and not plant.is_over():
            command = self._held_command(now)
            is_older = command is not None and not plant.commands.answer(plant.output.stamp)
            plant.health.lateness.add_tick(is_older=is_older)
            plant.advance(command)

    def _send_again(self, now: float) -> None:
        """Let nobody take a robot whose time stands still for one that is silent."""
        if now - self._sent > _HELD:
            self._sent = now
            self._plant.output.send_again()

    def _held_command(self, now: float) -> np.ndarray | None:
        """
        Return the last command, None where nothing is commanded or that is too old.

        A command does not grow old while the robot's time stands still.
        """
        plant, timeout = self._plant, self._plant.values['command_timeout']
        # Topic by topic: the messages of a command come, and grow old, one after the other.
        for topic in [] if self.is_paused else plant.commands.drop_old(now, timeout):
            if self._silences.is_due(topic):
                self._log.warning(
                    f'no command on {topic} for {timeout:g} s; the drives hold until one comes'
                )
        return plant.commands.held()
