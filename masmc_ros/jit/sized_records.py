# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of records in compiled code that read the sizes and places of fields at run time.

The type of such a record has the names of its fields and tags and the number of lanes, but no
sizes: one compiled code serves robots of all sizes. Its first field, `LAYOUT`, has the size of the
record, a checksum of its type, and place and number of components of each field. Vectors of such
records are those of `vectors.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
import operator
from typing import Any
import zlib

from masmc_ros.aliases import Function, Records
from masmc_ros.jit.generated import Builder, Compiler, IrValue, IrValues, Type, TypingContext
from masmc_ros.jit.vectors import is_sized, workspace_of_function
from numba import typeof, types
from numba.core import cgutils
from numba.core.datamodel.manager import DataModelManager
from numba.core.typing import Signature
from numba.extending import (
    lower_builtin,
    models,
    NativeValue,
    register_model,
    type_callable,
    unbox,
)
import numpy as np

ir = cgutils.ir

TAG = ':'
"""Character in the names of tags and of the layout, which no other field has."""

LAYOUT = f'{TAG}layout'
"""Name of the field with sizes and places."""

CONSTANT = f'{TAG}constant'
"""Tag of records that kernels do not write; a vector of one lane then shares their memory."""

SHARED = 'shared'
"""Name of the tag with the number of the first fields that are shared, see `lanes.shared`."""

_SIZE, _CHECKSUM, _FIRST = range(3)
"""Entries of a layout: size in bytes, checksum, and the first pair of place and number."""

_BYTE = ir.IntType(8)
_HALF = ir.IntType(32)
_WORD = ir.IntType(64)


@dataclass(frozen=True)
class Schema:
    """Names and kinds of the fields of a record, without sizes."""

    fields: tuple[tuple[str, str, bool], ...]
    """Name, NumPy type code and True for a vector, for each field with numbers."""
    tags: tuple[str, ...]
    """Names of the tags, with their values."""
    lanes: int

    @cached_property
    def checksum(self) -> int:
        """Return a number that differs between schemas."""
        return zlib.crc32(repr((self.fields, self.tags, self.lanes)).encode()) & 0x7FFFFFFF

    @property
    def is_constant(self) -> bool:
        """Return True if kernels do not write the record."""
        return CONSTANT in self.tags

    @cached_property
    def shared(self) -> Schema:
        """Return the schema of the fields that `SHARED` counts, and of the tags before it."""
        names = [tag.split(TAG)[0] for tag in self.tags]
        if SHARED not in names:
            return self
        place = names.index(SHARED)
        count = int(self.tags[place].split(TAG)[1])
        constant = (CONSTANT,) if self.is_constant else ()
        return Schema(self.fields[:count], (*self.tags[:place], *constant), self.lanes)

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Return the index of each field by its name."""
        return {name: k for k, (name, _, _) in enumerate(self.fields)}


def with_layout(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    """Return the type of a record with a layout before its other fields."""
    assert dtype.names is not None
    count = len([name for name in dtype.names if TAG not in name])
    members = [(LAYOUT, 'i4', (_FIRST + 2 * count,))]
    whole = np.dtype([*members, *((name, dtype[name]) for name in dtype.names)], align=True)
    # The last name, because the first one gives the number of lanes.
    names = [*dtype.names, LAYOUT]
    assert whole.fields is not None
    return np.dtype({
        'names': names,
        'formats': [whole[name] for name in names],
        'offsets': [whole.fields[name][1] for name in names],
        'itemsize': whole.itemsize,
        'aligned': True,
    })


def has_layout(dtype: np.dtype[Any]) -> bool:
    """Return True for records whose sizes compiled code reads at run time."""
    return dtype.names is not None and dtype.names[-1] == LAYOUT


def schema_of(dtype: np.dtype[np.void]) -> Schema:
    """Return the schema of a record with a layout."""
    names = [name for name in dtype.names or () if TAG not in name]
    return Schema(
        tuple((name, dtype[name].base.str[1:], dtype[name].ndim == 2) for name in names),
        tuple(name for name in dtype.names or () if TAG in name and name != LAYOUT),
        int(dtype[names[0]].shape[-1]),
    )


def write_layout(records: Records) -> None:
    """Write the layout into all records of an array."""
    dtype = records.dtype
    schema = schema_of(dtype)
    _TYPES.setdefault(schema.checksum, SizedRecordsType(schema))
    assert dtype.fields is not None
    layout = [dtype.itemsize, schema.checksum]
    for name, _, is_vector in schema.fields:
        layout += [dtype.fields[name][1], dtype[name].shape[0] if is_vector else 1]
    records[LAYOUT] = layout


class _TypeOfSchema(types.Type):
    kind: str

    def __init__(self, schema: Schema) -> None:
        """Initialise the type for a schema."""
        self.schema = schema
        super().__init__(f'{self.kind}({schema})')

    @property
    def key(self) -> Schema:
        """Return the schema: Numba treats types with equal keys as one type."""
        return self.schema

    @property
    def mangling_args(self) -> tuple[str, tuple[int]]:
        """Return the short name of the type in symbols."""
        return self.kind, (self.schema.checksum,)


class SizedRecordType(_TypeOfSchema):
    """Type of a record with a layout."""

    kind = 'SizedRecord'

    @property
    def dtype(self) -> SizedRecordType:
        """Return the type, as records of constant sizes do."""
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all fields and tags."""
        return (*self.schema.places, *self.schema.tags)

    def workspace(self, compiler: Compiler, value: IrValue) -> IrValue:
        """Return the workspace for vectors of a record."""
        return compiler.builder.extract_value(value, 2)


class SizedRecordsType(_TypeOfSchema):
    """Type of an array of records with a layout."""

    kind = 'SizedRecords'

    @property
    def dtype(self) -> SizedRecordType:
        """Return the type of a record, as arrays of records of constant sizes do."""
        return SizedRecordType(self.schema)


_TYPES: dict[int, SizedRecordsType] = {}
"""Types of arrays by the checksum in their layout."""


@register_model(SizedRecordType)
class _RecordModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: SizedRecordType) -> None:
        members = [
            ('data', types.voidptr), ('layout', types.voidptr), ('workspace', types.voidptr)
        ]
        super().__init__(manager, kind, members)


@register_model(SizedRecordsType)
class _RecordsModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: SizedRecordsType) -> None:
        members = [('data', types.voidptr), ('count', types.intp), ('step', types.intp)]
        super().__init__(manager, kind, members)


def type_of(argument: object) -> types.Type:
    """Return the type of an argument of a kernel."""
    if isinstance(argument, np.void) and has_layout(argument.dtype):
        return SizedRecordType(schema_of(argument.dtype))
    if not isinstance(argument, np.ndarray) or not has_layout(argument.dtype):
        return typeof(argument)
    known = _TYPES.get(int(argument[LAYOUT][0, _CHECKSUM])) if len(argument) else None
    return known or SizedRecordsType(schema_of(argument.dtype))


def has_sized_records(arguments: tuple[object, ...]) -> bool:
    """Return True if there are records with a layout among arguments."""
    return any(
        isinstance(argument, np.ndarray) and has_layout(argument.dtype) for argument in arguments
    )


def has_sizes_at_run_time(kind: Type) -> bool:
    """Return True for records of sizes at run time, their lanes, vectors, and tuples of them."""
    if isinstance(kind, _TypeOfSchema) or is_sized(kind):
        return True
    parts = (getattr(kind, 'record', None), *getattr(kind, 'types', ()))
    return any(has_sizes_at_run_time(part) for part in parts if part is not None)


@unbox(SizedRecordsType)
def _unbox(kind: SizedRecordsType, obj: Type, c: Type) -> NativeValue:
    bytes_type = types.Array(types.uint8, 1, 'A')
    array = c.context.make_array(bytes_type)(c.context, c.builder)
    pointer = c.builder.bitcast(array._getpointer(), c.pyapi.voidptr)
    error = c.pyapi.nrt_adapt_ndarray_from_python(obj, pointer)
    failed = cgutils.alloca_once_value(c.builder, cgutils.is_not_null(c.builder, error))
    step, count = (
        c.builder.extract_value(value, 0) for value in (array.strides, array.shape)
    )
    data = array.data
    is_read = c.builder.and_(
        c.builder.not_(c.builder.load(failed)), c.builder.icmp_signed('>', count, count.type(0))
    )
    with c.builder.if_then(is_read):
        checksum = c.builder.load(_entry(c.builder, data, _CHECKSUM))
        is_other = c.builder.icmp_signed('!=', checksum, _HALF(kind.schema.checksum))
        c.builder.store(is_other, failed)
    with c.builder.if_then(c.builder.load(failed), likely=False):
        c.pyapi.err_set_string(
            'PyExc_TypeError', 'record of another type; expected that of the compiled kernel'
        )

    def cleanup() -> None:
        c.context.nrt.decref(c.builder, bytes_type, array._getvalue())

    value = cgutils.pack_struct(c.builder, [data, count, step])
    return NativeValue(value, is_error=c.builder.load(failed), cleanup=cleanup)


@type_callable(operator.getitem)
def _type_of_item(context: TypingContext) -> Function:
    def typer(records: Type, i: Type) -> Type | None:
        if not isinstance(records, SizedRecordsType) or not isinstance(i, types.Integer):
            return None
        return SizedRecordType(records.schema)(records, types.intp)

    return typer


@lower_builtin(operator.getitem, SizedRecordsType, types.intp)
def _item(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    compiler = Compiler(context, builder, sig.return_type)
    data, step = (builder.extract_value(args[0], k) for k in (0, 2))
    data = builder.gep(data, [builder.mul(args[1], step)])
    return cgutils.pack_struct(builder, [data, data, workspace_of_function(compiler)])


@type_callable(len)
def _type_of_length(context: TypingContext) -> Function:
    return lambda records: types.intp if isinstance(records, SizedRecordsType) else None


@lower_builtin(len, SizedRecordsType)
def _length(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    return builder.extract_value(args[0], 1)


# Places of fields in instructions.


def _entry(build: Builder, layout: IrValue, place: int) -> IrValue:
    return build.gep(build.bitcast(layout, _HALF.as_pointer()), [_WORD(place)])


def _of_layout(compiler: Compiler, value: IrValue, place: int) -> IrValue:
    """Return an entry of the layout of a record, which kernels do not change."""
    build = compiler.builder
    number = build.load(_entry(build, build.extract_value(value, 1), place))
    number.set_metadata('invariant.load', build.module.add_metadata([]))
    return build.zext(number, _WORD)


def count_of_field(
    compiler: Compiler, kind: SizedRecordType, value: IrValue, name: str
) -> IrValue:
    """Return the number of components of a field."""
    return _of_layout(compiler, value, _FIRST + 2 * kind.schema.places[name] + 1)


def start_of_field(
    compiler: Compiler, kind: SizedRecordType, value: IrValue, name: str
) -> IrValue:
    """Return a pointer to the first number of a field."""
    build = compiler.builder
    k = kind.schema.places[name]
    offset = _of_layout(compiler, value, _FIRST + 2 * k)
    place = build.gep(build.extract_value(value, 0), [offset], inbounds=True)
    return build.bitcast(place, compiler.context.get_data_type(number_of(kind, name)).as_pointer())


def number_of(kind: SizedRecordType, name: str) -> types.Type:
    """Return the type of a component of a field."""
    code = kind.schema.fields[kind.schema.places[name]][1]
    return types.float64 if code == 'f8' else types.int64


def is_vector(kind: SizedRecordType, name: str) -> bool:
    """Return True if a field has components."""
    return kind.schema.fields[kind.schema.places[name]][2]


def copy_of_record(compiler: Compiler, value: IrValue, alignment: int) -> IrValue:
    """Return a copy of a record on the stack, with the layout of the record."""
    build = compiler.builder
    room = build.alloca(_BYTE, _of_layout(compiler, value, _SIZE))
    room.align = alignment
    copy = cgutils.pack_struct(
        build, [room, build.extract_value(value, 1), build.extract_value(value, 2)]
    )
    copy_numbers(compiler, value, copy)
    return copy


def copy_numbers(compiler: Compiler, source: IrValue, target: IrValue) -> None:
    """Copy all numbers and tags of a record into another one of the same type."""
    (data, count), (copy, _) = (numbers_of_record(compiler, record) for record in (source, target))
    cgutils.raw_memcpy(compiler.builder, copy, data, count, 8)


def numbers_of_record(compiler: Compiler, value: IrValue) -> tuple[IrValue, IrValue]:
    """Return a pointer to the numbers of a record without tags, and their number."""
    build = compiler.builder
    first = _of_layout(compiler, value, _FIRST)
    size = build.sub(_of_layout(compiler, value, _SIZE), first)
    return build.gep(build.extract_value(value, 0), [first]), build.lshr(size, _WORD(3))
