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

"""Formulas of one or two numbers, to be applied to tuples entry by entry: `each(plus, a, b)`."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula


@formula
def plus(a: float, b: float) -> float:
    """Return a + b."""
    return a + b


@formula
def minus(a: float, b: float) -> float:
    """Return a - b."""
    return a - b


@formula
def zero(of: float) -> float:
    """Return 0, whatever the number is."""
    return 0.0


@formula
def moved(value: float, rate: float, period: float) -> float:
    """Return a value that changed at a rate for a period: a step of explicit Euler."""
    return value + period * rate
