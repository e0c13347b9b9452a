# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
State machine of the simulated plant, without ROS: latest command, and count of late ticks.

Each event returns the actions that follow from it, in order. At most one of them publishes a
state: the caller performs them before the next event. There are no callbacks and no waiting, and
the caller supplies the time `now`, a steady time in s.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Failure, Line, Wait
from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH, PUSH_DURATION
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.params.declaration import Values
import numpy as np


class CommandPart:
    """
    The latest command of one topic.

    Attributes
    ----------
    topic
        Topic, relative to the robot.
    names_state
        True if its messages name the state to which they respond.
    is_zero_unlabelled
        True if in real time the stamp 0 names no state, as drivers leave a header empty.
    is_required
        True if without it there is no command at all; otherwise its numbers are then zero.
    is_here
        True if a message is available; it may be void.
    numbers
        Numbers of the command; None without one, and for a void one.
    time
        Monotonic time in s of its arrival.
    answered
        Stamp in ns of the state to which it responds; None if it names none.

    """

    def __init__(
        self,
        topic: str,
        width: int,
        *,
        names_state: bool = True,
        is_zero_unlabelled: bool = False,
        is_required: bool = False,
    ) -> None:
        """Initialise a part of `width` numbers without a command."""
        self.topic, self.names_state, self.is_required = topic, names_state, is_required
        self.is_zero_unlabelled = is_zero_unlabelled
        self.is_here = False
        self.numbers: Array | None = None
        self.time = -math.inf
        self.answered: int | None = None
        self._zeros = np.zeros(width)

    def take(self, numbers: Array | None, answered: int | None, now: float) -> None:
        """Copy the command of a message that arrived at `now`."""
        self.is_here, self.time, self.answered = True, now, answered
        self.numbers = None if numbers is None else numbers.copy()

    def clear(self) -> None:
        """Discard the command."""
        self.is_here, self.numbers = False, None

    def held(self) -> Array:
        """Return the command, zeros without one."""
        return self._zeros if self.numbers is None else self.numbers


class Commands:
    """The parts of a command, in the order of its numbers."""

    def __init__(self, parts: Sequence[CommandPart]) -> None:
        """Initialise the parts, which belong to this object from now on."""
        self.parts = tuple(parts)

    @property
    def is_complete(self) -> bool:
        """Return True if a message of every topic is available."""
        # Once a tick: a loop takes a third of the time of `all` and a generator.
        for part in self.parts:  # noqa: SIM110
            if not part.is_here:
                return False
        return True

    def take(self) -> Array | None:
        """Return the command as `held` does, and discard it."""
        command = self.held()
        self.clear()
        return command

    def held(self) -> Array | None:
        """Return the command, None without one; a missing part that is not required is zero."""
        if len(self.parts) == 1:
            return self.parts[0].numbers
        if any(part.is_required and part.numbers is None for part in self.parts):
            return None
        return np.concatenate([part.held() for part in self.parts])

    def answer(self, stamp: int) -> bool:
        """Return True if the command responds to the state of a stamp in ns, or names none."""
        return all(part.answered in (stamp, None) for part in self.parts)

    def clear(self) -> None:
        """Discard the command."""
        for part in self.parts:
            part.clear()

    def touch(self, now: float) -> None:
        """Treat the command as if it had arrived at `now`."""
        for part in self.parts:
            part.time = now

    def drop_old(self, now: float, timeout: float) -> list[str]:
        """Discard parts older than a timeout in s; return their topics."""
        old = [p for p in self.parts if p.numbers is not None and now - p.time > timeout]
        for part in old:
            part.clear()
        return [part.topic for part in old]

    def age(self, now: float) -> float:
        """Return the time in s since the oldest part arrived."""
        return now - min(part.time for part in self.parts)

    def missing(self) -> str:
        """Return the topics without a message."""
        return ' and '.join(part.topic for part in self.parts if not part.is_here)


_MAX_LEAD = 800
"""Largest lead of lock-step over the recorder in ticks; the recorder's queues are deeper."""

_PATIENCE = 5.0
"""Time in s without a report after which lock-step no longer waits."""


