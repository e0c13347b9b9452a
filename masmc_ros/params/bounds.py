# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Range of a number with inclusive, exclusive or no bounds."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True)
class Bounds:
    """Interval of the finite numbers; None: no bound on that side."""

    minimum: float | None
    maximum: float | None
    exclusive_minimum: bool
    exclusive_maximum: bool

    def contain(self, value: float) -> bool:
        """Return True if a number is finite and within the bounds."""
        if not math.isfinite(value):
            return False
        if self.minimum is not None and (
            value <= self.minimum if self.exclusive_minimum else value < self.minimum
        ):
            return False
        return self.maximum is None or (
            value < self.maximum if self.exclusive_maximum else value <= self.maximum
        )

    def __str__(self) -> str:
        """Return '>= 0', '< 5', 'in (0, 1]', or '' without bounds."""
        if self.minimum is not None and self.maximum is not None:
            opening = '(' if self.exclusive_minimum else '['
            closing = ')' if self.exclusive_maximum else ']'
            return f'in {opening}{_short(self.minimum)}, {_short(self.maximum)}{closing}'
        if self.minimum is not None:
            return f'{">" if self.exclusive_minimum else ">="} {_short(self.minimum)}'
        if self.maximum is not None:
            return f'{"<" if self.exclusive_maximum else "<="} {_short(self.maximum)}'
        return ''


def _short(number: float) -> str:
    """Return a bound as text, without a trailing '.0'."""
    text = f'{number:g}'
    return text if float(text) == number else repr(number)
