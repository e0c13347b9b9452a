# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Records of declared fields by [component, lane], for compiled code and Python.

A module declares the fields of its gains, settings, memory or signals once. The size of a field is
a name (`axes`, `joints`, ...), and the mechanism determines the number. A record stores a field of
one component as (lanes), others as (components, lanes). Nodes have one lane, parallel runs have
many; compiled code loops over the lanes innermost. `lanes.py` has the attributes of one lane.

The type of a record contains its law and its mechanism as tags, the names of empty fields. The
compiler selects formulas by them and compiles separate code for each. With the size
`AT_RUN_TIME`, compiled code reads the sizes of fields from the record (`sized_records.py`), and
one code serves records of all sizes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from masmc_ros.aliases import Flags, Record, Records
from masmc_ros.jit.field import Field
from masmc_ros.jit.generated import (
    Builder,
    Compiler,
    generated,
    IrValue,
    IrValues,
    Type,
    Types,
)
from masmc_ros.jit.sized_records import (
    CONSTANT,
    copy_numbers,
    copy_of_record,
    has_layout,
    LAYOUT,
    numbers_of_record,
    SizedRecordType,
    TAG,
    with_layout,
    write_layout,
)
from numba import types
from numba.core import cgutils
import numpy as np
from numpy.typing import ArrayLike

AT_RUN_TIME = 'at_run_time'
"""Name among sizes that selects sizes read at run time; its value has no meaning."""

_CACHE_LINE = 64

ir = cgutils.ir  # llvmlite's, with which Numba itself builds instructions


def record_type(
    fields: Iterable[Field],
    sizes: Mapping[str, int],
    lanes: int = 1,
    tags: Mapping[str, str] | None = None,
    *,
    is_constant: bool = False,
) -> np.dtype[np.void]:
    """
    Return the type of a record of fields, without duplicates.

    Parameters
    ----------
    fields
        Declared fields. If several have the same name, the first one applies.
    sizes
        Number of components by name of a size, with `AT_RUN_TIME` for compiled code of all sizes.
    lanes
        Number of parallel runs.
    tags
        Values by name by which the compiler selects formulas.
    is_constant
        True if kernels do not write the record; compiled code of all sizes then copies less.

    """
    known: dict[str, Field] = {}
    for field in fields:
        known.setdefault(field.name, field)

    members: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = [
        (field.name, field.kind, (field.count(sizes), lanes) if field.size else (lanes,))
        for field in known.values()
    ]
    # Each tag is one byte at the end, so it does not move any number.
    members += [(f'{name}{TAG}{value}', 'i1') for name, value in (tags or {}).items()]
    if AT_RUN_TIME not in sizes:
        return np.dtype(members, align=True)
    if is_constant:
        members.append((CONSTANT, 'i1'))
    return with_layout(np.dtype(members, align=True))


def new_record(
    fields: Sequence[Field],
    sizes: Mapping[str, int],
    lanes: int = 1,
    tags: Mapping[str, str] | None = None,
    *,
    is_constant: bool = False,
) -> Records:
    """Return an array of one record with the initial values of its fields; see `record_type`."""
    dtype = record_type(fields, sizes, lanes, tags, is_constant=is_constant)
    record = np.zeros(1, dtype)
    if AT_RUN_TIME in sizes:
        write_layout(record)
    for field in fields:
        record[field.name] = field.initial
    return record


def uninitialised(count: int, template: Records) -> Records:
    """Return an array of records like those of another one, for compiled code that writes them."""
    records = np.empty(count, template.dtype)
    if has_layout(template.dtype):
        records[LAYOUT] = template[LAYOUT][0]
    return records


def fill(record: Records, name: str, value: ArrayLike, lane: int | None = None) -> None:
    """Write a number or a vector into a field of an array of one record: one lane, or all."""
    numbers = np.asarray(value)
    lanes = slice(None) if lane is None else slice(lane, lane + 1)
    record[name][0][..., lanes] = numbers[..., None]


def take_over(record: Records, before: Records) -> None:
    """Copy the common fields of two records from the one before."""
    for name in record.dtype.names or ():
        if TAG not in name and name in (before.dtype.names or ()):
            record[name] = before[name]


def tag_of(record: Type | np.dtype[np.void], name: str) -> str:
    """Return the tag of this name; KeyError for a record without it."""
    names = record.fields if isinstance(record, types.Record) else record.names or ()
    for field in names:
        if field.startswith(name + TAG):
            return str(field[len(name) + 1:])
    raise KeyError(name)


def lanes_of(record: Records | Record) -> int:
    """Return the number of lanes of an array of records."""
    assert record.dtype.names is not None
    return int(record.dtype[record.dtype.names[0]].shape[-1])


def places_of(records: Mapping[str, Records]) -> tuple[dict[str, int], int]:
    """Return the first word of each record of a run, and the number of all words."""
    places, place = {}, 0
    for name, record in records.items():
        places[name] = place
        for member in record.dtype.names or ():
            # All numbers have 8 bytes, and the tags after them one.
            place += record.dtype[member].itemsize // 8
    return places, place


def lane_count(record: Record) -> int:
    """Return the number of lanes of a record, in compiled code a constant."""
    return lanes_of(record)


def _lanes(record: Type) -> int:
    if isinstance(record, SizedRecordType):
        return record.schema.lanes
    return int(next(iter(record.fields.values())).type.shape[-1])


