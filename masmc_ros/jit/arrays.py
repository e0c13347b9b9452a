# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Conversion between tuples, for formulas, and arrays, for loops.

Indices must not be negative and must be within the array; compiled code does not check them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast, TypeVar

from masmc_ros.aliases import Array, Columns, Function, Numbers
from masmc_ros.jit import vectors
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.generated import (
    Compiler,
    generated,
    IrValue,
    IrValues,
    Type,
    Types,
    TypingContext,
)
from masmc_ros.jit.scratch import array_over, CACHE_LINE, VECTOR
from masmc_ros.jit.tuples import FLOAT
from masmc_ros.jit.vectors import short_loop, VectorType
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
import numpy as np

_Vector = TypeVar('_Vector', bound=Numbers)
"""Vector with a known number of entries."""


def to_vector(array: Array, as_many: Numbers) -> Numbers:
    """Return the first entries of an array as a vector of the same kind and length as another."""
    return tuple(array[:len(as_many)])


def read_part(array: Array, row: int, first: int, as_many: _Vector) -> _Vector:
    """Return the entries (row, first ...) of an array, as many as a tuple has."""
    return cast(_Vector, tuple(array[row, first + i] for i in range(len(as_many))))


def write_part(array: Array, row: int, first: int, values: Numbers) -> None:
    """Write a tuple into the entries (row, first ...) of an array."""
    for i in range(len(values)):
        array[row, first + i] = values[i]


def read_down(array: Array, first: int, column: int, as_many: _Vector) -> _Vector:
    """Return the entries (first ..., column) of an array, as many as a tuple has."""
    return cast(_Vector, tuple(array[first + i, column] for i in range(len(as_many))))


def read_along(array: Array, first: int, as_many: _Vector) -> _Vector:
    """Return the entries (first ...) of an array, as many as a tuple has."""
    return cast(_Vector, tuple(array[first + i] for i in range(len(as_many))))


def write_along(array: Array, first: int, values: Numbers) -> None:
    """Write a tuple into the entries (first ...) of an array."""
    for i in range(len(values)):
        array[first + i] = values[i]


def write_down(array: Array, first: int, column: int, values: Numbers) -> None:
    """Write a tuple into the entries (first ..., column) of an array."""
    for i in range(len(values)):
        array[first + i, column] = values[i]


def array_of(values: Numbers) -> Array:
    """
    Return a vector as an array, which is valid until the calling function ends.

    A vector that is an array is returned unmodified. The function must not change the array, which
    may share the memory of the vector.
    """
    return np.array(values) if isinstance(values, tuple) else values


def changeable(values: Numbers) -> Array:
    """Return a copy of a vector as an array, which is valid until the calling function ends."""
    return np.array(values)


@formula
def write_columns(columns: Columns, out: Array) -> None:
    """Write a matrix by its columns into the rows of an array."""
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            out[j, i] = columns[j][i]


def _tuple_of(context: TypingContext, array: Type, *others: Type) -> types.Type:
    if isinstance(others[-1], VectorType):
        return VectorType(array.dtype)
    return types.UniTuple(array.dtype, len(others[-1]))


def _place_at(
    compiler: Compiler, kinds: Types, values: IrValues, which: int
) -> Callable[[IrValue], IrValue]:
    """Return a function of a pointer to an entry of an array: i is added to index `which`."""
    array = compiler.context.make_array(kinds[0])(compiler.context, compiler.builder, values[0])
    start = [
        compiler.cast(value, kind, types.intp)
        for value, kind in zip(values[1:], kinds[1:], strict=True)
    ]

    def place_at(i: IrValue) -> IrValue:
        at = list(start)
        at[which] = compiler.builder.add(at[which], i)
        return cgutils.get_item_pointer(compiler.context, compiler.builder, kinds[0], array, at)

    return place_at


def _places(
    compiler: Compiler, kinds: Types, values: IrValues, which: int, count: int
) -> list[IrValue]:
    """Return pointers to consecutive entries of an array; index number `which` increases."""
    place_at = _place_at(compiler, kinds, values, which)
    return [place_at(compiler.context.get_constant(types.intp, i)) for i in range(count)]


def _loaded(
    compiler: Compiler, template: IrValue, place_at: Callable[[IrValue], IrValue]
) -> IrValue:
    """Return a vector as long as another one, from pointers to its entries."""
    return vectors.vector_of_entries(
        compiler, compiler.result.entry, template, lambda i: compiler.builder.load(place_at(i))
    )


