# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of live parameters with one entry per axis, joint or base parameter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import Mechanism


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
        Default of every entry, or the name of the mechanism's default.
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

    def of(self, mechanism: Mechanism) -> Parameter:
        """Return the declaration for a mechanism."""
        length = mechanism.sizes[self.size]
        default = (
            mechanism.default(self.default, self.size)
            if isinstance(self.default, str)
            else (self.default,) * length
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
        parameter = declaration.of(mechanism) if isinstance(declaration, PerEntry) else declaration
        known.setdefault(parameter.name, parameter)
    return tuple(known.values())
