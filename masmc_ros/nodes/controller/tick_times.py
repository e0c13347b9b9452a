# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Rate of a loop and duration of its ticks between two reports."""

from __future__ import annotations

import time


class TickTimes:
    """
    Durations of ticks.

    Attributes
    ----------
    total
        Number of ticks.
    overruns
        Number of ticks that took longer than a period.

    """

    def __init__(self, period: float) -> None:
        """Initialise with the control period in s."""
        self._period = period
        self._since = time.monotonic()
        self._counted = 0
        self._longest = self._sum = 0.0
        self.total = 0
        self.overruns = 0

    def add(self, duration: float) -> None:
        """Count a tick that took `duration` s."""
        self.total += 1
        self._sum += duration
        if duration > self._longest:
            self._longest = duration
        if duration > self._period:
            self.overruns += 1

    def report(self) -> dict[str, str]:
        """Return rate, mean and longest tick since the last report, and the total overruns."""
        now = time.monotonic()
        count = self.total - self._counted
        rate = count / max(now - self._since, 1e-9)
        report = {
            'rate (1/s)': f'{rate:.1f}',
            'mean tick (ms)': f'{1e3 * self._sum / max(count, 1):.3f}',
            'longest tick (ms)': f'{1e3 * self._longest:.3f}',
            'overruns': str(self.overruns),
        }
        self._since, self._counted = now, self.total
        self._longest = self._sum = 0.0
        return report
