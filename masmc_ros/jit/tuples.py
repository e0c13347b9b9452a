# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Operations on vectors of any length in formulas: elementwise functions, sums of products, parts.

A vector of constant length is a tuple, which the compiler unrolls. All functions also accept the
vectors of `vectors.py`, whose lengths are known at run time.

Sums start with zero and then add the first entry, so they are bitwise identical everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from masmc_ros.aliases import Columns, Function, Numbers
from masmc_ros.jit import vectors
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.generated import (
    called,
    Compiler,
    generated,
    IrValue,
    IrValues,
    tuple_type,
    Type,
    Types,
    TypingContext,
)
from masmc_ros.jit.vectors import MatrixType, NUMBERS, short_loop, VectorType
from numba import types
from numba.core import cgutils

FLOAT = types.float64

_Argument = TypeVar('_Argument')
_Entry = TypeVar('_Entry')

def _floats(n: int) -> types.Type:
    return types.UniTuple(FLOAT, n)


def _is_tuple(kind: types.Type) -> bool:
    return isinstance(kind, types.BaseTuple)


def _has_sized(kinds: Types) -> bool:
    return any(isinstance(kind, VectorType) for kind in kinds)


def elementwise(function: Function, *arguments: object) -> Any:
    """Return the vector of function(a, b, ...) by entries; a number applies to all entries."""
    vectors = [a for a in arguments if isinstance(a, tuple)]
    lengths = [len(vector) for vector in vectors]
    if len(set(lengths)) != 1:
        raise ValueError(f'elementwise: expected vectors of one length, got {lengths}')
    return tuple(
        function(*(a[i] if isinstance(a, tuple) else a for a in arguments))
        for i in range(len(vectors[0]))
    )


def _types_of_entry(kinds: Types, i: int) -> tuple[types.Type, ...]:
    return tuple(
        kind[i] if _is_tuple(kind) else kind.entry if isinstance(kind, VectorType) else kind
        for kind in kinds
    )


def _type_of_elementwise(context: TypingContext, function: Type, *kinds: Type) -> Type:
    if _has_sized(kinds):
        return VectorType(called(context, function, _types_of_entry(kinds, 0)).return_type)
    count = next(len(kind) for kind in kinds if _is_tuple(kind))
    return tuple_type(
        called(context, function, _types_of_entry(kinds, i)).return_type for i in range(count)
    )


