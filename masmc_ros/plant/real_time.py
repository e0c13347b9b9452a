# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Real time: the robot moves at the end of each period, by the last command."""

from __future__ import annotations

from collections.abc import Collection

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Line, Throttle
from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import COMMAND_TIMEOUT, REAL_TIME_FACTOR
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import LATE_TICKS, Timing
from masmc_ros.params.declaration import Values
from masmc_ros.plant import plant_core

_REPEATED = 0.02
"""Time in s between two publications of the same state while the robot's time stands still."""

_QUIET = 5.0
"""Time in s between two lines about the same subject."""

_TICKS = 'ticks'

_MANY_DROPPED = 10
"""Consecutive dropped commands of a topic that are reported; single ones are late."""


class RealTime(plant_core.PlantCore):
    """Plant that moves by time and uses a command until it is too old."""

    def __init__(
        self,
        robot: SimulatedRobot,
        timing: Timing,
        values: Values,
        commands: plant_core.Commands,
        *,
        waits: bool,
    ) -> None:
        """
        Initialise the core.

        Parameters
        ----------
        robot, commands
            Parts that belong to the core from now on.
        timing
            Control period and number of ticks of the run.
        values
            Checked parameter values of the plant; changes of live ones appear here.
        waits
            True if time starts with the first command.

        """
        super().__init__(robot, timing, values, commands)
        self._runs = not waits
        self._woken = self._repeated = 0.0
        self._anchor = (0.0, 0)
        self._due = -1
        self._throttle = Throttle(_QUIET)
        self._dropped = dict.fromkeys((part.topic for part in commands.parts), 0)

    def start(self, now: float) -> plant_core.Actions:
        """Publish the first state; time runs, or starts with the first command."""
        self._set_anchor(now)
        return super().start(now)

    def on_command(
        self, part: plant_core.CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> plant_core.Actions:
        """Use a command to a state within the command timeout, or one that names no state."""
        if answered == 0 and part.is_zero_unlabelled:
            answered = None
        oldest = 1e9 * self._values[COMMAND_TIMEOUT.name] * self._values[REAL_TIME_FACTOR.name]
        is_recent = answered is None or 0 <= self.stamp - answered <= oldest
        if not (self.has_started and is_recent):
            self.dropped += 1
            return self._explained_drop(part.topic, answered, oldest, now)
        self._dropped[part.topic] = 0
        part.take(numbers, answered, now)
        if not self._runs:
            self._set_anchor(now)
            self._runs = True
        return plant_core.NOTHING

    def on_timer(self, now: float) -> plant_core.Actions:
        """Update the ticks that are due; repeat the state while time stands still."""
        period, before = self._timing.period, self._woken
        self._woken = now
        if now - before > max(0.5 * self._values[COMMAND_TIMEOUT.name], 10.0 * period):
            # The process was late, and the robot's time with it: new commands may be in the queue.
            self.commands.touch(now)
        if self.is_over or not self.has_started:
            return plant_core.NOTHING
        if self.is_paused or not self._runs:
            return self._repetition(now)
        since, tick = self._anchor
        factor = self._values[REAL_TIME_FACTOR.name]
        self._due = tick + int((now - since) * factor / period)
        behind = self._due - self.robot.tick
        if behind > 1:
            self.lateness.add_late(behind - 1)
        if behind <= LATE_TICKS * max(1.0, factor):
            return plant_core.NOTHING
        self.lateness.add_skipped(behind - 1)
        self._due = self.robot.tick + 1
        self._anchor = (now, self._due)
        return self._lines(_TICKS, f'{behind - 1} ticks late; the plant skips them', now)

    @property
    def is_due(self) -> bool:
        """Return True if a tick is due now."""
        return self.robot.tick < self._due and not self.is_over

    def on_due(self, now: float) -> plant_core.Actions:
        """Advance by the last command."""
        lines, command = self._held_command(now)
        is_older = command is not None and not self.commands.answer(self.stamp)
        self.lateness.add_tick(is_older=is_older)
        actions = self._advance(command, now)
        return (*lines, *actions) if lines else actions

    @property
    def timer_period(self) -> float:
        """Control period in s, or a shorter time if the robot's time runs faster."""
        return self._timing.period / max(1.0, self._values[REAL_TIME_FACTOR.name])

    def on_parameters(self, changed: Collection[str], now: float) -> plant_core.Actions:
        """Use the changed parameters, the real-time factor among them, from now on."""
        if REAL_TIME_FACTOR.name in changed:
            self._set_anchor(now)
        return super().on_parameters(changed, now)

    def on_reset(self, now: float) -> plant_core.Actions:
        """Reset the robot to its initial state at t = 0 s; its time continues from `now`."""
        actions = super().on_reset(now)
        self._set_anchor(now)
        return actions

    def on_pause(self, now: float, *, is_paused: bool) -> plant_core.Actions:
        """Pause the robot's time, or continue from `now`."""
        self._set_anchor(now)
        return super().on_pause(now, is_paused=is_paused)

    def on_step(self, now: float) -> plant_core.Actions:
        """Advance by the last command of any age, because time stands still."""
        return self._advance(self.commands.held(), now)

    @property
    def text(self) -> str:
        """Short description of the pacing."""
        return 'real time' if self._runs else 'waits for the first command'

    def _set_anchor(self, now: float) -> None:
        self._anchor, self._due = (now, self.robot.tick), -1

    def _repetition(self, now: float) -> plant_core.Actions:
        """Repeat the state, so the controller detects no timeout while time stands still."""
        if now - self._repeated <= _REPEATED:
            return plant_core.NOTHING
        self._repeated = now
        return (plant_core.PublishAgain(),)

    def _held_command(self, now: float) -> tuple[plant_core.Actions, Array | None]:
        """Return lines about old commands, and the command; None without one."""
        timeout, lines = self._values[COMMAND_TIMEOUT.name], plant_core.NOTHING
        # By topic, because the messages of one command arrive at different times.
        for topic in self.commands.drop_old(now, timeout):
            text = f'no command on {topic} for {timeout:g} s; the drives hold until one comes'
            lines += self._lines(topic, text, now)
        return lines, self.commands.held()

    def _explained_drop(
        self, topic: str, answered: int | None, oldest: float, now: float
    ) -> plant_core.Actions:
        """Return a line about a topic whose commands are dropped again and again."""
        self._dropped[topic] += 1
        if not self.has_started or answered is None or self._dropped[topic] < _MANY_DROPPED:
            return plant_core.NOTHING
        text = (
            f'{topic} ignored: its stamp is {1e-9 * answered:.9g} s, and the last state has '
            f'{1e-9 * self.stamp:.9g} s; expected the stamp of a state that is at most '
            f'{1e-9 * oldest:g} s old, or a command without a stamp (a header with stamp 0)'
        )
        return self._lines(f'dropped {topic}', text, now)

    def _lines(self, subject: str, text: str, now: float) -> tuple[plant_core.Action, ...]:
        """Return a warning, or nothing if one about this subject is recent."""
        is_due = self._throttle.is_due(subject, now)
        return (Line('warning', text),) if is_due else plant_core.NOTHING

    def _explained(self, error: InputError, now: float) -> InputError:
        """Add a further possible cause: a machine that is too slow."""
        return InputError(
            f'{error}, and a machine that is fast enough; {self.lateness.total} ticks were '
            f'late, the last command arrived {self.commands.age(now):.3f} s ago'
        )
