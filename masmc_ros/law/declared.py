# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of live parameters with one entry per axis, joint or base parameter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from masmc_ros.aliases import Numbers
from masmc_ros.params.declaration import Parameter, Values
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
