# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Control grid: ticks, their times and their stamps."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values

CONTROL_PERIOD = Parameter(
    'control_period',
    0.01,
    'Time T between two control ticks',
    unit='s',
    minimum=0.0,
    exclusive_minimum=True,
    maximum=1.0,
)

DURATION = Parameter(
    'duration', 0.0, 'Duration of the run; 0: until interrupted', unit='s', minimum=0.0
)

TIMING = (CONTROL_PERIOD, DURATION)

PACING = Parameter(
    'pacing',
    'realtime',
    'lockstep: the plant advances when the command to the last state arrives; realtime: it '
    'advances with time. A controller of real hardware needs realtime',
    choices=('lockstep', 'realtime'),
)

LATE_TICKS = 2
"""Largest number of late ticks that a plant computes at once in real-time mode.

The last torque acts through all of these ticks, and a law tolerates only a few of them. After a
longer delay the robot time falls behind the real time.
"""

MOST_TICKS = 100_000
"""Largest plausible numbers of ticks per second and of integration steps per tick."""

_LONGEST = 2**31
"""Time in s before which the stamps of ROS 2 end."""


def check_count(count: Decimal, most: int, name: str, value: float, what: str) -> None:
    """Raise InputError if a parameter's value gives an implausibly large number."""
    if count > most:
        raise InputError(f'{name} = {value!r}: {_text(count)} {what}; expected at most {most}')


def _text(count: Decimal) -> str:
    return f'{float(count):.6g}' if count < Decimal('1e300') else f'{count:.1e}'


@dataclass(frozen=True)
class Timing:
    """Period of the control grid in s, and the number of the last tick (None: endless)."""

    period: float
    last: int | None

    @classmethod
    def from_values(cls, values: Values) -> Timing:
        """Return the grid of checked parameter values; raise InputError for too many ticks."""
        period, duration = CONTROL_PERIOD.of(values), DURATION.of(values)
        rate = 1 / Decimal(period)
        check_count(rate, MOST_TICKS, 'control_period', period, 'ticks in a second')
        if duration >= _LONGEST:
            raise InputError(
                f'duration = {duration!r}: {_text(Decimal(duration) * rate)} ticks; expected less'
                f' than {_LONGEST} s, where stamps end, or 0 for an endless run'
            )
        return cls(period, max(1, round(duration / period)) if duration > 0.0 else None)

    def time(self, tick: int) -> float:
        """Return t_k = k T in s."""
        return tick * self.period

    def stamp(self, tick: int) -> int:
        """Return the stamp of a tick in ns."""
        return round(1e9 * self.time(tick))
