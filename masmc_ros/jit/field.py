# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declaration of a field of a record; `record.py` has the records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math

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
