# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of live parameters: an entry for each of what a mechanism has several of."""

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
        as `Parameter` has it.
    size
        what it has an entry for each of: 'axes', 'joints' or 'parameters'.
    default
        of every entry, or the name of what the mechanism has for it.
    description
        what it means; what the entries are of is said after it.
    unit
        SI unit or ''.
    note
        what is said last.
    is_positive
        whether 0 is out of range too.

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
    """Return declarations for a mechanism, each name once, in the order in which they come."""
    known: dict[str, Parameter] = {}
    for declaration in declarations:
        parameter = declaration.of(mechanism) if isinstance(declaration, PerEntry) else declaration
        known.setdefault(parameter.name, parameter)
    return tuple(known.values())
