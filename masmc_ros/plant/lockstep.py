# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lock-step: the plant waits for the command to each state, with or without a limit of speed."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Line, Wait
from masmc_ros.loop.plant_parameters import MAX_REAL_TIME_FACTOR
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.params.declaration import Values
from masmc_ros.plant import plant_core

_LOOK = 1.0
"""Time in s between two checks of the reason of a wait."""

_CATCH_UP = 0.05
"""Longest delay in s for which a robot in lock-step with a limit of speed makes up."""


class LockStep(plant_core.PlantCore):
    """Plant that waits for each command, and for a recorder whose queues would overflow."""

    text = 'lock-step'
    timer_period = _LOOK

    _single_steps = 0
    _seen_tick = -1
    _waiting_since: float | None = None

    def on_command(
        self, part: plant_core.CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> plant_core.Actions:
        """Apply a command to the last state, or a part of one that names no state (Twist)."""
        if not self.has_started or (answered != self.stamp and part.names_state):
            self.dropped += 1
            return plant_core.NOTHING
        part.take(numbers, answered, now)
        return self._continued(now)

    def on_timer(self, now: float) -> plant_core.Actions:
        """Report the reason of a wait; ignore a recorder without reports."""
        tick = self.robot.tick
        has_moved, self._seen_tick = tick != self._seen_tick, tick
        if not self.has_started:
            return plant_core.NOTHING
        if has_moved or self.is_paused or self.is_over:
            self._waiting_since = None
            return (Wait(None),)
        if not self.commands.is_complete:
            return (plant_core.AwaitCommand(self.commands.missing()),)
        # The patience counts from the start of the wait: in a slow run the last report is older.
        if self._waiting_since is None:
            self._waiting_since = now
        if not self.recorder.is_overdue(self._waiting_since, now):
            return (Wait('the recorder (recorder/progress)'),)
        self.recorder.give_up()
        line = Line('warning', 'the recorder does not respond; the run continues without it')
        return (line, *self._continued(now))

    def on_recorded(self, stamp: int, now: float) -> plant_core.Actions:
        """Continue if the run waited for the recorder."""
        super().on_recorded(stamp, now)
        return self._continued(now)

    def on_reset(self, now: float) -> plant_core.Actions:
        """Reset the robot; single steps without a command until now are dropped."""
        self._single_steps = 0
        return super().on_reset(now)

    def on_pause(self, now: float, *, is_paused: bool) -> plant_core.Actions:
        """Pause, or continue with the available command."""
        super().on_pause(now, is_paused=is_paused)
        self._single_steps = 0
        return self._continued(now)

    def on_step(self, now: float) -> plant_core.Actions:
        """Apply one more command while paused."""
        self._single_steps += 1
        return self._continued(now)

    def _continued(self, now: float) -> plant_core.Actions:
        """Apply the available command unless the plant is paused or waits for the recorder."""
        if self.is_over or not self.commands.is_complete:
            return plant_core.NOTHING
        if self.is_paused and not self._single_steps:
            return plant_core.NOTHING
        if self.recorder.must_wait(self.robot.tick):
            return plant_core.NOTHING
        if self._single_steps:
            self._single_steps -= 1
        return self._advance(self.commands.take(), now)


class PacedLockStep(LockStep):
    """
    Lock-step whose time passes at most `max_real_time_factor` times as fast as real time.

    If messages are late, the time of the robot passes more slowly. A delay of up to 0.05 s is
    made up for: every tick has its command, so this has no effect on the control.
    """

    _next = 0.0
    """Monotonic time in s from which the next tick is allowed."""

    _look = 0.0

    def __init__(
        self, robot: SimulatedRobot, timing: Timing, values: Values, commands: plant_core.Commands
    ) -> None:
        """Initialise the core as a `PlantCore`."""
        super().__init__(robot, timing, values, commands)
        factor = MAX_REAL_TIME_FACTOR.of(values)
        self.timer_period = timing.period / factor
        self.text = f'lock-step at up to {factor:g} of real time'

    def start(self, now: float) -> plant_core.Actions:
        """Publish the first state; a tick is allowed a period later."""
        self._next = now + self.timer_period
        return super().start(now)

    def on_timer(self, now: float) -> plant_core.Actions:
        """Advance if a tick is allowed; once per second, report the reason of a wait."""
        if now < self._next:
            return plant_core.NOTHING
        if now < self._look:
            return self._continued(now)
        self._look = now + _LOOK
        return super().on_timer(now)

    def _continued(self, now: float) -> plant_core.Actions:
        """Apply the available command if a tick is allowed."""
        if now < self._next:
            return plant_core.NOTHING
        tick = self.robot.tick
        actions = super()._continued(now)
        if self.robot.tick != tick:
            self._next = max(self._next + self.timer_period, now - _CATCH_UP)
        return actions