@generated(elementwise, _type_of_elementwise)
def _elementwise(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    function, kinds, values = kinds[0], kinds[1:], values[1:]
    if isinstance(compiler.result, VectorType):
        return _elementwise_of_sized(compiler, function, kinds, values)
    rows = [
        compiler.entries(value, kind) if _is_tuple(kind) else value
        for kind, value in zip(kinds, values, strict=True)
    ]
    return compiler.tuple_of([
        compiler.call(
            function,
            compiler.result[i],
            _types_of_entry(kinds, i),
            [row[i] if isinstance(row, list) else row for row in rows],
        )
        for i in range(len(compiler.result))
    ])


def _elementwise_of_sized(
    compiler: Compiler, function: Type, kinds: Types, values: IrValues
) -> IrValue:
    result = compiler.result.entry
    first = next(
        value for kind, value in zip(kinds, values, strict=True) if isinstance(kind, VectorType)
    )

    def entry_at(i: IrValue) -> IrValue:
        entries = [
            vectors.load_entry(compiler, kind, value, i) if isinstance(kind, VectorType) else value
            for kind, value in zip(kinds, values, strict=True)
        ]
        return compiler.call(function, result, _types_of_entry(kinds, 0), entries)

    return vectors.vector_of_entries(compiler, result, first, entry_at, is_vectorised=True)


def from_index(
    function: Callable[[_Argument, int], _Entry],
    template: Numbers | Columns,
    argument: _Argument,
) -> tuple[_Entry, ...]:
    """Return the vector of function(argument, i) for every index i of `template`."""
    return tuple(function(argument, i) for i in range(len(template)))


def _type_of_table(context: TypingContext, function: Type, template: Type, argument: Type) -> Type:
    row = called(context, function, (argument, types.intp)).return_type
    if vectors.is_sized(template):
        return vectors.ROWS if isinstance(row, VectorType) else VectorType(row)
    return tuple_type([row] * len(template))


@generated(from_index, _type_of_table)
def _from_index(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    function, template, argument = kinds
    if isinstance(compiler.result, MatrixType):
        return _rows_of_sized(compiler, kinds, values)
    if vectors.is_sized(template):
        return _table_of_sized(compiler, kinds, values)
    return compiler.tuple_of([
        compiler.call(
            function,
            compiler.result[i],
            (argument, types.intp),
            (values[2], compiler.context.get_constant(types.intp, i)),
        )
        for i in range(len(compiler.result))
    ])


def _table_of_sized(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    function, _, argument = kinds
    entry = compiler.result.entry

    def entry_at(i: IrValue) -> IrValue:
        return compiler.call(function, entry, (argument, types.intp), (values[2], i))

    return vectors.vector_of_entries(compiler, entry, values[1], entry_at)


def _rows_of_sized(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    """Return the matrix of rows, whose length is that of the first one."""
    function, _, argument = kinds
    template, build = values[1], compiler.builder
    count = vectors.count_of(compiler, template)
    workspace = vectors.workspace_of(compiler, template)
    zero = count.type(0)
    kind = compiler.context.get_value_type(compiler.result)
    matrix = cgutils.alloca_once(build, kind, zfill=True)
    with short_loop(build, count) as i:
        row = compiler.call(function, NUMBERS, (argument, types.intp), (values[2], i))
        columns = vectors.count_of(compiler, row)
        with build.if_then(build.icmp_signed('==', i, zero)):
            build.store(vectors.new_matrix(compiler, count, columns, workspace), matrix)
        target = vectors.row_of(compiler, build.load(matrix), i)
        vectors.copy_entries(
            compiler,
            vectors.data_of(compiler, row),
            vectors.data_of(compiler, target),
            columns,
        )
    return build.load(matrix)


def dot(a: Numbers, b: Numbers) -> float:
    """Return the sum of the products of entries."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def _dot_of_sized(compiler: Compiler, kinds: Types, a: IrValue, b: IrValue) -> IrValue:
    build = compiler.builder
    total = cgutils.alloca_once_value(build, compiler.number(0.0))
    with short_loop(build, vectors.count_of(compiler, a)) as i:
        x, y = (
            vectors.load_entry(compiler, kind, value, i)
            for kind, value in zip(kinds, (a, b), strict=True)
        )
        build.store(build.fadd(build.load(total), build.fmul(x, y)), total)
    return build.load(total)


@generated(dot, lambda context, a, b: FLOAT)
def _dot(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], VectorType):
        return _dot_of_sized(compiler, kinds, *values)
    total = compiler.number(0.0)
    entries = (compiler.entries(v, k) for v, k in zip(values, kinds, strict=True))
    for x, y in zip(*entries, strict=True):
        total = compiler.builder.fadd(total, compiler.builder.fmul(x, y))
    return total


def unit(template: Numbers, i: int) -> Numbers:
    """Return the i-th unit vector, as long as `template`."""
    return tuple(1.0 if j == i else 0.0 for j in range(len(template)))


def _type_of_unit(context: TypingContext, template: Type, i: Type) -> Type:
    return NUMBERS if isinstance(template, VectorType) else _floats(len(template))


@generated(unit, _type_of_unit)
def _unit(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    place = compiler.cast(values[1], kinds[1], types.intp)
    one, zero = compiler.number(1.0), compiler.number(0.0)
    if isinstance(kinds[0], VectorType):


        def entry_at(k: IrValue) -> IrValue:
            is_place = compiler.builder.icmp_signed('==', place, k)
            return compiler.builder.select(is_place, one, zero)

        return vectors.vector_of_entries(compiler, FLOAT, values[0], entry_at)
    here = [compiler.context.get_constant(types.intp, j) for j in range(len(kinds[0]))]
    build = compiler.builder
    return compiler.tuple_of([
        build.select(build.icmp_signed('==', place, j), one, zero) for j in here
    ])


@formula
def matrix_times(columns: Columns, x: Numbers) -> Numbers:
    """Return a matrix times a vector; the matrix is a tuple of its columns."""
    return from_index(_entry_of_product, columns[0], (columns, x))


@formula
def _entry_of_product(factors: tuple[Columns, Numbers], i: int) -> float:
    columns, x = factors
    total = 0.0
    for j in range(len(x)):
        total += columns[j][i] * x[j]
    return total


@formula
def least(vector: Numbers) -> float:
    """Return the smallest entry."""
    smallest = vector[0]
    for i in range(1, len(vector)):
        smallest = vector[i] if vector[i] < smallest else smallest
    return smallest


def head(vector: Numbers, as_many: Numbers) -> Numbers:
    """Return the first entries, as many as those of another tuple."""
    return vector[: len(as_many)]


def _type_of_head(context: TypingContext, vector: Type, as_many: Type) -> Type:
    if isinstance(vector, VectorType):
        return vector
    return tuple_type(vector[i] for i in range(len(as_many)))


@generated(head, _type_of_head)
def _head(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], VectorType):
        count = vectors.count_of(compiler, values[1])
        return vectors.part_of(compiler, values[0], count.type(0), count)
    return compiler.tuple_of(compiler.entries(values[0], kinds[0])[: len(kinds[1])])


def tail(vector: Numbers, as_many: Numbers) -> Numbers:
    """Return the last entries, as many as those of another tuple."""
    return vector[len(vector) - len(as_many):]


@generated(tail, _type_of_head)
def _tail(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], VectorType):
        count = vectors.count_of(compiler, values[1])
        first = compiler.builder.sub(vectors.count_of(compiler, values[0]), count)
        return vectors.part_of(compiler, values[0], first, count)
    return compiler.tuple_of(compiler.entries(values[0], kinds[0])[-len(kinds[1]):])


def thirds(vector: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return the three consecutive parts of a tuple, of equal length."""
    n = len(vector) // 3
    return vector[:n], vector[n:2 * n], vector[2 * n:]


def _type_of_thirds(context: TypingContext, vector: Type) -> Type:
    is_sized = isinstance(vector, VectorType)
    return tuple_type([vector if is_sized else _floats(len(vector) // 3)] * 3)


@generated(thirds, _type_of_thirds)
def _thirds(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], VectorType):
        count = vectors.count_of(compiler, values[0])
        third = compiler.builder.sdiv(count, count.type(3))
        return compiler.tuple_of([
            vectors.part_of(
                compiler, values[0], compiler.builder.mul(third, count.type(k)), third
            )
            for k in range(3)
        ])
    n, entries = len(kinds[0]) // 3, compiler.entries(values[0], kinds[0])
    return compiler.tuple_of([
        compiler.tuple_of(entries[k * n:k * n + n], _floats(n)) for k in range(3)
    ])


def joined(first: Numbers, second: Numbers) -> Numbers:
    """Return the concatenation of two tuples."""
    return first + second


def _type_of_joined(context: TypingContext, first: Type, second: Type) -> Type:
    return NUMBERS if _has_sized((first, second)) else _floats(len(first) + len(second))


@generated(joined, _type_of_joined)
def _joined(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(compiler.result, VectorType):
        return _joined_sized(compiler, kinds, values)
    parts = (compiler.entries(v, k) for v, k in zip(values, kinds, strict=True))
    return compiler.tuple_of([entry for part in parts for entry in part])


def _joined_sized(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    """Return the concatenation of a vector or a tuple and a vector."""
    build, (first, second) = compiler.builder, values
    workspace, count = vectors.workspace_of(compiler, second), vectors.count_of(compiler, second)
    is_first_sized = isinstance(kinds[0], VectorType)
    before = vectors.count_of(compiler, first) if is_first_sized else count.type(len(kinds[0]))
    out = vectors.new_vector(compiler, FLOAT, build.add(before, count), workspace)
    data = vectors.data_of(compiler, out)
    if is_first_sized:
        vectors.copy_entries(compiler, vectors.data_of(compiler, first), data, before)
    else:
        for i, entry in enumerate(compiler.entries(first, kinds[0])):
            build.store(entry, build.gep(data, [count.type(i)]))
    vectors.copy_entries(
        compiler, vectors.data_of(compiler, second), build.gep(data, [before]), count
    )
    return out


def column(rows: tuple[Numbers, ...], i: int) -> Numbers:
    """Return entry i of every row; in compiled code i must be a literal."""
    return tuple(row[i] for row in rows)


def _type_of_column(context: TypingContext, rows: Type, i: Type) -> Type:
    if isinstance(rows, VectorType):
        return VectorType(rows.entry[i.literal_value])
    return tuple_type(row[i.literal_value] for row in rows)


@generated(column, _type_of_column)
def _column(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], VectorType):
        return _column_sized(compiler, kinds[0], values[0], kinds[1].literal_value)
    rows = compiler.entries(values[0], kinds[0])
    return compiler.tuple_of([
        compiler.builder.extract_value(row, kinds[1].literal_value) for row in rows
    ])


def _column_sized(compiler: Compiler, kind: VectorType, rows: IrValue, i: int) -> IrValue:
    def entry_at(k: IrValue) -> IrValue:
        return compiler.builder.extract_value(vectors.load_entry(compiler, kind, rows, k), i)

    return vectors.vector_of_entries(compiler, compiler.result.entry, rows, entry_at)
