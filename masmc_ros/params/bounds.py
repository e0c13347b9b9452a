# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The range of a number: bounds, inclusive or exclusive, or none."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True)
class Bounds:
    """An interval of the finite numbers; None is no bound on that side."""

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
        """Write '>= 0', '< 5', 'in (0, 1]', or '' for no bounds."""
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
    """Write a bound without a needless '.0'."""
    text = f'{number:g}'
    return text if float(text) == number else repr(number)
