# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Actions that the controller's core requests from its caller, as plain data.

The actions of an ordinary tick are created once and reused: the caller performs the actions of
an event before it passes on the next event. `Throttle` limits the rate of log lines about each
subject; the limit of the loggers knows only one.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

from masmc_ros.control.supervisor import LifecycleState
from masmc_ros.errors import UserError
from masmc_ros.params.declaration import Values


class Command:
    """
    Send the law's torque as the response to a state.

    Attributes
    ----------
    stamp
        Stamp of the state in ns.

    """

    __slots__ = ('stamp',)

    def __init__(self, stamp: int = 0) -> None:
        """Initialise the action with the stamp of the state in ns."""
        self.stamp = stamp


class StopCommand(Command):
    """Send the torque of the safe stop as the response to a state."""

    __slots__ = ()


class Void(Command):
    """Send a void command as the response to a state."""

    __slots__ = ()


class Halt(Command):
    """Send a void command at once, labelled with the last state, which already has a response."""

    __slots__ = ()


class HaltCommand(Command):
    """Send the torque of the safe stop at once, labelled with the last state."""

    __slots__ = ()


class Telemetry(Command):
    """Publish the signals of the computed tick."""

    __slots__ = ()


class Repeat:
    """Send the last command again."""

    __slots__ = ()


class Record(NamedTuple):
    """Publish parameters or an event with the first tick that uses them."""

    tick: int
    stamp: int
    values: Values
    changed: tuple[str, ...] = ()
    event: str = ''


class State(NamedTuple):
    """Publish the state of the controller; log it at a level, empty for no line."""

    text: str
    level: str
    lifecycle: LifecycleState


class Line(NamedTuple):
    """Log a line."""

    level: str
    text: str


class Wait(NamedTuple):
    """Report the reason of a long wait; None ends the wait."""

    reason: str | None


class Failure(NamedTuple):
    """End the run with an error."""

    error: UserError


class Finish(NamedTuple):
    """End the run: its last tick has its response."""


Action = Command | Repeat | Record | State | Line | Wait | Failure | Finish
Actions = tuple[Action, ...]

NOTHING: Actions = ()


class Throttle:
    """Times of the last lines by subject."""

    def __init__(self, period: float) -> None:
        """Initialise with the time in s between two lines about the same subject."""
        self._period = period
        self._last: dict[Hashable, float] = {}

    def is_due(self, subject: Hashable, now: float) -> bool:
        """Return True if a line is due at a steady time in s; it counts as logged then."""
        if now - self._last.get(subject, -self._period) < self._period:
            return False
        self._last[subject] = now
        return True
