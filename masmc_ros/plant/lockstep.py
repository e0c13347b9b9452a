# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lock-step: the plant waits for the command to each state."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Line, Wait
from masmc_ros.plant.latest_command import CommandPart
from masmc_ros.plant.plant_core import Actions, AwaitCommand, NOTHING, PlantCore


class LockStep(PlantCore):
    """Plant that waits for each command, and for a recorder whose queues would overflow."""

    text = 'lock-step'
    timer_period = 1.0

    _single_steps = 0
    _seen_tick = -1
    _waiting_since: float | None = None

    def on_command(
        self, part: CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> Actions:
        """Apply a command to the last state, or a part of one that names no state (Twist)."""
        if not self.has_started or (answered != self.stamp and part.names_state):
            self.dropped += 1
            return NOTHING
        part.take(numbers, answered, now)
        return self._continued(now)

    def on_timer(self, now: float) -> Actions:
        """Report the reason of a wait; ignore a recorder without reports."""
        tick = self.robot.tick
        has_moved, self._seen_tick = tick != self._seen_tick, tick
        if not self.has_started:
            return NOTHING
        if has_moved or self.is_paused or self.is_over:
            self._waiting_since = None
            return (Wait(None),)
        if not self.commands.is_complete:
            return (AwaitCommand(self.commands.missing()),)
        # The patience counts from the start of the wait: in a slow run the last report is older.
        if self._waiting_since is None:
            self._waiting_since = now
        if not self.recorder.is_overdue(self._waiting_since, now):
            return (Wait('the recorder (recorder/progress)'),)
        self.recorder.give_up()
        line = Line('warning', 'the recorder does not respond; the run continues without it')
        return (line, *self._continued(now))

    def on_recorded(self, stamp: int, now: float) -> Actions:
        """Continue if the run waited for the recorder."""
        super().on_recorded(stamp, now)
        return self._continued(now)

    def on_reset(self, now: float) -> Actions:
        """Reset the robot; single steps without a command until now are dropped."""
        self._single_steps = 0
        return super().on_reset(now)

    def on_pause(self, now: float, *, is_paused: bool) -> Actions:
        """Pause, or continue with the available command."""
        super().on_pause(now, is_paused=is_paused)
        self._single_steps = 0
        return self._continued(now)

    def on_step(self, now: float) -> Actions:
        """Apply one more command while paused."""
        self._single_steps += 1
        return self._continued(now)

    def _continued(self, now: float) -> Actions:
        """Apply the available command unless the plant is paused or waits for the recorder."""
        if self.is_over or not self.commands.is_complete:
            return NOTHING
        if self.is_paused and not self._single_steps:
            return NOTHING
        if self.recorder.must_wait(self.robot.tick):
            return NOTHING
        if self._single_steps:
            self._single_steps -= 1
        return self._advance(self.commands.take(), now)
