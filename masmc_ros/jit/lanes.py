# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
One lane of a record, whose fields are attributes.

Kernels and loops over lanes create it by `lane_of(record, lane)`. Formulas read `memory.estimate`,
a number or a vector, and write `memory.estimate = value`. Reading returns a copy.

In compiled code a lane is a pointer to the record and the index of the lane. LLVM keeps both in
registers, and each attribute becomes one load or store per component. The index of the lane is
innermost, so loops over lanes vectorise.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from masmc_ros.aliases import AnyArray, Array, Numbers, Record
from masmc_ros.jit import vectors
from masmc_ros.jit.generated import (
    Builder,
    CodeContext,
    Compiler,
    generated,
    IrValue,
    IrValues,
    Type,
    Types,
    TypingContext,
)
from masmc_ros.jit.scratch import array_over
from masmc_ros.jit.shared_records import has_one_lane, shared_record, SharedRecordType
from masmc_ros.jit.sized_records import (
    count_of_field,
    is_vector,
    number_of,
    SizedRecordType,
    start_of_field,
)
from masmc_ros.jit.vectors import VectorType
from numba import types
from numba.core import cgutils
from numba.core.datamodel.manager import DataModelManager
from numba.core.errors import TypingError
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer,
    Signature,
    signature,
)
from numba.extending import (
    infer_getattr,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)
import numpy as np
from numpy.typing import ArrayLike


class Lane:
    """One lane of a record in plain Python."""

    __slots__ = '_lane', '_record'

    def __init__(self, record: Record, lane: int) -> None:
        """Initialise the lane of an entry of an array of records."""
        object.__setattr__(self, '_record', record)
        object.__setattr__(self, '_lane', lane)

    @property
    def dtype(self) -> Any:
        """Return the type of the record."""
        return self._record.dtype

    def __getattr__(self, name: str) -> Any:
        """Return a field: a number, or a vector of its components."""
        values = self._values(name)
        if values.ndim == 0:
            return values[()]
        return tuple(values)

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        """Write a number or a vector into a field."""
        self._values(name)[...] = value

    def _values(self, name: str) -> AnyArray:
        if name not in self.dtype.names:
            raise AttributeError(_unknown(name, self.dtype.names), name=name, obj=self)
        return self._record[name][..., self._lane]


def _unknown(name: str, fields: Iterable[str]) -> str:
    known = ', '.join(field for field in fields if field.isidentifier())
    return f'no field {name!r}; known are {known}'


