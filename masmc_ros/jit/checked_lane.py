# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of formulas that run in plain Python: names and sizes of fields, and decorators."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
import dis
from types import CodeType, FunctionType

from masmc_ros.aliases import AnyArray, Record
from masmc_ros.errors import suggestion
from masmc_ros.jit.compiled import Formula, is_interpreted, machine_code
from masmc_ros.jit.generated import is_generated
from masmc_ros.jit.lanes import Lane
from masmc_ros.mistakes import MistakeError
import numpy as np
from numpy.typing import ArrayLike


class CheckedLane(Lane):
    """Lane that checks names and sizes, and that nothing is written into settings."""

    __slots__ = ('_is_writable', '_name')

    def __init__(self, record: Record, name: str, *, is_writable: bool = False) -> None:
        """
        Initialise the first lane of a record.

        Parameters
        ----------
        record
            Entry of an array of records.
        name
            Name of the argument in formulas.
        is_writable
            True if formulas may write its fields.

        """
        super().__init__(record, 0)
        object.__setattr__(self, '_name', name)
        object.__setattr__(self, '_is_writable', is_writable)

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        """Write a field; raise MistakeError for another size or kind."""
        shape = self._values(name).shape
        if not self._is_writable:
            raise MistakeError(
                f'{self._name}.{name} is read-only; expected a field of the memory of the law'
            )
        if np.shape(value) != shape:
            raise MistakeError(
                f'{self._name}.{name} = {text_of(value)}: expected {_vector(*shape)}'
            )
        is_whole = self.dtype[name].base.kind == 'i'
        if is_whole and np.asarray(value).dtype.kind == 'f':
            raise MistakeError(f'{self._name}.{name} = {text_of(value)}: expected a whole number')
        super().__setattr__(name, value)

    def _values(self, name: str) -> AnyArray:
        known = [field for field in self.dtype.names if field.isidentifier()]
        if name not in known:
            raise MistakeError(f'{self._name} has no {name!r}: {suggestion(name, known)}')
        return super()._values(name)


def run_dry_once(run: Callable[[], None], sources: Iterable[str], *contents: str) -> None:
    """
    Call a dry run, unless it has succeeded before in these sources on this machine.

    Arguments after `run` are those of `machine_code`. Without a compiler there is no dry run: the
    interpreter reports mistakes with a traceback, and a debugger can stop there.
    """
    if is_interpreted():
        return
    note = machine_code('dry', sources, *contents)
    if not note.exists():
        run()
        with suppress(OSError):
            note.touch()


def check_vector(name: str, value: object, count: int, *, per: str) -> None:
    """Raise MistakeError unless a result is a vector of `count` numbers, one per `per`."""
    entries = value if isinstance(value, tuple) else ()
    if len(entries) != count or any(np.ndim(entry) for entry in entries):
        raise MistakeError(f'{name} returns {text_of(value)}: expected {_vector(count)}, {per}')


def _vector(count: int | None = None) -> str:
    return 'one number' if count is None else f'a vector of {count} numbers'


def text_of(value: object) -> str:
    """Return a description of a value."""
    if value is None:
        return 'nothing'
    if isinstance(value, tuple | list | np.ndarray):
        return f'a {type(value).__name__} of {len(value)}'
    return f'{type(value).__name__} {value}'


def function_of(formula: object) -> FunctionType:
    """Return the function in plain Python of a formula."""
    function = getattr(formula, 'py_func', formula)
    assert isinstance(function, FunctionType)
    return function


def check_decorators(formulas: Iterable[object], files: Collection[str]) -> None:
    """
    Raise MistakeError if formulas use a function of these files without decorator.

    Without a compiler, decorators return the function, and any function can be called.
    """
    if is_interpreted():
        return
    known: set[FunctionType] = set()
    for formula in formulas:
        _check_decorators(function_of(formula), files, known)


def _check_decorators(
    function: FunctionType, files: Collection[str], known: set[FunctionType]
) -> None:
    if function in known or function.__code__.co_filename not in files:
        return
    known.add(function)
    for name, line in _globals_of(function.__code__):
        value = function.__globals__.get(name)
        if isinstance(value, Formula):
            _check_decorators(function_of(value), files, known)
        elif isinstance(value, FunctionType) and not is_generated(value):
            raise MistakeError(
                f'{function.__code__.co_filename}:{line}: {name} is an ordinary function; '
                'expected a function with @formula'
            )


def _globals_of(code: CodeType) -> Iterator[tuple[str, int]]:
    """Yield the global names in a code, with their lines."""
    line = code.co_firstlineno
    for instruction in dis.get_instructions(code):
        line = instruction.starts_line or line
        if instruction.opname == 'LOAD_GLOBAL':
            yield str(instruction.argval), int(line)
