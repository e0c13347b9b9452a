# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of live parameters of laws: one number, or one per axis, joint or parameter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from masmc_ros.aliases import Numbers
from masmc_ros.jit.field import Annotation, Declaration, ONE
from masmc_ros.mistakes import MistakeError
from masmc_ros.params.declaration import Bounds, Parameter, Values
from masmc_ros.robot.declaration import Mechanism

_PER_RADIAN = 0.1
"""Default of a gain in N for a task axis in rad, relative to an axis in m: a lever of 0.3 m."""


@dataclass(frozen=True)
class PerEntry:
    """
    A live parameter with an entry per task axis, joint or base parameter, or one for all.

    Attributes
    ----------
    name
        Name of the parameter.
    size
        Kind of its entries: 'axes', 'joints' or 'parameters'.
    default
        Default of every entry, or the name of the mechanism's default. Task axes in rad have a
        tenth of a gain in N, so rotations and translations have similar natural frequencies.
    description
        Meaning; the description of the entries is appended.
    unit
        SI unit or ''.
    note
        Last part of the description.
    is_positive
        True if 0 is out of range.

    """

    name: str
    size: str
    default: float | str
    description: str
    unit: str = ''
    note: str = ''
    is_positive: bool = False

    def _shares(self, mechanism: Mechanism) -> tuple[float, ...]:
        """Return the default of each entry relative to that of an axis in m."""
        if self.size != 'axes' or not self.unit.startswith('N'):
            return (1.0,) * mechanism.sizes[self.size]
        return tuple(_PER_RADIAN if axis.unit == 'rad' else 1.0 for axis in mechanism.axes)

    def of(self, values: Values) -> Numbers:
        """Return the value of this parameter among those of a node; KeyError if it is missing."""
        value: Numbers = values[self.name]
        return value

    def declared(self, mechanism: Mechanism) -> Parameter:
        """Return the declaration for a mechanism."""
        length = mechanism.sizes[self.size]
        default = (
            mechanism.default(self.default, self.size)
            if isinstance(self.default, str)
            else tuple(self.default * share for share in self._shares(mechanism))
        )
        return Parameter(
            self.name,
            default,
            f'{self.description}, {mechanism.entries[self.size]}{self.note}',
            unit=self.unit,
            length=length,
            size=self.size,
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=self.is_positive,
            read_only=False,
        )


Declared = Parameter | PerEntry
"""Declarations of a law, a reaching term or a part."""


def gain(
    default: float | str | tuple[float, ...],
    description: str,
    unit: str = '',
    *,
    note: str = '',
    is_positive: bool = False,
    **options: Any,
) -> Any:
    """
    Declare a parameter of a law in its class derived from `fields.Settings`.

    The annotation is the type that the law reads: `float` or `int` for a number (with bool for a
    switch, and text for one of `choices`), `Axes`, `Joints` or `Parameters` for a number per
    entry, `Numbers` for an array with as many numbers as the default.

    Parameters
    ----------
    default
        Default. With a number per entry it is that of every entry, or the name of the
        mechanism's default.
    description
        Meaning, one sentence without the unit.
    unit
        SI unit or ''.
    note
        Last part of the description of a parameter with a number per entry.
    is_positive
        True if 0 is out of range.
    options
        Further arguments of `Parameter`, such as `minimum` and `maximum`; the minimum is 0
        without them.

    """

    def build(name: str, annotation: Annotation) -> Declared:
        size, is_whole = annotation.size, annotation.kind == 'i8'
        if size in ('axes', 'joints', 'parameters'):
            if options:
                raise MistakeError(f'{name}: {", ".join(options)}: only for one number')
            if isinstance(default, tuple):
                raise MistakeError(f'{name} = {default}: expected one number for all {size}')
            bounds = Bounds(0.0, None, exclusive_minimum=is_positive, exclusive_maximum=False)
            if not isinstance(default, str) and not bounds.contain(default):
                raise MistakeError(f'{name} = {default}: expected a number {bounds}')
            return PerEntry(name, size, default, description, unit, note, is_positive)
        value = float(default) if type(default) is int and not is_whole else default
        if size not in (ONE, None) or (size is None and is_whole):
            raise MistakeError(f'{name}: expected float, int, Axes, Joints, Parameters or Numbers')
        kinds = (int, str) if is_whole else (float,) if size == ONE else (tuple,)
        if not isinstance(value, kinds):
            expected = ' or '.join(kind.__name__ for kind in kinds)
            raise MistakeError(f'{name} = {default!r}: expected {expected}, as annotated')
        limits = {} if isinstance(value, bool | str) else {'minimum': 0.0}
        return Parameter(
            name,
            value,
            description + note,
            unit,
            length=len(value) if isinstance(value, tuple) else None,
            exclusive_minimum=is_positive,
            read_only=False,
            **{**limits, **options},
        )

    return Declaration(build, '.')


def declared_for(
    mechanism: Mechanism, declarations: Iterable[Declared]
) -> tuple[Parameter, ...]:
    """Return the declarations for a mechanism in their order, without duplicate names."""
    known: dict[str, Parameter] = {}
    for declaration in declarations:
        parameter = (
            declaration.declared(mechanism) if isinstance(declaration, PerEntry) else declaration
        )
        known.setdefault(parameter.name, parameter)
    return tuple(known.values())
