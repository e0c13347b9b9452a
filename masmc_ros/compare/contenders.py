# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Contenders of a comparison: laws, each with its switching term if one is specified."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.reaching.implicit import IMPLICIT, OBSERVER_GAIN
from masmc_ros.law.registry import SWITCHING_TERM
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.labels import OBSERVER
from masmc_ros.robot.declaration import Mechanism


class Contender(NamedTuple):
    """
    A law with its switching term; empty: that of the scenario.

    `observes` is true if it estimates the disturbance, which laws with a reaching term lack.
    """

    law: str
    switching: str = ''
    observes: bool = False

    @property
    def label(self) -> str:
        """Return the name in tables."""
        name = f'{self.law}:{self.switching}' if self.switching else self.law
        return f'{name}{OBSERVER}' if self.observes else name

    @property
    def settings(self) -> tuple[str, ...]:
        """Return the settings that select it."""
        chosen = (f'controller.law={self.law}',)
        return (*chosen, f'controller.switching={self.switching}') if self.switching else chosen

    @property
    def is_plain(self) -> bool:
        """Return True for plain Python: no lanes, and torques of all joints only."""
        return not isinstance(registry.load(self.law), Law)


_ALL = 'all'

_BOTH = ('tanh', 'implicit')
"""Reaching terms of all laws in comparisons: a smooth and a sampled one."""


def contenders(names: str, mechanism: Mechanism, own: str) -> tuple[Contender, ...]:
    """
    Return the contenders of `--laws`: LAW or LAW:SWITCHING, separated by commas, or `all`.

    `all` is every law for this kind of robot except an earlier one by another name; laws with a
    reaching term have that of the scenario, `own`, and also `tanh` and `implicit`. Laws in plain
    Python are selected by name only. Raises InputError for an unknown name, and for a law that is
    not suitable for the robot.
    """
    if names == _ALL:
        return tuple(_every(mechanism, own))
    selected = []
    for name in map(str.strip, names.split(',')):
        law, colon, switching = name.partition(':')
        if law not in registry.names():
            raise InputError(f"--laws: '{law}' is unknown; {suggestion(law, registry.names())}")
        if colon and switching not in registry.SWITCHING:
            hint = suggestion(switching, registry.SWITCHING)
            raise InputError(f"--laws: '{switching}' in '{name}' is unknown; {hint}")
        registry.load_for(law, mechanism)
        if colon and not registry.uses_switching(law):
            raise InputError(f"--laws: '{name}': {law} has no reaching term; write {law}")
        selected.append(Contender(law, switching))
    return tuple(dict.fromkeys(selected))


def marked(chosen: Iterable[Contender], controller: Values) -> tuple[Contender, ...]:
    """Return contenders whose names show the estimate that a controller's values switch on."""
    has_gain, own = OBSERVER_GAIN.of(controller) > 0.0, SWITCHING_TERM.of(controller)
    return tuple(
        contender._replace(observes=has_gain and _is_implicit(contender, own))
        for contender in chosen
    )


def _is_implicit(contender: Contender, own: str) -> bool:
    is_switched = registry.uses_switching(contender.law)
    return is_switched and (contender.switching or own) == IMPLICIT.name


def _every(mechanism: Mechanism, own: str) -> list[Contender]:
    every, known = [], []
    for name in registry.names():
        law = registry.load(name)
        if not isinstance(law, Law) or not law.fits(mechanism) or law.formulas in known:
            continue
        known.append(law.formulas)
        every.append(Contender(name))
        if law.uses_switching:
            every += [Contender(name, switching) for switching in _BOTH if switching != own]
    return every
