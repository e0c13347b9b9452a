# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The contract of a control law: what a tick asks of it, and what it declares.

A law is one file: a `Law` with its parameters and its memory, and up to three formulas,

    torque(settings, tick, memory, lane) -> joints' torques that it asks for
    learn(settings, tick, memory, lane, raw, torque)   what was really commanded is known now
    post_update(settings, memory, lane)                what needs a loop, such as a projection

`tick` is the named tuple of `law.tick`. Parameters and memory are read by
`get(settings, 'k_s1', lane)` and written by `put(memory, 'estimate', lane, value)` under the
names that they are declared with, a dot in a name being an underscore: a number, or a tuple of
one number per axis, joint or parameter. Nothing here knows how many those are.

The law is chosen when a kernel is compiled, by the type of the records.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from masmc_ros.law.declared import Declared
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.dispatch import by_tag, interface
from masmc_ros.numerics.field import Field
from masmc_ros.robot.declaration import Mechanism


@formula
def _learns_nothing(
    settings: Any, tick: Any, memory: Any, lane: int, raw: Any, torque: Any
) -> None:
    """Leave the memory as it is."""


@formula
def _no_post_update(settings: Any, memory: Any, lane: int) -> None:
    """Leave the memory as it is."""


@dataclass(frozen=True)
class Law:
    """A control law."""

    name: str
    """As `law` names it."""
    torque: Callable[..., Any]
    """Formula of the torques."""
    parameters: tuple[Declared, ...] = ()
    """Its gains. Those of the model, of adaptation and of limits are every law's."""
    memory: tuple[Field, ...] = ()
    """Fields of its memory from tick to tick, those of its parts included."""
    learn: Callable[..., Any] = _learns_nothing
    post_update: Callable[..., Any] = _no_post_update
    summary: str = ''
    """Description in one line."""
    source: str = ''
    """Publication."""
    uses_switching: bool = True
    """Whether it asks for the reaching term that `switching` names."""
    most_parameters: int | None = None
    """Number of base inertial parameters of a robot that it can still reckon with."""

    def fits(self, mechanism: Mechanism) -> bool:
        """Return True if the law supports a robot of this type."""
        return self.most_parameters is None or len(mechanism.theta) <= self.most_parameters

    @property
    def formulas(self) -> SimpleNamespace:
        """Return the formulas by their names in the contract."""
        return SimpleNamespace(torque=self.torque, learn=self.learn, post_update=self.post_update)


_KNOWN: dict[str, Law] = {}


def register(law: Law) -> Law:
    """Make a law known to compiled code."""
    _KNOWN[law.name] = law
    return law


_of_law = interface(by_tag('law', lambda name: _KNOWN[name.split(' ')[0]].formulas))


@_of_law
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Any:
    """Return the joints' torques that the law asks for, a tuple in N m."""


@_of_law
def learn(settings: Any, tick: Tick, memory: Any, lane: int, raw: Any, torque: Any) -> None:
    """Take note of what was commanded, `torque`, where the law asked for `raw`."""


@_of_law
def post_update(settings: Any, memory: Any, lane: int) -> None:
    """Finish what has loops of unknown length."""
