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

"""What the plant's two ways through time have in common: lock-step and the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from masmc_ros.errors import InputError
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.nodes.plant.command_input import CommandInput
from masmc_ros.nodes.plant.command_parts import Part
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.plant.recorder_pace import RecorderPace
from masmc_ros.nodes.plant.state_output import StateOutput
import numpy as np
from rclpy.clock import Clock
from rclpy.node import Node


class Plant(NamedTuple):
    """What is paced."""

    node: Node
    steady: Clock
    values: Mapping[str, Any]
    """Parameters in force."""
    timing: Timing
    robot: SimulatedRobot
    commands: CommandInput
    output: StateOutput
    health: PlantHealth
    recorder: RecorderPace
    wait: Callable[[str | None], None]
    """Takes what the plant waits for, None for nothing."""
    advance: Callable[[np.ndarray | None], None]
    """Holds a command (joints) for a period, None for none."""
    is_over: Callable[[], bool]
    """Tells whether the run is."""


class Pacing(Protocol):
    """
    When the robot moves, and by which commands.

    Attributes
    ----------
    is_paused
        whether the robot's time stands still.

    """

    is_paused: bool

    def connect(self) -> None:
        """Create timers."""

    def begin(self) -> None:
        """Let time run: the first state is published."""

    def is_current(self, part: Part, answered: int | None) -> bool:
        """Tell whether a command is for the present, by the stamp in ns that it answers."""

    def on_command(self) -> None:
        """Go by a command that has come."""

    def go_on(self) -> None:
        """Go by what is at hand: a pause is over, or the recorder has reported."""

    def change(self) -> None:
        """Go by parameters that have changed."""

    def set_anchor(self) -> None:
        """Go on from now: the robot was set back, or its time stands still or goes on."""

    def step(self) -> None:
        """Advance by one period while paused."""

    def explained(self, error: InputError) -> InputError:
        """Return what ends the run, with what else may be to blame."""

    @property
    def text(self) -> str:
        """Say what the plant does, in a word."""
