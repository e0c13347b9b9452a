# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Limit of the rate of log lines about each subject; the loggers' own limit knows only one."""

from __future__ import annotations

from collections.abc import Hashable


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