def _read(which: int, indices: int) -> Function:
    """Return the code generator that reads a tuple; index number `which` increases."""

    def write(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
        if isinstance(compiler.result, VectorType):
            place_at = _place_at(compiler, kinds[:1 + indices], values[:1 + indices], which)
            return _loaded(compiler, values[-1], place_at)
        places = _places(
            compiler, kinds[:1 + indices], values[:1 + indices], which, len(compiler.result)
        )
        return compiler.tuple_of([compiler.builder.load(place) for place in places])

    return write


def _written(which: int, indices: int) -> Function:
    """Return the code generator that writes a tuple; index number `which` increases."""

    def write(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
        value_type = kinds[1 + indices]
        if isinstance(value_type, VectorType):
            vector = values[1 + indices]
            place_at = _place_at(compiler, kinds[:1 + indices], values[:1 + indices], which)
            with short_loop(compiler.builder, vectors.count_of(compiler, vector)) as i:
                entry = vectors.load_entry(compiler, value_type, vector, i)
                compiler.builder.store(entry, place_at(i))
            return compiler.context.get_dummy_value()
        count = len(value_type)
        places = _places(compiler, kinds[:1 + indices], values[:1 + indices], which, count)
        entries = compiler.entries(values[1 + indices], value_type)
        for place, entry, kind in zip(places, entries, value_type, strict=True):
            compiler.builder.store(compiler.cast(entry, kind, kinds[0].dtype), place)
        return compiler.context.get_dummy_value()

    return write


generated(read_part, _tuple_of)(_read(1, 2))
generated(read_down, _tuple_of)(_read(0, 2))
generated(read_along, _tuple_of)(_read(0, 1))
generated(write_part, lambda context, *kinds: types.none)(_written(1, 2))
generated(write_down, lambda context, *kinds: types.none)(_written(0, 2))
generated(write_along, lambda context, *kinds: types.none)(_written(0, 1))


def _type_of_vector(context: TypingContext, array: Type, as_many: Type) -> Type:
    if isinstance(as_many, VectorType):
        return VectorType(array.dtype)
    return types.UniTuple(array.dtype, len(as_many))


@generated(to_vector, _type_of_vector)
def _to_vector(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    first = compiler.context.get_constant(types.intp, 0)
    if isinstance(compiler.result, VectorType):
        place_at = _place_at(compiler, (kinds[0], types.intp), (values[0], first), 0)
        if kinds[0].layout != 'C':
            return _loaded(compiler, values[1], place_at)
        out = vectors.new_vector_like(compiler, compiler.result.entry, values[1])
        count, data = vectors.count_of(compiler, out), vectors.data_of(compiler, out)
        vectors.copy_entries(compiler, place_at(first), data, count)
        return out
    places = _places(
        compiler, (kinds[0], types.intp), (values[0], first), 0, len(compiler.result)
    )
    return compiler.tuple_of([compiler.builder.load(place) for place in places])


@generated(array_of, lambda context, values: VECTOR)
def _array_of(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], types.Array):
        return impl_ret_borrowed(compiler.context, compiler.builder, kinds[0], values[0])
    if isinstance(kinds[0], VectorType):
        data = vectors.data_of(compiler, values[0])
        return array_over(compiler, VECTOR, data, [vectors.count_of(compiler, values[0])])
    return _on_stack(compiler, kinds[0], values[0])


def _on_stack(compiler: Compiler, kind: Type, value: IrValue) -> IrValue:
    """Return a tuple as an array on the stack."""
    entries = compiler.entries(value, kind)
    count = compiler.context.get_constant(types.intp, len(entries))
    number = compiler.context.get_data_type(FLOAT)
    room = cgutils.alloca_once(compiler.builder, number, count)
    room.align = CACHE_LINE
    for i, value in enumerate(entries):
        place = compiler.builder.gep(room, [compiler.context.get_constant(types.intp, i)])
        compiler.builder.store(value, place)
    return array_over(compiler, VECTOR, room, [count])


@generated(changeable, lambda context, values: VECTOR)
def _changeable(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if not isinstance(kinds[0], VectorType):
        return _on_stack(compiler, kinds[0], values[0])
    count = vectors.count_of(compiler, values[0])
    copy = vectors.data_of(compiler, vectors.new_vector_like(compiler, FLOAT, values[0]))
    vectors.copy_entries(compiler, vectors.data_of(compiler, values[0]), copy, count)
    return array_over(compiler, VECTOR, copy, [count])
