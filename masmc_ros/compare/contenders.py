# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Contenders of a comparison: laws, each with its switching term if one is specified."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.robot.declaration import Mechanism


class Contender(NamedTuple):
    """A law, and the switching term that it has other than the scenario's; '' for that one."""

    law: str
    switching: str = ''

    @property
    def label(self) -> str:
        """Return how tables call it."""
        return f'{self.law}:{self.switching}' if self.switching else self.law

    @property
    def settings(self) -> tuple[str, ...]:
        """Return the settings that choose it."""
        chosen = (f'controller.law={self.law}',)
        return (*chosen, f'controller.switching={self.switching}') if self.switching else chosen


_ALL = 'all'

_BOTH = ('tanh', 'implicit')
"""Reaching terms with which all laws are compared: smooth, and the one that the sampling knows."""


def contenders(names: str, mechanism: Mechanism, own: str) -> tuple[Contender, ...]:
    """
    Return what `--laws` names: LAW or LAW:SWITCHING, separated by commas, or `all`.

    `all` is every law that a robot of this kind can have; those that ask for a reaching term have
    the scenario's `own`, and also `tanh` and `implicit`. Raises InputError for an unknown
    name, and for a law that is not of formulas or none for the robot.
    """
    if names == _ALL:
        return tuple(_every(mechanism, own))
    found = []
    for name in (each.strip() for each in names.split(',')):
        law, colon, switching = name.partition(':')
        if law not in registry.names():
            raise InputError(f"--laws: '{law}' is unknown; {suggestion(law, registry.names())}")
        if colon and switching not in registry.SWITCHING:
            hint = suggestion(switching, registry.SWITCHING)
            raise InputError(f"--laws: '{switching}' in '{name}' is unknown; {hint}")
        loaded = registry.load_for(law, mechanism)
        if not isinstance(loaded, Law):
            raise InputError(f"--laws: '{law}' is plain Python; expected laws of formulas")
        if colon and not loaded.uses_switching:
            raise InputError(f"--laws: '{name}': {law} asks for no reaching term; write {law}")
        found.append(Contender(law, switching))
    return tuple(dict.fromkeys(found))


def _every(mechanism: Mechanism, own: str) -> list[Contender]:
    found = []
    for name in registry.names():
        law = registry.load(name)
        if not isinstance(law, Law) or not law.fits(mechanism):
            continue
        found.append(Contender(name))
        if law.uses_switching:
            found += [Contender(name, switching) for switching in _BOTH if switching != own]
    return found
