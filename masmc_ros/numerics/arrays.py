# SPDX-License-Identifier: Apache-2.0
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
