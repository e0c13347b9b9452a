# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Functions of an interface; the type of the first argument selects the formula.

An interface (of mechanisms, laws or reaching terms) declares the names, arguments and results of
functions. An implementation is an object with formulas of these names. The compiler selects it by
the class of a named tuple, or by a tag in the type of a record. The selection costs nothing at run
time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, cast

from masmc_ros.aliases import AnyFunction, Function
from masmc_ros.jit.generated import (
    called,
    Compiler,
    generated,
    IrValue,
    IrValues,
    Type,
    Types,
    TypingContext,
)
from masmc_ros.jit.lanes import LaneType
from masmc_ros.jit.record import tag_of
from masmc_ros.jit.sources import SELECTED_BY_CLASS, SELECTED_BY_TAG
from numba import types

Finder = Callable[[Any], object]


def by_class(find: Callable[[type], object]) -> Finder:
    """Return a selection by the class of a named tuple; `find` maps a class to its formulas."""
    SELECTED_BY_CLASS.append(find)

    def choose(first: Any) -> object:
        is_type = isinstance(first, types.Type)
        return find(first.instance_class if is_type else type(first))

    return choose


def by_tag(name: str, find: Callable[[str], object]) -> Finder:
    """Return a selection by the tag `name` of a lane's record; `find` maps it to its formulas."""
    SELECTED_BY_TAG[name] = find

    def choose(first: Any) -> object:
        return find(tag_of(first.record if isinstance(first, LaneType) else first.dtype, name))

    return choose


def interface(
    choose: Finder, default: Callable[[Function], Function] | None = None
) -> Callable[[AnyFunction], AnyFunction]:
    """
    Decorate a function, which calls the formula of its name.

    With `default`, a decorator such as `formula`, its body is the formula for implementations
    without this name. Otherwise it has no body, and every implementation has the name.
    """

    def decorate(stub: AnyFunction) -> AnyFunction:
        name, defaults = stub.__name__, () if default is None else (default(stub),)

        def formula_of(first: object) -> Function:
            formula: Function = getattr(choose(first), name, *defaults)
            return formula

        @wraps(stub)
        def plain(*arguments: object) -> object:
            return formula_of(arguments[0])(*arguments)

        plain.__dict__['has_default'] = bool(defaults)

        def target(context: TypingContext, kinds: Types) -> types.Type:
            return context.resolve_value_type(formula_of(kinds[0]))

        def result(context: TypingContext, *kinds: Type) -> types.Type:
            return_type: types.Type = called(context, target(context, kinds), kinds).return_type
            return return_type

        @generated(plain, result)
        def write(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
            of_call = target(compiler.context.typing_context, kinds)
            return compiler.call(of_call, compiler.result, kinds, values)

        return cast(AnyFunction, plain)

    return decorate