class RecorderPace:
    """Progress of a recorder by its reports, and whether lock-step has to wait for it."""

    def __init__(self) -> None:
        """Initialise without a recorder."""
        self._reached: int | None = None
        self._reported = -math.inf

    @property
    def is_there(self) -> bool:
        """Return True if a recorder has reported and is not ignored since then."""
        return self._reached is not None

    def report(self, reached: int, tick: int, now: float) -> None:
        """
        Process a report.

        Parameters
        ----------
        reached
            Tick up to which the recorder has written.
        tick
            Tick of the robot.
        now
            Time in s.

        """
        self._reported = now
        # A report from before a reset, or to an earlier plant, does not belong to this run.
        self._reached = min(reached, tick)

    def restart(self) -> None:
        """Restart with the run."""
        if self._reached is not None:
            self._reached = 0

    def must_wait(self, tick: int) -> bool:
        """Return True if a tick has to wait for the recorder."""
        return self._reached is not None and tick - self._reached > _MAX_LEAD

    def is_overdue(self, since: float, now: float) -> bool:
        """Return True if a wait from `since` on was too long without a report."""
        return now - max(since, self._reported) >= _PATIENCE

    def give_up(self) -> None:
        """Ignore the recorder until its next report."""
        self._reached = None


class Publish:
    """Publish the current state of the robot."""

    __slots__ = ()


class PublishAgain:
    """Publish the last state again."""

    __slots__ = ()


class AwaitCommand(NamedTuple):
    """Report after some time that a command is missing; `topics` are those without one."""

    topics: str


class EndPush:
    """Set the torque of the push to 0 from the current state on."""

    __slots__ = ()


class Done(NamedTuple):
    """End the run after its last command: `ticks` ticks in `seconds` s."""

    ticks: int
    seconds: float


Action = Publish | PublishAgain | AwaitCommand | EndPush | Wait | Line | Failure | Done
Actions = tuple[Action, ...]

NOTHING: Actions = ()
PUBLISH: Actions = (Publish(),)

_NEVER = -1
"""Tick of the end of a push that does not act."""


