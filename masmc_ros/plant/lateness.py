# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Late ticks of the plant in real time, and their effect in the last second.

After a late tick the robot moves by a command for an earlier state. After more than a few late
ticks at once the robot's time falls behind real time. Both increase the tracking error:
docs/reference/real_time.md has the measured figures.
"""

from __future__ import annotations

from collections.abc import Mapping

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
