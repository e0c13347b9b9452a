# SPDX-License-Identifier: Apache-2.0
"""The control grid: ticks, their times and their stamps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from masmc_ros.params.declaration import Parameter

TIMING = (
    Parameter(
        'control_period',
        0.01,
        'Time T between two control ticks',
        unit='s',
        minimum=0.0,
        exclusive_minimum=True,
        maximum=1.0,
    ),
    Parameter('duration', 0.0, 'Length of the run; 0 is endless', unit='s', minimum=0.0),
)

LATE_TICKS = 2
"""Ticks of real time that a plant makes up for at once when the wall clock has run ahead.

The torque at hand acts through all of them, and a law can do with only so much of that: by more
than this the robot's time falls behind instead.
"""


@dataclass(frozen=True)
class Timing:
    """Period of the control grid in s, and the number of the last tick (None: endless)."""

    period: float
    last: int | None

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Timing:
        """Make the grid from checked parameter values."""
        period, duration = values['control_period'], values['duration']
        return cls(period, max(1, round(duration / period)) if duration > 0.0 else None)

    def time(self, tick: int) -> float:
        """Return t_k = k T in s."""
        return tick * self.period

    def stamp(self, tick: int) -> int:
        """Return the stamp of a tick in ns."""
        return round(1e9 * self.time(tick))