class PlantCore(ABC):
    """
    Base class of the two pacings, `LockStep` and `RealTime`: moves the robot by commands.

    Attributes
    ----------
    robot
        Simulated robot.
    commands
        Latest command.
    recorder
        Reports of a recorder.
    lateness
        Late ticks of a plant in real time.
    stamp
        Stamp of the last state in ns, -1 before the first.
    dropped
        Number of commands that did not respond to the current state.
    is_paused
        True while the robot's time does not advance.
    has_started
        True after the first state.
    is_over
        True after the last tick, and after a state that is not finite. A run without an end then
        waits for a reset.

    """

    def __init__(
        self,
        robot: SimulatedRobot,
        timing: Timing,
        values: Values,
        commands: Commands,
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

        """
        self.robot, self.commands = robot, commands
        self.recorder = RecorderPace()
        self.lateness = Lateness(timing.period)
        self.stamp, self.dropped = -1, 0
        self.is_paused = self.has_started = self.is_over = False
        self._timing, self._values = timing, values
        self._started = 0.0
        self._push_end = _NEVER

    # Events.

    def start(self, now: float) -> Actions:
        """Publish the first state."""
        self._started, self.has_started = now, True
        return self._publish()

    @abstractmethod
    def on_command(
        self, part: CommandPart, numbers: Array | None, answered: int | None, now: float
    ) -> Actions:
        """
        Use a command, or drop it if it responds to another state.

        Parameters
        ----------
        part
            Part of the command to which the message belongs.
        numbers
            Its numbers; None for a void command.
        answered
            Stamp in ns of the state to which it responds; None if it names none.
        now
            Time of arrival in s.

        """

    @abstractmethod
    def on_timer(self, now: float) -> Actions:
        """Respond to the time; to be called every `timer_period`."""

    def on_due(self, now: float) -> Actions:
        """Compute one of the ticks that are due; to be called while `is_due` is True."""
        return NOTHING

    @property
    def is_due(self) -> bool:
        """Return True if a tick is due now."""
        return False

    @property
    @abstractmethod
    def timer_period(self) -> float:
        """Time in s between two calls of `on_timer`; a change of parameters may change it."""

    def on_recorded(self, stamp: int, now: float) -> Actions:
        """Process the report of a recorder: it has written all messages up to a stamp in ns."""
        self.recorder.report(round(stamp / (1e9 * self._timing.period)), self.robot.tick, now)
        return NOTHING

    def on_parameters(self, changed: Collection[str], now: float) -> Actions:
        """Use parameters with changed names from now on: payload and push."""
        values = self._values
        if PAYLOAD_MASS.name in changed or PUSH.name in changed:
            self.robot.change(values)
        if PUSH.name in changed:
            ticks = max(1, round(PUSH_DURATION.of(values) / self._timing.period))
            self._push_end = self.robot.tick + ticks if any(PUSH.of(values)) else _NEVER
        return NOTHING

    def on_reset(self, now: float) -> Actions:
        """Reset the robot to its initial state at t = 0 s."""
        self.robot.reset()
        self.commands.clear()
        self.recorder.restart()
        self.is_over = self.is_over and not self._is_endless
        ended: Actions = NOTHING if self._push_end == _NEVER else (EndPush(),)
        return (*ended, *self._publish()) if self.has_started else ended

    def on_pause(self, now: float, *, is_paused: bool) -> Actions:
        """Pause the robot's time, or continue."""
        self.is_paused = is_paused
        self.commands.touch(now)
        return NOTHING

    def step_refusal(self) -> str:
        """Return why a single step is impossible; empty if it is possible."""
        if not self.has_started:
            return 'the run has not started; call again after its start'
        if self.is_over:
            return 'the robot has no finite state; call reset first'
        return '' if self.is_paused else 'not paused; call pause with data true first'

    @abstractmethod
    def on_step(self, now: float) -> Actions:
        """Advance by one period while paused."""

    @property
    @abstractmethod
    def text(self) -> str:
        """Short description of the pacing."""

    # Ticks.

    @property
    def _is_endless(self) -> bool:
        return self._timing.last is None

    def _advance(self, command: Array | None, now: float) -> Actions:
        """Apply a command (joints) for a period, None for no command."""
        if self.robot.tick == self._timing.last:
            self.is_over = True
            return (Done(self.robot.tick, now - self._started),)
        try:
            self.robot.advance(command)
        except InputError as error:
            self.is_over = True
            error = self._explained(error, now)
            if self._is_endless:
                return (Line('warning', f'{error}; the robot stands until ~/reset is called'),)
            return (Failure(error),)
        if self.robot.tick == self._push_end:
            return (*self._publish(), EndPush())
        return self._publish()

    def _publish(self) -> Actions:
        self.stamp = self._timing.stamp(self.robot.tick)
        return PUBLISH

    def _explained(self, error: InputError, now: float) -> InputError:
        """Return the error that ends the run, with a further possible cause."""
        return error


TOLERATED_SHARE = 0.02
"""
Share of late ticks above which the plant warns.

With the default parameters and delays of up to 50 ms, the largest error of the end effector is
4.8 mm at this share, 3.8 mm without late ticks, and it grows with the share
(docs/reference/real_time.md).
"""

_REMEDY = (
    'use a longer control_period, or fewer publishers and less telemetry '
    '(odom_decimation, tf_decimation, clock_decimation, telemetry_decimation)'
)


class Lateness:
    """
    Counts of ticks since the last report.

    Attributes
    ----------
    total
        Number of late ticks since the start: computed a period or more after they were due, or
        skipped.

    """

    def __init__(self, period: float) -> None:
        """Initialise the counts; `period` is the control period in s."""
        self._period = period
        self.total = 0
        self._restart()

    def _restart(self) -> None:
        self._ticks = self._late = self._skipped = self._older = 0

    def add_tick(self, *, is_older: bool) -> None:
        """Count a tick; `is_older`: its command responds to an earlier state than the last one."""
        self._ticks += 1
        self._older += is_older

    def add_late(self, ticks: int) -> None:
        """Count ticks that are a period or more late, including those that are skipped."""
        self.total += ticks
        self._late += ticks

    def add_skipped(self, ticks: int) -> None:
        """Count late ticks that are skipped: the robot's time falls behind by them."""
        self._skipped += ticks

    def report(self, seconds: float) -> tuple[Mapping[str, str], str]:
        """
        Return figures and the warning since the last report, and restart the counts.

        Parameters
        ----------
        seconds
            Time since the last report.

        Returns
        -------
            Figures by name for /diagnostics, and one line, '' if there are few late ticks.

        """
        due = self._ticks + self._skipped
        late = min(1.0, self._late / max(1, due))
        behind = self._skipped * self._period
        figures = {
            'late ticks': str(self.total),
            'late ticks in the last second (%)': f'{100.0 * late:.1f}',
            "robot's time behind in the last second (s)": f'{behind:.3f}',
            'ticks under an older command in the last second (%)': (
                f'{100.0 * self._older / max(1, self._ticks):.1f}'
            ),
        }
        self._restart()
        if late <= TOLERATED_SHARE:
            return figures, ''
        return figures, (
            f"late ticks: {100.0 * late:.1f} % of the last {seconds:.1f} s, and the robot's time "
            f'fell behind by {behind:.3f} s; expected at most {100.0 * TOLERATED_SHARE:g} %; '
            f'{_REMEDY}'
        )
