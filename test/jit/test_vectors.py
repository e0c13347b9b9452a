# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Vectors in compiled code, against plain Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.jit.arrays import (
    array_of,
    read_down,
    read_part,
    to_vector,
    write_part,
)
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import new_record
from masmc_ros.jit.tuples import dot, elementwise, from_index, unit
import numpy as np
import pytest

PAIR = 0.0, 0.0


@formula
def _combined(a: float, b: float) -> float:
    return a * b + 0.1


@formula
def _entry(array: Any, i: int) -> float:
    return array[i] / (i + 1.0)


@formula
def _pair(array: Any, i: int) -> tuple[float, float]:
    return array[i], 2.0 * array[i]


@kernel
def all_functions(records: Any) -> Any:
    """Return results of all vector functions for a field of the second lane."""
    record = records[0]
    a = lane_of(record, 1).values
    b = elementwise(_combined, a, 2.0)
    lane_of(record, 0).values = elementwise(_combined, a, b)
    rows = np.zeros((2, 3))
    write_part(rows, 1, 1, (1.5, 2.5))
    lanes = np.zeros((2, 3, 2))
    write_part(lane_of(lanes, 1), 1, 1, (3.5, 4.5))
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
        read_part(lane_of(lanes, 1), 1, 1, PAIR),
        dot(a, b),
    )


def _records(count: int) -> Any:
    record = new_record([Field('values', 'n', 'Some numbers')], {'n': count}, 2)
    record['values'][0] = np.sin(np.arange(2.0 * count)).reshape(count, 2)
    return record


@pytest.mark.parametrize('count', [3, 60])
def test_vectors_compiled_equal_plain_python(count: int) -> None:
    plain: Callable[[Any], Any] = getattr(all_functions, 'py_func', all_functions)
    records, others = _records(count), _records(count)
    compiled, expected = all_functions(records), plain(others)
    for one, other in zip(compiled, expected, strict=True):
        assert isinstance(one, tuple) == isinstance(other, tuple)
        assert np.array(one).tobytes() == np.array(other).tobytes()
    assert isinstance(compiled[0], tuple)
    assert records.tobytes() == others.tobytes()
