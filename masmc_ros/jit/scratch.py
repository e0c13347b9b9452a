# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Arrays of one tick without memory from the heap.

`scratch` arrays are on the stack, where creation is free. A function may pass them to other
functions, but neither return nor keep them. `lasting` arrays are in the workspace of vectors; a
function may return them. An array on the heap costs as much as a hundred multiplications, and each
use of it counts references.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers
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
from masmc_ros.jit.tuples import FLOAT
from masmc_ros.jit.vectors import VectorType
from numba import types
from numba.core import cgutils
import numpy as np

MOST = {1: 200, 2: 840}
"""
Largest number of entries by dimension for which memory is reserved on the stack.

Sizes are no multiples of 4 KiB, because processors first mistake such addresses for the same one.
"""


CACHE_LINE = 64

VECTOR = types.Array(FLOAT, 1, 'C')


def scratch(*shape: int) -> Array:
    """
    Return an uninitialised array of one or two dimensions.

    In compiled code it is valid until the function ends; for an inlined formula, until its result
    is used.
    """
    return np.empty(shape)


def lasting(like: Numbers, *shape: int) -> Array:
    """
    Return an uninitialised array of one or two dimensions that exists as long as a new vector.

    It is in the workspace of `like`, or on the heap if this is no vector of compiled code with a
    length known at run time.
    """
    return np.empty(shape)


@formula
def clear(array: Array) -> None:
    """Write zeros into an array; the compiled code is much shorter than for `array[:] = 0.0`."""
    # The compiler omits the branch of the other dimension.
    if array.ndim == 1:
        for i in range(len(array)):
            array[i] = 0.0
    else:
        for i in range(array.shape[0]):
            for j in range(array.shape[1]):
                array[i, j] = 0.0


@formula
def copy_into(array: Array, values: Array) -> None:
    """Copy an array into another one of the same shape."""
    if array.ndim == 1:
        for i in range(len(array)):
            array[i] = values[i]
    else:
        for i in range(array.shape[0]):
            for j in range(array.shape[1]):
                array[i, j] = values[i, j]


def _type_of_scratch(context: TypingContext, *shape: Type) -> Type:
    return types.Array(FLOAT, len(shape), 'C')


def _lengths(compiler: Compiler, kinds: Types, values: IrValues) -> tuple[list[IrValue], IrValue]:
    """Return the lengths of an array by dimension, and the number of its entries."""
    lengths = [
        compiler.cast(value, kind, types.intp) for value, kind in zip(values, kinds, strict=True)
    ]
    count = lengths[0]
    for length in lengths[1:]:
        count = compiler.builder.mul(count, length)
    return lengths, count


@generated(scratch, _type_of_scratch)
def _scratch(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    context, build = compiler.context, compiler.builder
    lengths, count = _lengths(compiler, kinds, values)
    number = context.get_data_type(FLOAT)
    most = context.get_constant(types.intp, MOST[len(kinds)])
    room = cgutils.alloca_once(build, number, most)
    # Without alignment, the numbers that cross two cache lines differ in every process.
    room.align = CACHE_LINE
    place = cgutils.alloca_once_value(build, room)
    with build.if_then(build.icmp_signed('>', count, most), likely=False):
        build.store(_large(compiler, number, count), place)
    return array_over(compiler, compiler.result, build.load(place), lengths)


def _large(compiler: Compiler, number: IrValue, count: IrValue) -> IrValue:
    """Return the address of `count` numbers on the stack, reserved once for a loop."""
    build = compiler.builder
    room = cgutils.alloca_once(build, number.as_pointer())
    size = cgutils.alloca_once(build, count.type)
    with build.if_then(build.icmp_signed('>', count, build.load(size))):
        larger = build.alloca(number, count)
        larger.align = CACHE_LINE
        build.store(larger, room)
        build.store(count, size)
    return build.load(room)


@generated(lasting, lambda context, like, *shape: _type_of_scratch(context, *shape))
def _lasting(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    lengths, count = _lengths(compiler, kinds[1:], values[1:])
    if not isinstance(kinds[0], VectorType):
        return _on_heap(compiler, lengths)
    workspace = vectors.workspace_of(compiler, values[0])
    data = vectors.data_of(compiler, vectors.new_vector(compiler, FLOAT, count, workspace))
    return array_over(compiler, compiler.result, data, lengths)


def _empty(shape: int | tuple[int, ...]) -> Array:
    return np.empty(shape)


def _on_heap(compiler: Compiler, lengths: list[IrValue]) -> IrValue:
    if len(lengths) == 1:
        return compiler.run(_empty, (types.intp,), lengths)
    kind = types.UniTuple(types.intp, len(lengths))
    return compiler.run(_empty, (kind,), (compiler.tuple_of(lengths, kind),))


def array_over(
    compiler: Compiler,
    kind: types.Array,
    room: IrValue,
    lengths: list[IrValue],
    owner: IrValue | None = None,
    steps: int = 1,
) -> IrValue:
    """
    Return an array over existing memory; without an owner it is not reference-counted.

    Consecutive entries of the last dimension are `steps` numbers apart.
    """
    context, build = compiler.context, compiler.builder
    own = context.make_array(kind)(context, build)
    size = context.get_constant(types.intp, context.get_abi_sizeof(room.type.pointee))
    strides, count = [build.mul(size, size.type(steps))], lengths[0]
    for length in lengths[:0:-1]:
        strides.insert(0, build.mul(strides[0], length))
        count = build.mul(count, length)
    # Without an owner, reference counting ignores the array.
    own.meminfo = cgutils.get_null_value(own.meminfo.type) if owner is None else owner
    own.parent = cgutils.get_null_value(own.parent.type)
    own.data, own.nitems, own.itemsize = room, count, size
    own.shape = cgutils.pack_array(build, lengths)
    own.strides = cgutils.pack_array(build, strides)
    return own._getvalue()
