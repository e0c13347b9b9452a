# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Vectors and matrices of compiled code whose lengths are known at run time, and their workspace.

Records of robots described by a URDF have such vectors (`sized_records.py`): one compiled code
serves robots of all sizes. Operations in `tuples.py` and `arrays.py` accept them in place of
tuples. Their entries are numbers, or tuples of numbers.

Entries are in the workspace, memory on the stack of the kernel that Python calls; threads that
run kernels at once have separate ones. A new vector takes the next free memory. `mark` and `free`
release the memory of all vectors created in between. Vectors do not change after their creation,
so parts of a vector share its memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import operator

from masmc_ros.aliases import Function
from masmc_ros.errors import InputError
from masmc_ros.jit.generated import (
    Builder,
    Compiler,
    generated,
    IrValue,
    IrValues,
    Type,
    Types,
    TypingContext,
)
from numba import types
from numba.core import cgutils
from numba.core.datamodel.manager import DataModelManager
from numba.core.imputils import iternext_impl, RefType
from numba.core.typing import Signature
from numba.extending import lower_builtin, models, register_model, type_callable

ir = cgutils.ir

WORKSPACE = 1 << 20
"""Size of the workspace in bytes."""

OVERFLOW = (
    f'workspace of {WORKSPACE} bytes is full: too many joints, axes, parameters or lanes; expected'
    ' fewer robot.joints or fewer runs at once'
)
"""Text of the InputError of a kernel that needs more memory for vectors."""

_ALIGNMENT = 64

_TOP, _START, _END, _IS_FULL = range(4)
"""Words at the start of a workspace: next free address, first, end, and 1 after an overflow."""

_WORD = ir.IntType(64)
_POINTER = ir.IntType(8).as_pointer()


class VectorType(types.IterableType):
    """Type of a vector with a length known at run time."""

    def __init__(self, entry: types.Type) -> None:
        """Initialise the type for a type of entries."""
        self.entry = entry
        super().__init__(f'Vector({entry})')

    @property
    def key(self) -> types.Type:
        """Return the type of the entries: Numba treats types with equal keys as one type."""
        return self.entry

    @property
    def mangling_args(self) -> tuple[str, tuple[types.Type]]:
        """Return the short name of the type in symbols."""
        return 'Vector', (self.entry,)

    @property
    def iterator_type(self) -> VectorIteratorType:
        """Return the type of the iterator over the entries."""
        return VectorIteratorType(self)


class VectorIteratorType(types.SimpleIteratorType):
    """Type of the iterator over the entries of a vector."""

    def __init__(self, vector: VectorType) -> None:
        """Initialise the type for a type of vectors."""
        self.vector = vector
        super().__init__(f'Iterator({vector})', vector.entry)


class MatrixType(types.Type):
    """Type of a matrix of numbers, whose rows are vectors."""

    def __init__(self) -> None:
        """Initialise the type."""
        super().__init__('Matrix')


NUMBERS = VectorType(types.float64)
ROWS = MatrixType()


@register_model(VectorType)
class _VectorModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: VectorType) -> None:
        members = [
            ('data', types.CPointer(kind.entry)),
            ('count', types.intp),
            ('workspace', types.voidptr),
        ]
        super().__init__(manager, kind, members)


@register_model(MatrixType)
class _MatrixModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: MatrixType) -> None:
        members = [
            ('data', types.CPointer(types.float64)),
            ('rows', types.intp),
            ('workspace', types.voidptr),
            ('columns', types.intp),
        ]
        super().__init__(manager, kind, members)


@register_model(VectorIteratorType)
class _IteratorModel(models.StructModel):
    def __init__(self, manager: DataModelManager, kind: VectorIteratorType) -> None:
        members = [('index', types.EphemeralPointer(types.intp)), ('vector', kind.vector)]
        super().__init__(manager, kind, members)


def is_sized(kind: Type) -> bool:
    """Return True for the type of a vector or matrix with a length known at run time."""
    return isinstance(kind, VectorType | MatrixType)


# Workspace.


