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

"""What the controller's two ways through time have in common: lock-step and the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from masmc_ros.errors import UserError
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.stamp_order import Order, StampOrder
from masmc_ros.loop.supervisor import Supervisor
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.nodes.controller.health import ControllerHealth
from masmc_ros.nodes.controller.layer_watch import LayerWatch
from masmc_ros.nodes.controller.supervision import Supervision
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.windows import ReferenceWindows
import numpy as np
from numpy.typing import NDArray

STATES, REFERENCE, LAW = 'states', 'reference', 'law'
"""Causes of faults."""


@dataclass
class Stamps:
    """
    Stamps in ns of the states by which the controller goes; None for none.

    Attributes
    ----------
    order
        how the next one follows, and the latest.
    pending
        of the state that waits for its reference.
    computed
        of the last one for which a command was computed since the start.

    """

    order: StampOrder = field(default_factory=StampOrder)
    pending: int | None = None
    computed: int | None = None


class Control(NamedTuple):
    """What is paced."""

    values: Mapping[str, Any]
    """Parameters in force."""
    controller: Controller
    supervisor: Supervisor
    supervision: Supervision
    health: ControllerHealth
    approach: Approach
    layer: LayerWatch
    windows: ReferenceWindows
    stamps: Stamps
    state: Callable[[], JointStateCdr]
    """Returns the state at hand."""
    answer: Callable[[int], None]
    """Sends the command for the state at hand, of a stamp in ns."""
    send_none: Callable[[int], None]
    """Answers a state of a stamp in ns by commanding nothing."""
    fail: Callable[[UserError], None]
    """Ends the run."""


class Pacing(Protocol):
    """
    What the controller makes of time: of states and references that are late, and of faults.

    Attributes
    ----------
    name
        as the parameter `pacing` has it.

    """

    name: str

    @property
    def gap_ns(self) -> int | None:
        """Longest ordinary distance in ns between two states; None where none is missing."""

    def watch(self) -> None:
        """Look how long states have been away."""

    def is_near(self, order: Order) -> bool:
        """Tell whether a stamp that follows so may be taken at its word."""

    def stopped(self) -> None:
        """Go by a supervisor that is no longer active."""

    def found(self) -> None:
        """Note that there is a reference for the state at hand."""

    def held(self, stamp: int) -> NDArray[np.float64] | None:
        """Return what to follow at a stamp that no reference covers; None to wait for it."""

    def lack(self, stamp: int) -> None:
        """Go by a state that waits for its reference."""

    def begin(self, *, was_off: bool) -> None:
        """Go by a start, or by an activation that ends a time in which nothing was commanded."""

    def go_on(self, stamp: int) -> None:
        """Go by the time since the tick before this one."""

    def watch_reference(self, stamp: int, reference: NDArray[np.float64]) -> None:
        """Look whether a reference goes on from where it was."""

    def failed(self, error: Exception) -> None:
        """Go by a command that could not be computed."""
