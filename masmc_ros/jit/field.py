# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Declarations of the fields of records; `record.py` has the records.

A class derived from `Fields` declares each of its fields once:

    class Memory(Fields):
        drift: Joints = field('Estimated drift', '1/s²')
        ticks: int = field('Number of ticks')

The annotation is the size and the type of numbers. Editors and mypy read it as the type of the
attribute of a lane, and `*Memory` has the declarations for a record. No class has instances:
compiled functions get a lane of a record (`lanes.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
import inspect
import math
import sys
from typing import Any

from masmc_ros.errors import suggestion, UserError
from masmc_ros.mistakes import MistakeError
from masmc_ros.params.declaration import Parameter

ONE = ''
"""Size of a field that is one number."""

_KINDS = {'bool': 'i8', 'integer': 'i8', 'double': 'f8', 'doubles': 'f8'}

_CHOSEN_WHEN_COMPILED = ('law', 'switching', 'command_interface', 'joint_limits')


@dataclass(frozen=True)
class Field:
    """Declaration of a field of a record."""

    name: str
    size: str | int | tuple[str | int, ...] = ONE
    """
    Name of the number of components, or that number; ONE for a single number.

    Several sizes make a product: ('axes', 9) has nine components per axis, first those of the
    first axis.
    """
    description: str = ''
    unit: str = ''
    kind: str = 'f8'
    """NumPy type code of a component: f8 or i8."""
    initial: float = 0.0
    """
    Value of every component in a new record.

    In the memory of a law, a field with the initial value NaN refers to the previous tick. The
    controller sets it to NaN again if that tick is unknown (`loop.controller`).
    """

    def count(self, sizes: Mapping[str, int]) -> int:
        """Return the number of components for named sizes."""
        if isinstance(self.size, tuple):
            return math.prod(_number(part, sizes) for part in self.size)
        return _number(self.size, sizes)


def _number(size: str | int, sizes: Mapping[str, int]) -> int:
    if isinstance(size, int):
        return size
    return 1 if size == ONE else sizes[size]


def field_of(parameter: Parameter) -> Field | None:
    """
    Return the field from which compiled code reads a parameter; None if it does not read it.

    The field of a choice holds its index among the choices.
    """
    if parameter.name in _CHOSEN_WHEN_COMPILED:
        return None
    kind = _KINDS.get(parameter.kind)
    if parameter.kind == 'string' and parameter.choices and not callable(parameter.choices):
        kind = 'i8'
    if kind is None:
        return None
    size: str | int = parameter.size or parameter.length or ONE
    name = parameter.name.replace('.', '_')
    return Field(name, size, parameter.description, parameter.unit, kind)


@dataclass(frozen=True)
class Annotation:
    """Size and type of numbers of a field, from its annotation."""

    size: str | None
    """Name of the size; None if the annotation is a vector of any length."""
    kind: str = 'f8'
    """NumPy type code of a component."""


_ANNOTATIONS = {
    'float': Annotation(ONE),
    'int': Annotation(ONE, 'i8'),
    'Axes': Annotation('axes'),
    'Joints': Annotation('joints'),
    'Parameters': Annotation('parameters'),
    'Positions': Annotation('positions'),
    'BasePose': Annotation('base'),
    'Numbers': Annotation(None),
    'tuple[float, ...]': Annotation(None),
    'tuple[int, ...]': Annotation(None, 'i8'),
}
"""Annotations by their texts in source files; `aliases.py` has the names."""


class Declaration:
    """Declaration without the name and the annotation, which the class of the field adds."""

    def __init__(self, build: Callable[[str, Annotation], object], prefix: str = '') -> None:
        """
        Initialise a declaration in the line that calls the caller.

        Parameters
        ----------
        build
            Function from name and annotation to the declaration. It may raise MistakeError.
        prefix
            Character between the group of a class and the other part of the name.

        """
        frame = sys._getframe(2)
        self._build = build
        self._file, self._line = frame.f_code.co_filename, frame.f_lineno
        self._prefix = prefix

    def named(self, name: str, annotation: object, group: str) -> object:
        """
        Return the declaration of a field.

        Parameters
        ----------
        name
            Name of the field.
        annotation
            Its annotation, a text or a type; None without one.
        group
            First part of the names of the class, '' without one.

        Raises
        ------
        MistakeError
            With the line of the declaration.

        """
        text = _text_of(annotation)
        try:
            if annotation is None:
                raise MistakeError(f'{name}: expected an annotation such as Axes')
            if text not in _ANNOTATIONS:
                hint = suggestion(text, _ANNOTATIONS)
                raise MistakeError(f'{name}: {text}: expected a type of fields; {hint}')
            if self._prefix and group:
                if not name.startswith(f'{group}_'):
                    raise MistakeError(f'{name}: expected a name that starts with {group}_')
                name = group + self._prefix + name.removeprefix(f'{group}_')
            return self._build(name, _ANNOTATIONS[text])
        except (MistakeError, UserError) as error:
            raise MistakeError(str(error), self._file, self._line) from None


def _text_of(annotation: object) -> str:
    """Return the text of an annotation in a source file, without the name of a module."""
    if isinstance(annotation, str):
        return annotation if '[' in annotation else annotation.rpartition('.')[2]
    for size in getattr(annotation, '__metadata__', ()):
        return next((name for name, kind in _ANNOTATIONS.items() if kind.size == size), str(size))
    return annotation.__name__ if type(annotation) is type else str(annotation)


def field(
    description: str,
    unit: str = '',
    *,
    size: str | int | tuple[str | int, ...] = ONE,
    initial: float = 0.0,
) -> Any:
    """
    Declare a field in a class derived from `Fields`.

    Parameters
    ----------
    description
        Meaning of the field.
    unit
        SI unit or ''.
    size
        Size of a field with the annotation `Numbers` or `tuple[int, ...]`, as in `Field`.
    initial
        Initial value of every component, as in `Field`.

    """

    def build(name: str, annotation: Annotation) -> Field:
        if (annotation.size is None) == (size == ONE):
            raise MistakeError(
                f'{name}: expected Numbers = field(..., size=...) or a type with a size, '
                'such as Axes, without it'
            )
        own = size if annotation.size is None else annotation.size
        return Field(name, own, description, unit, annotation.kind, initial)

    return Declaration(build)


class _Iterable(type):
    """Class whose iteration yields declarations."""

    _declared: tuple[Any, ...] = ()
    _is_shared = False

    def __iter__(cls) -> Iterator[Any]:
        """Yield the declarations of its bases, the last one first, then its own; see `Fields`."""
        return iter(cls._declared)


class Fields(metaclass=_Iterable):
    """
    Base of classes that declare fields; iteration over them yields the declarations.

    Fields that every record has are declared by a class with `is_shared`. Iteration over classes
    derived from it skips them.
    """

    def __init_subclass__(cls, *, group: str = '', is_shared: bool = False) -> None:
        """
        Collect the declarations of a class.

        Parameters
        ----------
        group
            First part of the names of parameters: k_1 of the group `pid` is the field `pid_k_1`,
            and the parameter `pid.k_1`.
        is_shared
            True if every record has the fields.

        """
        super().__init_subclass__()
        annotations = inspect.get_annotations(cls)
        values = {name: vars(cls).get(name) for name in annotations} | {
            name: value for name, value in vars(cls).items() if isinstance(value, Declaration)
        }
        inherited = {
            declared.name: declared
            for base in reversed(cls.__bases__)
            if isinstance(base, _Iterable) and not base._is_shared
            for declared in base
        }
        own = []
        for name, value in values.items():
            if not isinstance(value, Declaration):
                text = '' if value is None else f' = {value}'
                raise MistakeError(f'{name}{text}: expected gain(...) or field(...)')
            own.append(value.named(name, annotations.get(name), group))
            setattr(cls, name, own[-1])
        cls._declared = (*inherited.values(), *own)
        cls._is_shared = is_shared