def _allow_wide_vectors(compiler: Compiler, record: Type) -> None:
    """Let a function that loops over lanes use the full width of AVX-512, instead of half."""
    if _lanes(record) > 1:
        # llvmlite's own `add` knows no attributes that have a value.
        set.add(compiler.builder.function.attributes, '"prefer-vector-width"="512"')


@generated(lane_count, lambda context, record: types.intp)
def _lane_count(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    lanes = _lanes(kinds[0])
    number = compiler.context.get_constant(types.intp, lanes)
    if lanes == 1:
        return number
    _allow_wide_vectors(compiler, kinds[0])
    # With a known number the compiler would unroll the lanes and fail to vectorise them. It only
    # gets the power of two that divides the number, and needs no second loop for a remainder.
    build = compiler.builder
    power = (lanes & -lanes).bit_length() - 1
    odd = compiler.context.get_constant(types.intp, lanes >> power)
    hidden = build.asm(ir.FunctionType(odd.type, [odd.type]), '', '=r,0', [odd], False)
    return build.shl(build.or_(hidden, odd.type(1)), odd.type(power), flags=('nuw', 'nsw'))


def copied(record: Record) -> Record:
    """
    Return a copy of a record, which in compiled code is valid while the kernel runs.

    The copy is on the stack, so the compiler knows that nothing else refers to it.
    """
    return record.copy()


@generated(copied, lambda context, record: record)
def _copied(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    _allow_wide_vectors(compiler, kinds[0])
    if isinstance(kinds[0], SizedRecordType):
        return copy_of_record(compiler, values[0], _CACHE_LINE)
    size = kinds[0].size
    # Numba's `alloca_once` also writes zeros. LLVM splits that into a store for each byte, and
    # then compiles for a time that grows with the square of the size: minutes for many lanes.
    with compiler.builder.goto_entry_block():
        room = compiler.builder.alloca(ir.ArrayType(ir.IntType(8), size))
    room.align = _CACHE_LINE
    _copy_bytes(compiler.builder, room, values[0], size)
    return compiler.builder.bitcast(room, values[0].type)


def copy_to(source: Record, target: Record) -> None:
    """Copy a record into another one of the same type."""
    for name in source.dtype.names or ():
        target[name] = source[name]


@generated(copy_to, lambda context, source, target: types.none)
def _copy_to(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    if isinstance(kinds[0], SizedRecordType):
        copy_numbers(compiler, values[0], values[1])
    else:
        _copy_bytes(compiler.builder, values[1], values[0], kinds[0].size)
    return compiler.context.get_dummy_value()


def copy_nan(source: Record, target: Record) -> None:
    """Copy the entries that are NaN from a record without tags to one of the same type."""
    for name in source.dtype.names or ():
        if source.dtype[name].base.kind == 'f':
            target[name][np.isnan(source[name])] = np.nan


@generated(copy_nan, lambda context, source, target: types.none)
def _copy_nan(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    build, double = compiler.builder, ir.DoubleType()
    if isinstance(kinds[0], SizedRecordType):
        pointers, counts = zip(*(numbers_of_record(compiler, v) for v in values), strict=True)
        count = counts[0]
    else:
        pointers = tuple(values)
        count = compiler.context.get_constant(types.intp, kinds[0].size // 8)
    words = [build.bitcast(pointer, double.as_pointer()) for pointer in pointers]
    with cgutils.for_range(build, count) as loop:
        # Whole numbers are small, so none of them has the bits of NaN.
        word = build.load(build.gep(words[0], [loop.index]))
        with build.if_then(build.fcmp_unordered('uno', word, word)):
            build.store(word, build.gep(words[1], [loop.index]))
    return compiler.context.get_dummy_value()


def copy_lane(
    source: Record | Records, target: Record | Records, lane: int | Flags
) -> None:
    """
    Copy one lane of a record without tags into another one of the same type.

    In Python, flags (lanes) select several lanes, also of an array of records.
    """
    for name in source.dtype.names or ():
        if name != LAYOUT:
            target[name][..., lane] = source[name][..., lane]


@generated(copy_lane, lambda context, source, target, lane: types.none)
def _copy_lane(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    # Every number takes 8 bytes, and the lanes of a component are neighbours.
    build, lanes, word = compiler.builder, _lanes(kinds[0]), ir.IntType(64)
    lane = compiler.cast(values[2], kinds[2], types.intp)
    if isinstance(kinds[0], SizedRecordType):
        pointers, counts = zip(*(numbers_of_record(compiler, v) for v in values[:2]), strict=True)
        count = build.sdiv(counts[0], lane.type(lanes))
    else:
        pointers = tuple(values[:2])
        count = compiler.context.get_constant(types.intp, kinds[0].size // (8 * lanes))
    words = [build.bitcast(pointer, word.as_pointer()) for pointer in pointers]
    with cgutils.for_range(build, count) as loop:
        place = build.add(build.mul(loop.index, lane.type(lanes)), lane)
        build.store(build.load(build.gep(words[0], [place])), build.gep(words[1], [place]))
    return compiler.context.get_dummy_value()


def _copy_bytes(builder: Builder, target: IrValue, source: IrValue, size: int) -> None:
    byte = ir.IntType(8).as_pointer()
    cgutils.raw_memcpy(
        builder, builder.bitcast(target, byte), builder.bitcast(source, byte),
        ir.IntType(64)(size), 1,
    )