class LaneType(types.Type):
    """Type of one lane of a record in compiled code."""

    def __init__(self, record: Type) -> None:
        """Initialise the type for a type of records."""
        self.record = record
        super().__init__(f'Lane({record.name})')

    @property
    def key(self) -> Type:
        """Return the type of the record: Numba treats types with equal keys as one type."""
        return self.record

    @property
    def mangling_args(self) -> tuple[str, tuple[Type]]:
        """Return the short name of the type in symbols."""
        return 'Lane', (self.record,)

    @property
    def fields(self) -> Iterable[str]:
        """Return the names of the fields."""
        names: Iterable[str] = self.record.fields
        return names

    @property
    def lanes(self) -> int:
        """Return the number of lanes of the record."""
        return int(next(iter(self.record.fields.values())).type.shape[-1])

    def _array(self, name: str) -> Type:
        return self.record.fields[name].type

    def number(self, name: str) -> Type:
        """Return the type of a component of a field."""
        return self._array(name).dtype

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a field: (lanes) or (components, lanes)."""
        return tuple(self._array(name).shape)

    def type_of(self, name: str) -> Type:
        """Return the type of a field when it is read."""
        shape = self.shape(name)
        if len(shape) == 1:
            return self.number(name)
        return types.UniTuple(self.number(name), shape[0])

    def array_of(self, name: str) -> Type:
        """Return the array type of the components of a field."""
        return types.Array(self.number(name), 1, 'C' if self.shape(name)[-1] == 1 else 'A')


class SizedLaneType(LaneType):
    """Type of one lane of a record whose sizes are known at run time."""

    @property
    def fields(self) -> Iterable[str]:
        """Return the names of the fields."""
        names: Iterable[str] = self.record.schema.places
        return names

    @property
    def lanes(self) -> int:
        """Return the number of lanes of the record."""
        return int(self.record.schema.lanes)

    def number(self, name: str) -> Type:
        """Return the type of a component of a field."""
        return number_of(self.record, name)

    def type_of(self, name: str) -> Type:
        """Return the type of a field when it is read."""
        number = self.number(name)
        return VectorType(number) if is_vector(self.record, name) else number

    def array_of(self, name: str) -> Type:
        """Return the array type of the components of a field."""
        return types.Array(self.number(name), 1, 'C' if self.lanes == 1 else 'A')

    def workspace(self, compiler: Compiler, value: IrValue) -> IrValue:
        """Return the workspace for vectors of the record."""
        record = compiler.builder.extract_value(value, 0)
        workspace: IrValue = self.record.workspace(compiler, record)
        return workspace


@register_model(LaneType)
@register_model(SizedLaneType)
class _LaneModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: LaneType) -> None:
        super().__init__(manager, kind, [('record', kind.record), ('lane', types.intp)])


@infer_getattr
class _Attributes(AttributeTemplate):
    key = LaneType

    # In Numba's class this attribute is NotImplemented.
    def generic_resolve(self, kind: LaneType, name: str) -> Type:  # type: ignore[override]
        if name not in kind.fields:
            raise TypingError(_unknown(name, kind.fields))
        return kind.type_of(name)


@infer_getattr
class _SizedAttributes(_Attributes):
    key = SizedLaneType


def lane_of(record: Record | Array, lane: int) -> Any:
    """Return one lane of a record, or of an array (..., lanes) the view of its entries."""
    return record[..., lane] if isinstance(record, np.ndarray) else Lane(record, lane)


def _type_of_lane(context: TypingContext, record: Type, lane: Type) -> Type:
    if isinstance(record, types.Array):
        return types.Array(record.dtype, record.ndim - 1, 'A')
    if isinstance(record, SizedRecordType):
        return SizedLaneType(record)
    is_record = isinstance(record, types.Record | SharedRecordType)
    return LaneType(record) if is_record else None


@generated(lane_of, _type_of_lane)
def _lane_of(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    lane = compiler.cast(values[1], kinds[1], types.intp)
    if not isinstance(kinds[0], types.Array):
        return cgutils.pack_struct(compiler.builder, [values[0], lane])
    # Without an owner, reference counting does not prevent loops over lanes from vectorising.
    context, build = compiler.context, compiler.builder
    whole = context.make_array(kinds[0])(context, build, values[0])
    part = context.make_array(compiler.result)(context, build)
    part.meminfo = cgutils.get_null_value(part.meminfo.type)
    part.parent = cgutils.get_null_value(part.parent.type)
    lengths, strides = (
        cgutils.unpack_tuple(build, shape)[:-1] for shape in (whole.shape, whole.strides)
    )
    part.data, part.itemsize = build.gep(whole.data, [lane]), whole.itemsize
    part.nitems = build.sdiv(whole.nitems, build.extract_value(whole.shape, kinds[0].ndim - 1))
    part.shape, part.strides = (cgutils.pack_array(build, sizes) for sizes in (lengths, strides))
    return part._getvalue()


def shared(lane: Any) -> Any:
    """
    Return a lane or a record with its first fields only, those that all laws share.

    Functions with such arguments are compiled once for all laws. Those of several lanes and of
    constant sizes keep all fields, because kernels inline them.
    """
    return lane


def _type_of_shared(context: TypingContext, lane: Type) -> Type:
    if isinstance(lane, LaneType):
        record = _type_of_shared(context, lane.record)
        return SizedLaneType(record) if isinstance(lane, SizedLaneType) else LaneType(record)
    if isinstance(lane, SizedRecordType):
        return SizedRecordType(lane.schema.shared)
    if isinstance(lane, types.Record):
        return shared_record(lane) if has_one_lane(lane) else lane
    return lane if isinstance(lane, SharedRecordType) else None


@generated(shared, _type_of_shared)
def _shared(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    lane, wanted, build = values[0], compiler.result, compiler.builder
    if isinstance(wanted, SharedRecordType):
        return build.bitcast(lane, compiler.context.get_value_type(wanted))
    if isinstance(wanted, LaneType) and isinstance(wanted.record, SharedRecordType):
        pointer = compiler.context.get_value_type(wanted.record)
        record, index = (build.extract_value(lane, k) for k in range(2))
        return cgutils.pack_struct(build, [build.bitcast(record, pointer), index])
    return lane


def in_place(lane: Any, name: str) -> Array:
    """Return a vector of one lane as an array (components) that reads and writes the record."""
    return lane._values(name)


def _type_of_array(context: TypingContext, lane: Type, name: Type) -> Type:
    is_known = isinstance(lane, LaneType) and isinstance(name, types.StringLiteral)
    return lane.array_of(name.literal_value) if is_known else None


@generated(in_place, _type_of_array)
def _in_place(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    name = kinds[1].literal_value
    first = _component(compiler, kinds[0], values[0], name, 0)
    length = _count(compiler, kinds[0], values[0], name)
    return array_over(compiler, compiler.result, first, [length], steps=kinds[0].lanes)


@infer
class _Components(AbstractTemplate):
    key = 'static_getitem'

    def generic(self, args: Types, kws: object) -> Signature | None:
        record, name = args
        if isinstance(record, SharedRecordType) and name in record.fields:
            field = record.fields[name].type
            return signature(types.Array(field.dtype, field.ndim, 'C'), record, name)
        if not isinstance(record, SizedRecordType) or name not in record.schema.places:
            return None
        dimensions = 2 if is_vector(record, name) else 1
        return signature(types.Array(number_of(record, name), dimensions, 'C'), record, name)


@lower_builtin('static_getitem', SharedRecordType, types.StringLiteral)
def _shared_components(
    context: CodeContext, builder: Builder, sig: Signature, args: IrValues
) -> IrValue:
    """Return a field of the only lane as an array."""
    compiler, field = Compiler(context, builder, sig.return_type), sig.args[0].fields[str(args[1])]
    lengths = [context.get_constant(types.intp, length) for length in field.type.shape]
    number = context.get_data_type(field.type.dtype)
    first = cgutils.get_record_member(builder, args[0], field.offset, number)
    return array_over(compiler, sig.return_type, first, lengths)


@lower_builtin('static_getitem', SizedRecordType, types.StringLiteral)
def _components(
    context: CodeContext, builder: Builder, sig: Signature, args: IrValues
) -> IrValue:
    """Return a field of all lanes as an array."""
    kind, record, name = sig.args[0], args[0], str(args[1])
    compiler = Compiler(context, builder, sig.return_type)
    lengths = [context.get_constant(types.intp, kind.schema.lanes)]
    if is_vector(kind, name):
        lengths.insert(0, count_of_field(compiler, kind, record, name))
    first = start_of_field(compiler, kind, record, name)
    return array_over(compiler, sig.return_type, first, lengths)


def part_in_place(lane: Any, name: str, first: int, count: int) -> Numbers:
    """Return constant components of a field, which compiled code does not copy for one lane."""
    return tuple(lane._values(name)[first:first + count].tolist())


def _type_of_part(
    context: TypingContext, lane: Type, name: Type, first: Type, count: Type
) -> Type:
    is_known = isinstance(lane, SizedLaneType) and isinstance(name, types.StringLiteral)
    return VectorType(lane.number(name.literal_value)) if is_known else None


@generated(part_in_place, _type_of_part)
def _part_in_place(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    kind, lane, name = kinds[0], values[0], kinds[1].literal_value
    first, count = (compiler.cast(values[k], kinds[k], types.intp) for k in (2, 3))
    place = _component(compiler, kind, lane, name, first)
    return _components_at(compiler, kind, lane, name, place, count, is_shared=True)


def _components_at(
    compiler: Compiler,
    kind: SizedLaneType,
    lane: IrValue,
    name: str,
    place: IrValue,
    count: IrValue,
    *,
    is_shared: bool,
) -> IrValue:
    """Return components of a field as a vector, which may share the memory of one lane."""
    workspace = kind.workspace(compiler, lane)
    if kind.lanes == 1 and is_shared:
        return vectors.vector_over(compiler, place, count, workspace)
    vector = vectors.new_vector(compiler, kind.number(name), count, workspace)
    data = vectors.data_of(compiler, vector)
    vectors.copy_entries(compiler, place, data, count, kind.lanes)
    return vector


@lower_getattr_generic(SizedLaneType)
def _read_sized(
    context: CodeContext, builder: Builder, kind: SizedLaneType, value: IrValue, name: str
) -> IrValue:
    compiler = Compiler(context, builder, kind.type_of(name))
    first = _component(compiler, kind, value, name, 0)
    if not is_vector(kind.record, name):
        return builder.load(first)
    count, is_shared = _count(compiler, kind, value, name), kind.record.schema.is_constant
    return _components_at(compiler, kind, value, name, first, count, is_shared=is_shared)


@lower_setattr_generic(SizedLaneType)
def _write_sized(
    context: CodeContext, builder: Builder, signature: Signature, values: IrValues, name: str
) -> None:
    kind, value_kind = signature.args
    compiler = Compiler(context, builder, value_kind)
    first = _component(compiler, kind, values[0], name, 0)
    if not is_vector(kind.record, name):
        builder.store(values[1], first)
        return
    data, count = vectors.data_of(compiler, values[1]), _count(compiler, kind, values[0], name)
    if kind.lanes == 1:
        vectors.copy_entries(compiler, data, first, count)
        return
    with vectors.short_loop(builder, count) as i:
        place = builder.gep(first, [builder.mul(i, i.type(kind.lanes))])
        builder.store(builder.load(builder.gep(data, [i])), place)


@lower_getattr_generic(LaneType)
def _read(
    context: CodeContext, builder: Builder, kind: LaneType, value: IrValue, name: str
) -> IrValue:
    compiler = Compiler(context, builder, kind.type_of(name))
    count = kind.shape(name)[0]
    if not isinstance(compiler.result, types.BaseTuple):
        return builder.load(_component(compiler, kind, value, name, 0))
    return compiler.tuple_of([
        builder.load(_component(compiler, kind, value, name, i)) for i in range(count)
    ])


@lower_setattr_generic(LaneType)
def _write(
    context: CodeContext, builder: Builder, signature: Signature, values: IrValues, name: str
) -> None:
    # Numba has converted the value to the type of the field.
    kind, value_kind = signature.args
    compiler = Compiler(context, builder, value_kind)
    entries = [values[1]]
    if isinstance(value_kind, types.BaseTuple):
        entries = compiler.entries(values[1], value_kind)
    for i, entry in enumerate(entries):
        builder.store(entry, _component(compiler, kind, values[0], name, i))


def _count(compiler: Compiler, kind: LaneType, value: IrValue, name: str) -> IrValue:
    """Return the number of components of a field."""
    if isinstance(kind, SizedLaneType):
        record = compiler.builder.extract_value(value, 0)
        return count_of_field(compiler, kind.record, record, name)
    return compiler.context.get_constant(types.intp, kind.shape(name)[0])


def _component(
    compiler: Compiler, kind: LaneType, value: IrValue, name: str, i: int | IrValue
) -> IrValue:
    """Return a pointer to component i of a field; i is a number or an instruction."""
    build = compiler.builder
    record, lane = (build.extract_value(value, k) for k in range(2))
    if isinstance(kind, SizedLaneType):
        start = start_of_field(compiler, kind.record, record, name)
    else:
        number = compiler.context.get_data_type(kind.number(name))
        start = cgutils.get_record_member(build, record, kind.record.fields[name].offset, number)
    lanes = kind.lanes
    beyond = lane.type(i * lanes) if isinstance(i, int) else build.mul(i, lane.type(lanes))
    return build.gep(start, [build.add(lane, beyond)])
