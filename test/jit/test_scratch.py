# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Scratch arrays of a function, and vectors as arrays."""

from __future__ import annotations

import resource
import sys
from typing import Any
import weakref

from masmc_ros.errors import InputError
from masmc_ros.jit.arrays import array_of, read_along, to_vector, write_along
from masmc_ros.jit.compiled import formula, inlined, is_interpreted, kernel, subroutine
from masmc_ros.jit.scratch import clear, copy_into, MOST, scratch
import numpy as np
import pytest


@kernel
def _filled(array: Any, first: float) -> float:
    total = 0.0
    for i in range(len(array)):
        array[i] = first + i
    for value in array:
        total += value
    return total


@kernel
def _vector(size: int) -> float:
    return _filled(scratch(size), 1.0)


@kernel
def _matrix(rows: int, columns: int) -> Any:
    work, other = scratch(rows, columns), scratch(rows, columns)
    for i in range(rows):
        for j in range(columns):
            other[i, j] = 10.0 * i + j
    copy_into(work, other)
    clear(other)
    result = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            result[i, j] = work[i, j] + other[i, j]
    return result


@kernel
def _two_at_once(size: int) -> float:
    """Return the deviation that occurs if two scratch arrays in a loop share memory."""
    deviation = 0.0
    for i in range(3):
        one, other = scratch(size), scratch(size)
        _filled(one, i)
        _filled(other, 100.0)
        for j in range(size):
            deviation += abs(one[j] - (i + j)) + abs(other[j] - (100.0 + j))
    return deviation


@pytest.mark.parametrize('size', [1, MOST[1] - 1, MOST[1], MOST[1] + 1, 10 * MOST[1]])
def test_scratch_vector_any_size_is_usable(size: int) -> None:
    assert _vector(size) == size * (size + 1) / 2
    assert _two_at_once(size) == 0.0


@pytest.mark.parametrize(('rows', 'columns'), [(1, 1), (3, 5), (28, 30), (29, 29), (100, 40)])
def test_scratch_matrix_any_shape_is_usable(rows: int, columns: int) -> None:
    expected = 10.0 * np.arange(rows)[:, None] + np.arange(columns)
    assert np.array_equal(_matrix(rows, columns), expected)


def test_scratch_repeated_calls_do_not_leak_memory() -> None:
    size = 10 * MOST[1]
    _vector(size)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Without release, these calls would need 640 MB.
    for _ in range(8000):
        _vector(size // 5 + 1)
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert kilobytes < 100_000


@formula
def _with_zeros(value: float) -> float:
    array = np.zeros(3)
    array[0] = value
    return float(array[0]) + 1.0


@formula
def _with_list(value: float) -> float:
    return max([number + 1.0 for number in (value, value)])


@kernel
def _of_zeros(value: float) -> float:
    return _with_zeros(value)


@kernel
def _of_list(value: float) -> float:
    return _with_list(value)


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
@pytest.mark.parametrize('called', [_of_zeros, _of_list])
def test_formula_with_memory_from_heap_is_rejected(called: Any) -> None:
    line = r'test_scratch\.py:\d+: cannot be compiled: _with_\w+ takes memory from the heap; '
    with pytest.raises(InputError, match=line):
        called(1.0)


@formula
def _row(matrix: Any, i: int) -> Any:
    return matrix[i]


@subroutine
def _difference(matrix: Any) -> float:
    first, second = _row(matrix, 0), _row(matrix, 1)
    return float(second[0] - first[0])


@kernel
def _last_row(matrix: Any) -> Any:
    _row(matrix, 0)[0] -= _difference(matrix)
    return matrix[1]


def test_references_to_array_of_python_are_kept() -> None:
    matrix = np.zeros((2, 3))
    before = sys.getrefcount(matrix)
    for _ in range(10):
        _last_row(matrix)
    assert sys.getrefcount(matrix) == before
    rows = [_last_row(matrix) for _ in range(10)]
    owner = weakref.ref(matrix)
    del matrix
    assert owner() is not None
    rows.clear()
    assert owner() is None


@kernel
def _of_tuple(values: Any) -> Any:
    array = array_of(values)
    write_along(array, 1, read_along(array, 0, (0.0, 0.0)))
    return to_vector(array, values), values


def test_array_of_tuple_is_a_copy() -> None:
    moved, before = _of_tuple((1.0, 2.0, 3.0))
    assert (moved, before) == ((1.0, 1.0, 2.0), (1.0, 2.0, 3.0))


@formula
def _squared(value: float) -> float:
    return value * value


@inlined
def _added(array: Any, value: float) -> None:
    total = _squared(value)
    array[0] += total


@kernel
def _sum(array: Any, count: int) -> float:
    total = 5.0
    for i in range(count):
        _added(array, i)
    return total


def test_inlined_function_local_names_do_not_collide() -> None:
    array = np.zeros(1)
    assert _sum(array, 4) == 5.0
    assert array[0] == 14.0
