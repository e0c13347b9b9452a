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

"""Between tuples, on which formulas work, and arrays, for what needs loops."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.tuples import Numbers, tabulate


@formula
def _entry(array: Any, i: int) -> float:
    return array[i]


@formula
def taken(array: Any, as_many: Numbers) -> Numbers:
    """Return the first entries of an array, as many as a tuple has."""
    return tabulate(_entry, as_many, array)


@formula
def _in_row(of: tuple[Any, int, int, int], i: int) -> float:
    array, row, first, lane = of
    return array[row, first + i, lane]


@formula
def read_row(array: Any, row: int, first: int, lane: int, as_many: Numbers) -> Numbers:
    """Return the entries (row, first ..., lane) of an array, as many as a tuple has."""
    return tabulate(_in_row, as_many, (array, row, first, lane))


@formula
def write_row(array: Any, row: int, first: int, lane: int, values: Numbers) -> None:
    """Write a tuple into the entries (row, first ..., lane) of an array."""
    for i in range(len(values)):
        array[row, first + i, lane] = values[i]
