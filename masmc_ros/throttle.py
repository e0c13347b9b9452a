# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lines about many things, each told now and then: the logger's own throttle knows only one."""

from __future__ import annotations

from collections.abc import Hashable
import time


class Throttle:
    """Tells of each subject whether a line about it is due."""

    def __init__(self, period: float) -> None:
        """Let `period` in s pass between two lines about the same subject."""
        self._period = period
        self._told: dict[Hashable, float] = {}

    def is_due(self, subject: Hashable) -> bool:
        """Tell whether nothing was said about it for a period; if so, it counts as said now."""
        now = time.monotonic()
        if now - self._told.get(subject, -self._period) < self._period:
            return False
        self._told[subject] = now
        return True
