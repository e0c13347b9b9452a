# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Latest command of the robot, with one part for each command topic."""

from __future__ import annotations

from collections.abc import Sequence
import math

from masmc_ros.aliases import Array
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
