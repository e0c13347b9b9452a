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

"""The controller's answers: from a state and its reference to the command that is sent."""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.loop.closed_loop import NOT_FINITE, SINGULAR
from masmc_ros.loop.controller_events import ACTIVATED, DEACTIVATED, RESUMED
from masmc_ros.loop.simulated_robot import diverged
from masmc_ros.loop.stamp_order import Order
from masmc_ros.loop.timing import Timing
from masmc_ros.nodes.controller.command_output import CommandOutput
from masmc_ros.nodes.controller.pacing import Control, Pacing, REFERENCE, STATES
from masmc_ros.nodes.controller.telemetry import ControllerTelemetry
from masmc_ros.nodes.process.base import Recorded, SuiteNode
import numpy as np
from numpy.typing import NDArray


class Answers:
    """
    Answers every state once: with what is computed, or that nothing is commanded.

    A state whose reference has not come waits for it (`pending`). The controller starts anew
    after an activation, and where states were missing or time was set back.
    """

    def __init__(
        self,
        node: SuiteNode,
        control: Control,
        pacing: Pacing,
        timing: Timing,
        output: CommandOutput,
        telemetry: ControllerTelemetry,
    ) -> None:
        """Take what is paced and how, and where commands and telemetry go."""
        self._node, self._log = node, node.log
        self._control = control
        self._timing = timing
        self._output, self._telemetry = output, telemetry
        self._last_stamp = None if timing.last is None else timing.stamp(timing.last)
        self._activations = control.supervisor.activations
        self._computes: bool | None = control.supervisor.is_active
        self._may_finish = True
        self._was_singular = False
        self._untold: list[Recorded] = []
        self.awaited: Callable[[], str] = lambda: ''
        """Returns the code that the next tick waits for, '' for none."""
        self._awaits_code = False
        self.pace(pacing)

    def pace(self, pacing: Pacing) -> None:
        """Judge stamps and silence by a pacing from now on."""
        self.pacing = pacing
        self._control.stamps.order.gap_ns = pacing.gap_ns

    def note(self, event: str = '', changed: tuple[str, ...] = ()) -> None:
        """Note what is to be told on ~/parameters with the next tick that is answered."""
        self._untold.append(Recorded(dict(self._node.values), changed, event))

    # Input.

    def accepts(self, stamp: int) -> bool:
        """Tell whether a state is to be answered, by its stamp in ns beside those before it."""
        health, stamps = self._control.health, self._control.stamps
        health.saw_state(stamp)
        order = stamps.order.judge(stamp)
        # After the run's last state, which may come far ahead to a controller that was held up
        # at the end, there is no next one that tells.
        self._may_finish = self.pacing.is_near(order) or stamp == self._last_stamp
        if order is Order.NEXT:
            return True
        if order is Order.LATE:
            health.late += 1
            return False
        if order is not Order.REPEATED:
            self._start_anew(order)
        elif stamps.pending is None:
            health.repeated += 1
            self._output.repeat()
            return False
        return True

    def take_state(self, stamp: int) -> None:
        """Answer the state at hand."""
        if not self._control.supervisor.is_active:
            self._control.supervision.recover(STATES, is_anew=False)
        self.answer(stamp)

    def take_reference(self) -> None:
        """Answer a state that has waited for its reference."""
        pending = self._control.stamps.pending
        if pending is not None:
            self.answer(pending)

    def take_code(self) -> None:
        """Answer a state that has waited for compiled code."""
        if self._awaits_code:
            self._awaits_code = False
            self.take_reference()

    def _start_anew(self, order: Order) -> None:
        if order is Order.BACK:
            self._log.info('the robot was set back; the controller starts anew')
        else:
            self._control.health.gaps += 1
            self._log.warning(
                'states were missing for long; the controller starts anew',
                throttle_duration_sec=1.0,
            )
        self._control.stamps.pending = None
        self._activations = -1
        self._computes = None

    # Answer.

    def answer(self, stamp: int) -> None:
        """Compute and publish the command for the state at hand."""
        control, node = self._control, self._node
        if control.supervisor.is_active and (awaited := self.awaited()):
            control.stamps.pending, self._awaits_code = stamp, True
            node.wait(awaited)
            return
        reference = self._look_up(stamp)
        if control.supervisor.is_active:
            if reference is None:
                control.stamps.pending = stamp
                node.wait('the trajectory (reference)')
                self.pacing.lack(stamp)
                return
            self._compute(stamp, reference)
            if node.failure is not None:
                return
        control.stamps.pending = None
        node.wait(None)
        # What cannot be computed may have been a fault.
        is_active = control.supervisor.is_active
        if is_active:
            self._output.send(stamp)
            control.health.computed(control.controller)
        else:
            self.send_none(stamp)
        control.health.answered()
        tick = round(stamp / (1e9 * self._timing.period))
        if is_active:
            self._telemetry.send(tick, stamp)
        for change in self._untold:
            node.record_parameters(tick, stamp, change)
        self._untold.clear()
        if self._timing.last is not None and tick >= self._timing.last and self._may_finish:
            node.finished = True

    def send_none(self, stamp: int) -> None:
        """Answer a state of a stamp in ns by commanding nothing."""
        self._control.controller.rest()
        if self._computes is not False:
            self._computes = False
            self.note(DEACTIVATED)
        self._output.send_none(stamp)

    def _look_up(self, stamp: int) -> NDArray[np.float64] | None:
        """Return the reference to follow at a stamp; None where there is none yet."""
        reference = self._control.windows.at(stamp)
        if reference is None:
            return self.pacing.held(stamp)
        self.pacing.found()
        if not self._control.supervisor.is_active:
            self._control.supervision.recover(REFERENCE, is_anew=True)
        return reference

    def _compute(self, stamp: int, reference: NDArray[np.float64]) -> None:
        control, pacing, state = self._control, self.pacing, self._control.state()
        controller, approach = control.controller, control.approach
        activations = control.supervisor.activations
        if self._activations != activations:
            self._activations = activations
            controller.reset()
            pacing.begin(was_off=self._computes is False)
            self.note(ACTIVATED)
        elif control.stamps.computed is None:
            pacing.begin(was_off=False)
        elif not self._computes:
            self.note(RESUMED)
        else:
            pacing.go_on(stamp)
        self._computes, control.stamps.computed = True, stamp
        pacing.watch_reference(stamp, reference)
        if approach.is_on:
            rates = controller.rates(state.velocity)
            reference = approach.follow(stamp, state.position, rates, reference)
        try:
            found = controller.answer(state.position, state.velocity, reference)
            if found & NOT_FINITE:
                raise diverged(stamp * 1e-9)
        except Exception as error:
            pacing.failed(error)
            return
        singular = found & SINGULAR != 0
        if singular != self._was_singular:
            self._was_singular = singular
            self._say_singular(stamp, singular)

    def _say_singular(self, stamp: int, singular: bool) -> None:
        mechanism = self._control.controller.mechanism
        if singular:
            self._log.warning(
                f'at t = {stamp * 1e-9:.3f} s {mechanism.lost} is close to singular '
                f'({mechanism.singular}); motion along the lost direction is damped'
            )
        else:
            self._log.info(
                f'at t = {stamp * 1e-9:.3f} s {mechanism.lost} has left the singularity'
            )
