# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lock-step: the plant waits for the command to each state."""

from __future__ import annotations

from masmc_ros.control.actions import Line, Wait
from masmc_ros.plant.commands import CommandPart
from masmc_ros.plant.core import Actions, Array, AwaitCommand, NOTHING, PlantCore


class LockStep(PlantCore):
    """Moves the robot by each command, and not ahead of a recorder by more than its queues."""

    text = 'lock-step'
    timer_period = 1.0

    _single_steps = 0
    _seen_tick = -1
    _waiting_since: float | None = None

    def on_command(
        self, part: CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> Actions:
        """Apply a command to the last state; one that names no state is taken for that."""
        if not self.has_started or (answered != self.stamp and part.names_state):
            self.dropped += 1
            return NOTHING
        part.take(numbers, answered, now)
        return self._continued(now)

    def on_timer(self, now: float) -> Actions:
        """Return what the run waits for; give up a recorder that is silent."""
        tick = self.robot.tick
        has_moved, self._seen_tick = tick != self._seen_tick, tick
        if not self.has_started:
            return NOTHING
        if has_moved or self.is_paused or self.is_over:
            self._waiting_since = None
            return (Wait(None),)
        if not self.commands.is_complete:
            return (AwaitCommand(self.commands.missing()),)
        # A slow run may take longer than the patience until it is that far ahead.
        if self._waiting_since is None:
            self._waiting_since = now
        if not self.recorder.is_silent(self._waiting_since, now):
            return (Wait('the recorder (recorder/progress)'),)
        self.recorder.give_up()
        line = Line('warning', 'the recorder does not respond; the run continues without it')
        return (line, *self._continued(now))

    def on_recorded(self, stamp: int, now: float) -> Actions:
        """Continue if the run waited for the recorder."""
        super().on_recorded(stamp, now)
        return self._continued(now)

    def on_pause(self, now: float, *, is_paused: bool) -> Actions:
        """Stop, or continue with the command that is available."""
        super().on_pause(now, is_paused=is_paused)
        return self._continued(now)

    def on_step(self, now: float) -> Actions:
        """Apply one more command while paused."""
        self._single_steps += 1
        return self._continued(now)

    def _continued(self, now: float) -> Actions:
        """Apply the available command, unless something holds the plant."""
        if self.is_over or not self.commands.is_complete:
            return NOTHING
        if self.is_paused and not self._single_steps:
            return NOTHING
        if self.recorder.holds_up(self.robot.tick):
            return NOTHING
        if self._single_steps:
            self._single_steps -= 1
        return self._advance(self.commands.take(), now)
