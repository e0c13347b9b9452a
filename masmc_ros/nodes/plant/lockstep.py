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

"""Lock-step: every state waits for the command that answers it, for however long."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.nodes.plant.command_parts import Part
from masmc_ros.nodes.plant.pacing import Plant


class LockStep:
    """Moves the robot by each answer, not ahead of a recorder by more than its queues."""

    def __init__(self, plant: Plant) -> None:
        """Take what is paced."""
        self._plant = plant
        self.is_paused = False
        self._has_begun = False
        self._single_steps = 0
        self._watched = -1

    def connect(self) -> None:
        """Look once a second whether anything moves."""
        self._plant.node.create_timer(1.0, self._watch, clock=self._plant.steady)

    def begin(self) -> None:
        """Take commands from now on."""
        self._has_begun = True

    def is_current(self, part: Part, answered: int | None) -> bool:
        """Tell whether a command answers the outstanding state, as far as it can tell."""
        is_answer = answered == self._plant.output.stamp or not part.names_state
        return self._has_begun and is_answer

    def on_command(self) -> None:
        """Apply it."""
        self.go_on()

    def go_on(self) -> None:
        """Apply the command at hand, unless something holds the plant up."""
        plant = self._plant
        if plant.is_over() or not plant.commands.is_complete:
            return
        if self.is_paused and not self._single_steps:
            return
        if plant.recorder.holds_up(plant.robot.tick):
            return
        if self._single_steps:
            self._single_steps -= 1
        plant.advance(plant.commands.take())

    def change(self) -> None:
        """Do nothing: there is no speed to change."""

    def set_anchor(self) -> None:
        """Do nothing: there is no clock to go by."""

    def step(self) -> None:
        """Take one more command while paused."""
        self._single_steps += 1
        self.go_on()

    def explained(self, error: InputError) -> InputError:
        """Return the error: nothing was late."""
        return error

    @property
    def text(self) -> str:
        """Say what the plant does, in a word."""
        return 'lock-step'

    def _watch(self) -> None:
        """Note what lock-step stands still for; leave a silent recorder behind."""
        plant, tick = self._plant, self._plant.robot.tick
        stands_still, self._watched = tick == self._watched, tick
        if not self._has_begun:
            return
        if not stands_still or self.is_paused or plant.is_over():
            plant.wait(None)
        elif not plant.commands.is_complete:
            differs = plant.commands.disagreement(plant.node, 'controller')
            why = plant.commands.missing() + ('' if differs is None else f'; {differs}')
            plant.wait(f"the controller's command ({why})")
        else:
            plant.wait('the recorder (recorder/progress)')
            self.go_on()
