# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Functions whose compiled code is generated for the types of their arguments.

A formula works on numbers and tuples, and compiled tuples have no loops. Operations on tuples of
any length, on records and on selected formulas therefore give the compiler the type of the result
and the instructions directly. They need no separate compilation. The calling kernel remains an
ordinary function of a module, so its compiled code persists on the disk, unlike that of a closure.

The decorated function in plain Python is used without compilation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TYPE_CHECKING, TypeAlias

from masmc_ros.aliases import Function
from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global, Signature, signature
from numba.extending import lower_builtin

if TYPE_CHECKING:
    from numba.core import base
    from numba.core.cgutils import ir
    from numba.core.typing import context as typing_context

Type: TypeAlias = Any
"""Type of Numba; its attributes depend on the type."""

Types: TypeAlias = Sequence[Type]
"""Types of the arguments of a function."""

IrValue: TypeAlias = 'ir.Value'
"""Instruction or constant of llvmlite, for a value of compiled code."""

IrValues: TypeAlias = Sequence[IrValue]
"""Instructions or constants, for the arguments of a function."""

Builder: TypeAlias = 'ir.IRBuilder'
"""Writer of instructions."""

CodeContext: TypeAlias = 'base.BaseContext'
"""Numba's context of the generation of code."""

TypingContext: TypeAlias = 'typing_context.BaseContext'
"""Numba's context of the inference of types."""

_plain_functions: set[Function] = set()


def is_generated(function: Function) -> bool:
    """Return True if compiled code can call a plain function because its code is generated."""
    return function in _plain_functions


def generated(plain: Function, result: Function) -> Function:
    """
    Decorate `write(compiler, types, values)`, which emits the instructions of `plain`.

    Parameters
    ----------
    plain
        Function in plain Python.
    result
        (typing context, types of the arguments) -> type of the result, or None for unsupported
        arguments.

    """

    class Template(AbstractTemplate):
        key = plain
        prefer_literal = True

        def generic(self, args: Types, kws: object) -> Signature | None:
            return_type = result(self.context, *args)
            return None if return_type is None else signature(return_type, *args)

    _plain_functions.add(plain)
    infer_global(plain, types.Function(type(f'Of_{plain.__name__}', (Template,), {})))

    def decorate(write: Function) -> Function:
        @lower_builtin(plain, types.VarArg(types.Any))
        def lower(
            context: CodeContext, builder: Builder, sig: Signature, args: IrValues
        ) -> IrValue:
            return write(Compiler(context, builder, sig.return_type), sig.args, args)

        return plain

    return decorate


class Compiler:
    """Generator of the instructions of one call."""

    def __init__(self, context: CodeContext, builder: Builder, result: Type) -> None:
        """Initialise the generator for Numba's current function; `result` is the result type."""
        self.context, self.builder, self.result = context, builder, result

    def entries(self, value: IrValue, kind: Type) -> list[IrValue]:
        """Return the entries of a tuple."""
        return [self.builder.extract_value(value, i) for i in range(len(kind))]

    def tuple_of(self, values: IrValues, kind: Type | None = None) -> IrValue:
        """Return a tuple of values."""
        return self.context.make_tuple(self.builder, kind or self.result, values)

    def number(self, value: float) -> IrValue:
        """Return a constant."""
        return self.context.get_constant(types.float64, value)

    def run(self, function: Function, kinds: Types, values: IrValues) -> IrValue:
        """Compile and call a plain function with the same result type."""
        return self.internal(function, self.result, kinds, values)

    def internal(
        self, function: Function, result: Type, kinds: Types, values: IrValues
    ) -> IrValue:
        """Compile and call a plain function for these types of arguments and result."""
        return self.context.compile_internal(
            self.builder, function, signature(result, *kinds), values
        )

    def cast(self, value: IrValue, kind: Type, wanted: Type) -> IrValue:
        """Convert a value to another type."""
        return self.context.cast(self.builder, value, kind, wanted)

    def call(self, function: Type, result: Type, kinds: Types, values: IrValues) -> IrValue:
        """Call a compiled function of type `function`."""
        wanted = called(self.context.typing_context, function, kinds)
        cast = [
            self.cast(value, kind, to)
            for value, kind, to in zip(values, kinds, wanted.args, strict=True)
        ]
        target = self.context.get_function(function, wanted)
        self.context.add_linking_libs(getattr(target, 'libs', ()))
        returned = target(self.builder, cast)
        return self.cast(returned, wanted.return_type, result)


def called(context: TypingContext, function: Type, arguments: Types) -> Signature:
    """Return the signature of a function for these argument types."""
    plain = tuple(types.unliteral(argument) for argument in arguments)
    return function.get_call_type(context, plain, {})


def tuple_type(values: Iterable[Type]) -> Type:
    """Return the type of a tuple of values of these types."""
    return types.BaseTuple.from_types(tuple(values))
