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

"""Lock-step: every state waits for its command, and the command for its reference."""

from __future__ import annotations

from masmc_ros.errors import UserError
from masmc_ros.loop.stamp_order import Order
from masmc_ros.nodes.controller.pacing import Control
import numpy as np
from numpy.typing import NDArray


class LockStep:
    """Takes its time: nothing is too late, and what is wrong ends the run."""

    name = 'lockstep'
    gap_ns = None

    def __init__(self, control: Control) -> None:
        """Take what is paced."""
        self._control = control

    def watch(self) -> None:
        """Do nothing: who waits for a command is silent."""

    def is_near(self, order: Order) -> bool:
        """Return False: every state comes, the last one too."""
        return False

    def stopped(self) -> None:
        """Command nothing, as the answer to the state that waits for one."""
        pending = self._control.stamps.pending
        if pending is not None:
            self._control.answer(pending)

    def found(self) -> None:
        """Do nothing."""

    def held(self, stamp: int) -> NDArray[np.float64] | None:
        """
        Return None: the plant waits for the command, and the reference is on its way.

        Where a newer state while one is unanswered tells that the plant does not wait, the
        last position is held. To one that has commanded nothing yet, newer states may be those
        of the past, which a successor is given.
        """
        stamps = self._control.stamps
        if stamps.computed is None or stamps.pending in (None, stamp):
            return None
        return self._control.windows.held_after(stamp)

    def lack(self, stamp: int) -> None:
        """Do nothing: the robot stands still."""

    def begin(self, *, was_off: bool) -> None:
        """Approach the reference; but the beginning of a run is what was asked for."""
        if was_off:
            self._control.approach.begin()

    def go_on(self, stamp: int) -> None:
        """Do nothing: no tick is left out."""

    def watch_reference(self, stamp: int, reference: NDArray[np.float64]) -> None:
        """Do nothing: a reference may begin anew as it likes."""

    def failed(self, error: Exception) -> None:
        """End the run."""
        if not isinstance(error, UserError):
            raise error
        self._control.fail(error)
