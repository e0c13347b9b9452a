# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The tick up to which a recorder has written: lock-step stays within its queues."""

from __future__ import annotations

import math

_AHEAD = 800
"""Ticks that lock-step may be ahead of what the recorder has written; its queues are deeper."""

_PATIENCE = 5.0
"""Time in s after which a silent recorder no longer holds lock-step."""


class RecorderPace:
    """Reports of a recorder, and whether to wait for it."""

    def __init__(self) -> None:
        """Initialise without a recorder."""
        self._reached: int | None = None
        self._reported = -math.inf

    @property
    def is_there(self) -> bool:
        """Return True if a recorder has reported and was not given up."""
        return self._reached is not None

    def note(self, reached: int, tick: int, now: float) -> None:
        """Note the tick up to which it has recorded; the robot is at `tick`."""
        self._reported = now
        # A report from before a reset, or to an earlier plant, does not belong to this run.
        self._reached = min(reached, tick)

    def set_back(self) -> None:
        """Note that nothing of the run, which restarts, is recorded."""
        if self._reached is not None:
            self._reached = 0

    def holds_up(self, tick: int) -> bool:
        """Return True if a tick has to wait for the recorder."""
        return self._reached is not None and tick - self._reached > _AHEAD

    def is_silent(self, since: float, now: float) -> bool:
        """Return True if it has not reported for too long, in a wait that started at `since`."""
        return now - max(since, self._reported) >= _PATIENCE

    def give_up(self) -> None:
        """Run without it until it reports again."""
        self._reached = None
