# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of a recorder, which limits the lead of lock-step to the length of its queues."""

from __future__ import annotations

import math

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
