# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Vectors that are arrays because they are long: as in plain Python, and as tuples are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.numerics.arrays import (
    array_of,
    read_down,
    read_part,
    read_row,
    to_vector,
    write_part,
    write_row,
)
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, new_record, put
from masmc_ros.numerics.tuples import dot, elementwise, from_index, LONGEST, unit
import numpy as np
import pytest

PAIR = 0.0, 0.0


@formula
def _combined(a: float, b: float) -> float:
    return a * b + 0.1


@formula
def _entry(of: Any, i: int) -> float:
    return of[i] / (i + 1.0)


@formula
def _pair(of: Any, i: int) -> tuple[float, float]:
    return of[i], 2.0 * of[i]


@kernel
def everything(records: Any) -> Any:
    """Return what the functions on vectors make of a field of the second lane."""
    record = records[0]
    a = get(record, 'values', 1)
    b = elementwise(_combined, a, 2.0)
    put(record, 'values', 0, elementwise(_combined, a, b))
    rows = np.zeros((2, 3))
    write_part(rows, 1, 1, (1.5, 2.5))
    lanes = np.zeros((2, 3, 2))
    write_row(lanes, 1, 1, 1, (3.5, 4.5))
    return (
        b,
        from_index(_entry, a, b),
        from_index(_pair, a, b),
        to_vector(array_of(b), a),
        unit(a, 1),
        array_of(b).copy(),
        array_of(PAIR).copy(),
        to_vector(array_of(b), PAIR),
        read_part(rows, 1, 1, PAIR),
        read_down(rows, 0, 2, PAIR),
        read_row(lanes, 1, 1, 1, PAIR),
        dot(a, b),
    )


def _records(count: int) -> Any:
    found = new_record([Field('values', 'n', 'Some numbers')], {'n': count}, 2)
    found['values'][0] = np.sin(np.arange(2.0 * count)).reshape(count, 2)
    return found


@pytest.mark.parametrize('count', [3, LONGEST + 1])
def test_compiled_vectors_are_those_of_plain_python(count: int) -> None:
    plain: Callable[[Any], Any] = getattr(everything, 'py_func', everything)
    records, others = _records(count), _records(count)
    found, expected = everything(records), plain(others)
    for one, other in zip(found, expected, strict=True):
        assert isinstance(one, tuple) == isinstance(other, tuple)
        assert np.array(one).tobytes() == np.array(other).tobytes()
    assert isinstance(found[0], tuple) == (count <= LONGEST)
    assert records.tobytes() == others.tobytes()


def test_long_vectors_have_the_entries_of_short_ones() -> None:
    short, long = (everything(_records(count)) for count in (3, LONGEST + 1))
    for one, other in zip(short[:4], long[:4], strict=True):
        assert np.array(one).tobytes() == np.array(other)[:3].tobytes()