def workspace_of_function(compiler: Compiler) -> IrValue:
    """Return the workspace of the function that is compiled; the first call creates it."""
    build = compiler.builder
    function = build.function
    workspace = getattr(function, 'masmc_workspace', None)
    if workspace is None:
        room = cgutils.alloca_once(build, _WORD, _WORD(WORKSPACE // 8))
        room.align = _ALIGNMENT
        with build.goto_entry_block():
            start = build.ptrtoint(room, _WORD)
            first = build.add(start, _WORD(_ALIGNMENT))
            for place, value in (
                (_TOP, first),
                (_START, first),
                (_END, build.add(start, _WORD(WORKSPACE))),
                (_IS_FULL, _WORD(0)),
            ):
                build.store(value, build.gep(room, [_WORD(place)]))
            workspace = build.bitcast(room, _POINTER)
        function.masmc_workspace = workspace
    return workspace


def _word(build: Builder, workspace: IrValue, place: int) -> IrValue:
    """Return a pointer to a word of a workspace."""
    words = build.bitcast(workspace, _WORD.as_pointer())
    return build.gep(words, [_WORD(place)])


def _taken(compiler: Compiler, workspace: IrValue, size: IrValue) -> IrValue:
    """
    Return the address of `size` free bytes.

    A full workspace starts again. Results are then wrong but all accesses are within it, because
    vectors contain no addresses; `check_workspace` raises the error.
    """
    build = compiler.builder
    size = build.and_(build.add(size, _WORD(_ALIGNMENT - 1)), _WORD(-_ALIGNMENT))
    place = _word(build, workspace, _TOP)
    top = build.load(place)
    after = build.add(top, size)
    is_full = build.icmp_unsigned('>', after, build.load(_word(build, workspace, _END)))
    slot = cgutils.alloca_once_value(build, top)
    with build.if_then(is_full, likely=False):
        build.store(_WORD(1), _word(build, workspace, _IS_FULL))
        build.store(build.load(_word(build, workspace, _START)), slot)
    top = build.load(slot)
    build.store(build.add(top, size), place)
    return top


def mark(source: object) -> int:
    """Return the place of the next vector in the workspace of a record, lane or vector."""
    return 0


@generated(mark, lambda context, source: types.intp)
def _mark(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    workspace = _workspace_of_source(compiler, kinds[0], values[0])
    if workspace is None:
        return _WORD(0)
    return compiler.builder.load(_word(compiler.builder, workspace, _TOP))


def free(source: object, place: int) -> None:
    """Release the memory of the vectors that were created since `mark` returned a place."""


@generated(free, lambda context, source, place: types.none)
def _free(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    workspace = _workspace_of_source(compiler, kinds[0], values[0])
    if workspace is not None:
        compiler.builder.store(values[1], _word(compiler.builder, workspace, _TOP))
    return compiler.context.get_dummy_value()


def check_workspace(source: object) -> None:
    """Raise InputError if the workspace of a record or lane was full: the results are wrong."""


@generated(check_workspace, lambda context, source: types.none)
def _check_workspace(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    build = compiler.builder
    workspace = _workspace_of_source(compiler, kinds[0], values[0])
    if workspace is not None:
        is_full = build.load(_word(build, workspace, _IS_FULL))
        with build.if_then(build.icmp_unsigned('!=', is_full, _WORD(0)), likely=False):
            conventions: Type = compiler.context
            conventions.call_conv.return_user_exc(build, InputError, (OVERFLOW,))
    return compiler.context.get_dummy_value()


def _workspace_of_source(compiler: Compiler, kind: Type, value: IrValue) -> IrValue | None:
    """Return the workspace of a vector, of a record or of its lane; None without one."""
    if is_sized(kind):
        return compiler.builder.extract_value(value, 2)
    find = getattr(kind, 'workspace', None)
    return None if find is None else find(compiler, value)


# Parts of vectors in instructions.


def data_of(compiler: Compiler, value: IrValue) -> IrValue:
    """Return the pointer to the first entry of a vector or matrix."""
    return compiler.builder.extract_value(value, 0)


def count_of(compiler: Compiler, value: IrValue) -> IrValue:
    """Return the number of entries of a vector, or of rows of a matrix."""
    return compiler.builder.extract_value(value, 1)


def workspace_of(compiler: Compiler, value: IrValue) -> IrValue:
    """Return the workspace of a vector or matrix."""
    return compiler.builder.extract_value(value, 2)


def columns_of(compiler: Compiler, value: IrValue) -> IrValue:
    """Return the number of columns of a matrix."""
    return compiler.builder.extract_value(value, 3)


def vector_over(
    compiler: Compiler, data: IrValue, count: IrValue, workspace: IrValue
) -> IrValue:
    """Return a vector over existing memory."""
    return cgutils.pack_struct(compiler.builder, [data, count, workspace])


def new_vector(
    compiler: Compiler, entry: Type, count: IrValue, workspace: IrValue
) -> IrValue:
    """Return an uninitialised vector of `count` entries."""
    kind = compiler.context.get_data_type(entry)
    size = compiler.context.get_abi_sizeof(kind)
    address = _taken(compiler, workspace, compiler.builder.mul(count, _WORD(size)))
    data = compiler.builder.inttoptr(address, kind.as_pointer())
    return vector_over(compiler, data, count, workspace)


def new_vector_like(compiler: Compiler, entry: Type, template: IrValue) -> IrValue:
    """Return an uninitialised vector as long as another one, in the same workspace."""
    count, workspace = count_of(compiler, template), workspace_of(compiler, template)
    return new_vector(compiler, entry, count, workspace)


def vector_of_entries(
    compiler: Compiler,
    entry: Type,
    template: IrValue,
    entry_at: Callable[[IrValue], IrValue],
    *,
    is_vectorised: bool = False,
) -> IrValue:
    """Return a vector as long as another one, whose entries a function returns by their index."""
    out = new_vector_like(compiler, entry, template)
    count = count_of(compiler, template)
    with short_loop(compiler.builder, count, is_vectorised=is_vectorised) as i:
        store_entry(compiler, VectorType(entry), out, i, entry_at(i))
    return out


def new_matrix(
    compiler: Compiler, rows: IrValue, columns: IrValue, workspace: IrValue
) -> IrValue:
    """Return an uninitialised matrix of numbers."""
    build = compiler.builder
    size = build.mul(build.mul(rows, columns), _WORD(8))
    data = build.inttoptr(_taken(compiler, workspace, size), ir.DoubleType().as_pointer())
    return cgutils.pack_struct(build, [data, rows, workspace, columns])


def row_of(compiler: Compiler, value: IrValue, i: IrValue) -> IrValue:
    """Return a row of a matrix as a vector over its memory."""
    build = compiler.builder
    columns = columns_of(compiler, value)
    data = build.gep(data_of(compiler, value), [build.mul(i, columns)])
    return vector_over(compiler, data, columns, workspace_of(compiler, value))


def load_entry(compiler: Compiler, kind: VectorType, value: IrValue, i: IrValue) -> IrValue:
    """Return an entry of a vector."""
    place = compiler.builder.gep(data_of(compiler, value), [i])
    return compiler.context.unpack_value(compiler.builder, kind.entry, place)


def store_entry(
    compiler: Compiler, kind: VectorType, value: IrValue, i: IrValue, entry: IrValue
) -> None:
    """Write an entry of a new vector."""
    place = compiler.builder.gep(data_of(compiler, value), [i])
    compiler.context.pack_value(compiler.builder, kind.entry, entry, place)


def part_of(compiler: Compiler, value: IrValue, first: IrValue, count: IrValue) -> IrValue:
    """Return consecutive entries of a vector, as a vector over its memory."""
    data = compiler.builder.gep(data_of(compiler, value), [first])
    return vector_over(compiler, data, count, workspace_of(compiler, value))


def copy_entries(
    compiler: Compiler, source: IrValue, target: IrValue, count: IrValue, steps: int = 1
) -> None:
    """Copy numbers between pointers; those of the source are `steps` numbers apart."""
    build = compiler.builder
    if steps == 1:
        size = build.shl(count, count.type(3))
        target, source = (build.bitcast(place, _POINTER) for place in (target, source))
        cgutils.raw_memcpy(build, target, source, size, 1)
        return
    with short_loop(build, count) as i:
        place = build.gep(source, [build.mul(i, i.type(steps))])
        build.store(build.load(place), build.gep(target, [i]))


@contextmanager
def short_loop(
    build: Builder, count: IrValue, *, is_vectorised: bool = False
) -> Iterator[IrValue]:
    """
    Emit a loop over indices 0 ... count - 1, which yields the index.

    The compiler neither unrolls nor, by default, vectorises it. Robots have few joints: such code
    takes long to compile and is not faster. Functions of entries are faster in vectors, because
    some vectors have an entry per parameter.
    """
    entry = build.block
    test, body, after = (
        build.append_basic_block(f'short.{name}') for name in ('test', 'body', 'end')
    )
    build.branch(test)
    build.position_at_end(test)
    index = build.phi(count.type, 'short.index')
    index.add_incoming(count.type(0), entry)
    build.cbranch(build.icmp_signed('<', index, count), body, after)
    build.position_at_end(body)
    yield index
    following = build.add(index, count.type(1), flags=('nsw',))
    index.add_incoming(following, build.block)
    back = build.branch(test)
    back.set_metadata('llvm.loop', _loop_options(build.module, is_vectorised=is_vectorised))
    build.position_at_end(after)


def _loop_options(module: IrValue, *, is_vectorised: bool) -> IrValue:
    """Return the options of a loop, which must be distinct from those of all other loops."""
    number = len(module.metadata)
    name = module.add_metadata([ir.MetaDataString(module, f'short loop {number}')])
    options = [module.add_metadata([ir.MetaDataString(module, 'llvm.loop.unroll.disable')])]
    if not is_vectorised:
        option = ir.MetaDataString(module, 'llvm.loop.vectorize.enable')
        options.append(module.add_metadata([option, ir.IntType(1)(0)]))
    name.operands = (name, *options)
    return name


# Operations in the language: length, entries and comparison.


@type_callable(len)
def _type_of_length(context: TypingContext) -> Function:
    return lambda value: types.intp if is_sized(value) else None


@type_callable(operator.getitem)
def _type_of_entry(context: TypingContext) -> Function:
    def typer(value: Type, i: Type) -> Type | None:
        if not is_sized(value) or not isinstance(i, types.Integer):
            return None
        return (value.entry if isinstance(value, VectorType) else NUMBERS)(value, types.intp)

    return typer


@type_callable(operator.eq)
@type_callable(operator.ne)
def _type_of_comparison(context: TypingContext) -> Function:
    return lambda a, b: types.boolean if isinstance(a, VectorType) and a == b else None


@lower_builtin(len, VectorType)
@lower_builtin(len, MatrixType)
def _length(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    return builder.extract_value(args[0], 1)


@lower_builtin(operator.getitem, VectorType, types.intp)
def _entry_of(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    return load_entry(Compiler(context, builder, sig.return_type), sig.args[0], args[0], args[1])


@lower_builtin(operator.getitem, MatrixType, types.intp)
def _row_of(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    return row_of(Compiler(context, builder, sig.return_type), args[0], args[1])


@lower_builtin('getiter', VectorType)
def _iterator(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    index = cgutils.alloca_once_value(builder, _WORD(0))
    return cgutils.pack_struct(builder, [index, args[0]])


@lower_builtin('iternext', VectorIteratorType)
@iternext_impl(RefType.UNTRACKED)
def _next(
    context: Type, builder: Builder, sig: Signature, args: IrValues, result: Type
) -> None:
    kind = sig.args[0].vector
    place, vector = (builder.extract_value(args[0], k) for k in range(2))
    compiler = Compiler(context, builder, kind.entry)
    index = builder.load(place)
    is_valid = builder.icmp_signed('<', index, count_of(compiler, vector))
    result.set_valid(is_valid)
    with builder.if_then(is_valid):
        result.yield_(load_entry(compiler, kind, vector, index))
        builder.store(builder.add(index, _WORD(1)), place)


def _are_equal(compiler: Compiler, kind: VectorType, a: IrValue, b: IrValue) -> IrValue:
    build, context = compiler.builder, compiler.context
    result = cgutils.alloca_once_value(build, cgutils.true_bit)
    equal = context.typing_context.resolve_function_type(
        operator.eq, (kind.entry, kind.entry), {}
    )
    compare = context.get_function(operator.eq, equal)
    with short_loop(build, count_of(compiler, a)) as i:
        entries = [load_entry(compiler, kind, value, i) for value in (a, b)]
        build.store(build.and_(build.load(result), compare(build, entries)), result)
    return build.load(result)


@lower_builtin(operator.eq, VectorType, VectorType)
def _equal(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    return _are_equal(Compiler(context, builder, types.boolean), sig.args[0], *args)


@lower_builtin(operator.ne, VectorType, VectorType)
def _different(context: Type, builder: Builder, sig: Signature, args: IrValues) -> IrValue:
    compiler = Compiler(context, builder, types.boolean)
    return builder.not_(_are_equal(compiler, sig.args[0], *args))
