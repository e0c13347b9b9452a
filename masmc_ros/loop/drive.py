# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Law, approach and safe stop of one robot, and the effect of each event on them.

The controller core decides the events of a run, applies each of them here and records it. A
simulation applies the recorded ones. Both therefore compute the same commands. There are no
messages and no time but the stamps of states, in ns.
"""

from __future__ import annotations

from enum import Enum

from masmc_ros.aliases import Array
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_events import (
    ACTIVATED,
    ADAPTATION_RESET,
    DEACTIVATED,
    GUIDED,
    RELEASED,
    RESUMED,
    UNFOLDED,
)
from masmc_ros.loop.controller_parameters import APPROACH_ON_START, FAULT_ACTION, VOID
from masmc_ros.loop.safe_stop import (
    BALANCE,
    GUIDE,
    SafeStop,
    UNFOLD,
    UNFOLDING_TIME,
)
from masmc_ros.reference.approach import Approach


class Source(Enum):
    """Origin of the last command."""

    LAW = 'law'
    STOP = 'safe stop'
    NONE = 'none'
    """Before the first command of the law after a start or a restart."""


class Drive:
    """
    Commands of a law or, while it is not active, of the safe stop.

    Attributes
    ----------
    controller
        Law and its results; the safe stop writes its torque there too.
    approach
        Motion to the reference.
    stop
        Safe stop.
    is_timed
        True if robot and reference move on without a command, as in real time. Each start then
        approaches the reference, and so does a reference that steps.
    source
        Origin of the last command.
    computed
        Stamp of the last tick of the law in ns; None before the first one.
    has_moved
        True if a torque was commanded since the start or the last release.
    is_running
        True if the next tick of the law continues the last one without an event.
    is_stale
        True if the state is lost, so the safe stop restarts from the next one.

    """

    def __init__(
        self, controller: Controller, approach: Approach, *, is_active: bool, is_timed: bool
    ) -> None:
        """
        Initialise the drive at the start of a run.

        Parameters
        ----------
        controller, approach
            Parts that compute; they belong to the drive from now on.
        is_active
            True if the law is active from the start.
        is_timed
            True if robot and reference move on without a command.

        """
        self.controller, self.approach = controller, approach
        self.stop = SafeStop(controller)
        self.is_timed = is_timed
        self.source = Source.NONE if is_active else Source.STOP
        self.computed: int | None = None
        self.has_moved = self.is_running = self.is_stale = False
        self._is_restart_due = False
        self._action = VOID
        # Stamp at which leaving a singular posture ends; None if the posture is not left.
        self._unfolded_by: int | None = None
        self._period_ns = 1e9 * controller.period

    @property
    def is_active(self) -> bool:
        """Return True if the law commands after the applied events."""
        return self.source is not Source.STOP

    @property
    def is_unfolding(self) -> bool:
        """Return True while a singular posture is left before the law starts."""
        return self._unfolded_by is not None

    # Events.

    def law_event(self) -> str:
        """Return the event that precedes a tick of the law; empty without one."""
        if self._is_restart_due:
            return ACTIVATED
        return '' if self.is_running or self.computed is None else RESUMED

    def stop_event(self, *, is_guided: bool) -> str:
        """Return the event that precedes a command of the safe stop; empty without one."""
        action = self._stop_action(is_guided=is_guided)
        if self.source is Source.STOP and action == self._action:
            return ''
        return GUIDED if is_guided else DEACTIVATED

    def should_unfold(self, position: Array, velocity: Array) -> bool:
        """Return True if a singular posture precedes a start with an approach (`UNFOLDED`)."""
        is_approached = self.is_timed or self.source is Source.STOP
        return is_approached and self.stop.is_singular(position, velocity)

    def apply(self, event: str, stamp: int, position: Array, velocity: Array) -> None:
        """
        Apply an event before the command for a state.

        Parameters
        ----------
        event
            Event of `controller_events.EVENTS`.
        stamp
            Stamp of the state in ns.
        position, velocity
            State, (positions) each, in the order of joint_states.

        """
        if event == ADAPTATION_RESET:
            self.controller.reset_adaptation()
            return
        self.is_running = False
        if event == ACTIVATED:
            if self.is_timed or self.source is Source.STOP:
                self.approach.start()
            self.stop.hand_over()
            self.source, self._is_restart_due = Source.NONE, False
        elif event == RESUMED:
            if self.is_timed:
                self.approach.start()
            self.stop.end()
            self.source = Source.NONE
        elif event in (DEACTIVATED, GUIDED):
            is_guided = event == GUIDED
            self.has_moved |= is_guided
            action = self._stop_action(is_guided=is_guided)
            self._start_stop(action, stamp, position, velocity)
            self._unfolded_by, self.is_stale = None, False
        elif event == UNFOLDED:
            self.has_moved = True
            self._unfolded_by = stamp + round(1e9 * UNFOLDING_TIME)
            self._start_stop(UNFOLD, stamp, position, velocity)
        elif event == RELEASED:
            self.computed, self.has_moved = None, False

    def request_restart(self) -> None:
        """Let the next tick of the law restart it."""
        self._is_restart_due, self.is_running = True, False

    def restart(self, *, is_new_run: bool) -> None:
        """Restart after a jump of time; in a new run this drive has not moved the robot."""
        if is_new_run:
            self.computed, self.has_moved = None, False
        if not self.stop.commands:
            # The robot does not apply the last command any more.
            self.controller.output_not_applied()
        self.source, self._unfolded_by = Source.NONE, None
        self.request_restart()

    # Commands.

    def skip_to(self, stamp: int) -> int:
        """Account for the periods before a state in which a torque of the law was held."""
        if not self.is_running or self.computed is None:
            return 0
        skipped = round((stamp - self.computed) / self._period_ns) - 1
        if skipped <= 0:
            return 0
        self.controller.skip(skipped)
        return skipped

    def start_tick(self, stamp: int) -> None:
        """Account for a tick of the law at a stamp in ns; the first one may be an approach."""
        if self.computed is None and (
            self.is_timed or APPROACH_ON_START.of(self.controller.values)
        ):
            self.approach.start()
        self.source, self.computed = Source.LAW, stamp
        self.has_moved, self.is_running, self.is_stale = True, True, False

    def compute(self, stamp: int, position: Array, velocity: Array, reference: Array) -> int:
        """
        Compute a tick of the law.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        position, velocity
            State, (positions) each, in the order of joint_states.
        reference
            Reference (3 * axes) at this stamp.

        Returns
        -------
        int
            Status flags of `control_tick`.

        """
        if self.is_running:
            self.computed = stamp
        else:
            self.start_tick(stamp)
        approach = self.approach
        if self.is_timed:
            approach.watch(stamp, reference)
        if approach.is_on:
            rates = self.controller.rates(velocity)
            reference = approach.follow(stamp, position, rates, reference)
        return self.controller.answer(position, velocity, reference)

    def update_stop(self, stamp: int, position: Array, velocity: Array) -> bool:
        """Compute the torque of the safe stop for a state; return False for a void command."""
        if self.is_stale:
            self.stop.start(self._action, stamp, position, velocity)
            self.is_stale = False
        return self.stop.update(stamp, position, velocity)

    def unfold(self, stamp: int, position: Array, velocity: Array) -> bool:
        """Compute the torque that leaves a singular posture; return False without one."""
        if not self.stop.update(stamp, position, velocity):
            self._unfolded_by = None
        return self.is_unfolding

    def has_unfolded(self, stamp: int, position: Array, velocity: Array) -> bool:
        """Return True, and end leaving the posture, if it is regular or its time is over."""
        assert self._unfolded_by is not None
        if self.stop.is_singular(position, velocity) and stamp < self._unfolded_by:
            return False
        self._unfolded_by = None
        return True

    def balance(
        self, stamp: int, position: Array, velocity: Array, *, is_guided: bool
    ) -> bool:
        """Compute the gravity torque of a last state; return False for a void command."""
        self.source, self.is_running = Source.STOP, False
        action = VOID if self._stop_action(is_guided=is_guided) == VOID else BALANCE
        self.stop.start(action, stamp, position, velocity)
        return self.stop.update(stamp, position, velocity)

    def is_void(self, *, is_guided: bool) -> bool:
        """Return True if the safe stop would command nothing."""
        return self._stop_action(is_guided=is_guided) == VOID

    def _stop_action(self, *, is_guided: bool) -> str:
        if is_guided:
            return GUIDE
        # A controller that has not moved the robot does not hold it either.
        if not self.has_moved:
            return VOID
        return FAULT_ACTION.of(self.controller.values)

    def _start_stop(self, action: str, stamp: int, position: Array, velocity: Array) -> None:
        self.stop.start(action, stamp, position, velocity)
        self._action, self.source = action, Source.STOP
