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

"""Rates and torques of the wheels from those of the base, and back."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.robot.tree.model import (
    base_of,
    base_rates_begin,
    FIXED,
    TreeModel,
    wheel_rates_begin,
)


@formula
def into_base(model: TreeModel, values: Any, transposed: bool) -> None:
    """Map the base's part of a vector from the wheels' rates, or from torques by the inverse's."""
    _map(model, values, transposed, not transposed)


@formula
def into_wheels(model: TreeModel, values: Any, transposed: bool) -> None:
    """Map the base's part of a vector to the wheels' rates, or to torques by the inverse's."""
    _map(model, values, transposed, transposed)


@kernel
def _map(model: TreeModel, values: Any, transposed: bool, by_base_rates: bool) -> None:
    base = base_of(model)
    if base == FIXED:
        return
    first = base_rates_begin(model) if by_base_rates else wheel_rates_begin(model)
    before = values[0], values[1], values[base - 1]
    along, across = (1, base) if transposed else (base, 1)
    for i in range(base):
        at = first + i * along
        total = model.numbers[at, model.lane] * before[0]
        total += model.numbers[at + across, model.lane] * before[1]
        if base > 2:
            total += model.numbers[at + 2 * across, model.lane] * before[2]
        values[i] = total
