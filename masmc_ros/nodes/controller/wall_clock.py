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

"""The wall clock: states come when they come, and what stays away for too long is a fault."""

from __future__ import annotations

import time

from masmc_ros.loop.stamp_order import Order, state_timeout
from masmc_ros.loop.supervisor import NO_REFERENCE
from masmc_ros.nodes.controller.pacing import Control, LAW, REFERENCE, STATES
import numpy as np
from numpy.typing import NDArray


class WallClock:
    """Holds positions and torques for a while, then commands nothing; goes on by itself."""

    name = 'realtime'

    def __init__(self, control: Control) -> None:
        """Take what is paced."""
        self._control = control
        self._was_silent = False
        self._held_since: float | None = None

    @property
    def gap_ns(self) -> int | None:
        """Longest ordinary distance in ns between two states."""
        return round(1e9 * state_timeout(self._control.values))

    def watch(self) -> None:
        """Note when states have been away for too long."""
        control = self._control
        if not control.supervisor.is_active:
            return
        timeout = state_timeout(control.values)
        is_silent = control.health.silence() > timeout
        # To a controller that was held up itself, states have come that it takes before its
        # next look.
        if is_silent and self._was_silent:
            control.supervision.fail(STATES, f'no usable joint_states for {timeout:g} s')
        self._was_silent = is_silent

    def is_near(self, order: Order) -> bool:
        """Return False for a single stamp far ahead: it may be wrong, and the next one tells."""
        return order is not Order.AHEAD

    def stopped(self) -> None:
        """Command nothing at once."""
        last = self._control.stamps.order.last
        if last is not None:
            self._control.send_none(last)

    def found(self) -> None:
        """Note that nothing is held."""
        self._held_since = None

    def held(self, stamp: int) -> NDArray[np.float64] | None:
        """Return the last position that was to be reached; a fault where that takes too long."""
        reference = self._control.windows.held_after(stamp)
        timeout = self._control.values['reference_timeout']
        if reference is not None:
            now = time.monotonic()
            self._held_since = since = self._held_since or now
            if 0.0 < timeout < now - since:
                self._control.supervision.fail(REFERENCE, f'{NO_REFERENCE} for {timeout:g} s')
        return reference

    def lack(self, stamp: int) -> None:
        """Command nothing: a robot that was moved before must not go on with its last torque."""
        if self._control.stamps.computed is not None:
            self._control.send_none(stamp)
            self._control.approach.begin()

    def begin(self, *, was_off: bool) -> None:
        """Approach the reference from wherever the robot is."""
        self._control.approach.begin()

    def go_on(self, stamp: int) -> None:
        """Reckon with the last torque for as long as it was held."""
        control, computed = self._control, self._control.stamps.computed
        if computed is None:
            return
        left_out = round((stamp - computed) / (1e9 * control.controller.period)) - 1
        if left_out > 0:
            control.controller.skip(left_out)
        control.layer.held(max(left_out, 0) + 1, control.state().position)

    def watch_reference(self, stamp: int, reference: NDArray[np.float64]) -> None:
        """Approach one that does not go on from where it was."""
        self._control.approach.watch(stamp, reference)

    def failed(self, error: Exception) -> None:
        """Note a fault: a plugged-in law may fail in any way, and must not take the node along."""
        reason = ' '.join(str(error).split())
        self._control.supervision.fail(LAW, reason, is_latched=True)
