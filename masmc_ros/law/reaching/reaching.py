# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interface of a reaching term: u(s) in N, and its correction for torque limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.field import Field
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.declared import Declared, PerEntry
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.tick import Tick
from masmc_ros.params.declaration import Parameter

K_S1 = PerEntry('k_s1', 'axes', 100.0, 'Gain K_s1 of the linear reaching term', 'N·s/m')

K_S2 = PerEntry('k_s2', 'axes', 100.0, 'Gain K_s2 of the switching term', 'N')

GAINS = (K_S1, K_S2)
"""Settings of every reaching term."""

BOUNDARY_LAYER = Parameter(
    'boundary_layer',
    0.2,
    'Thickness delta of the boundary layer of the smooth approximations',
    unit='m/s',
    minimum=0.0,
    exclusive_minimum=True,
    read_only=False,
)
"""Additional settings of the smooth terms."""


@formula
def _nothing_to_correct(
    settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints
) -> None:
    """Do nothing; default of `Reaching.correct`."""


@dataclass(frozen=True)
class Reaching:
    """Reaching term; `switching` selects it by name."""

    name: str
    reach: Callable[..., Axes]
    """(settings, tick, memory) -> u, a tuple in N."""
    correct: Callable[..., None] = _nothing_to_correct
    """(settings, tick, memory, raw, torque): the law requested `raw`, `torque` is held."""
    parameters: tuple[Declared, ...] = GAINS
    memory: tuple[Field, ...] = ()

    def __post_init__(self) -> None:
        """Make the term available to compiled code under its name."""
        _KNOWN[self.name] = self

    @property
    def formulas(self) -> SimpleNamespace:
        """Return the formulas by the names of the functions of this interface."""
        return SimpleNamespace(reach=self.reach, correct=self.correct)


_KNOWN: dict[str, Reaching] = {}

SHORTCUT = '_shortcut'
"""
End of the name of a term that is valid for the common case only, and is no choice of `switching`.

It has no branches, so lanes vectorise. It counts other cases in `needs_full` of the memory, and
the tick of such a lane is computed again with the full term: `loop.control.control_by_shortcut`.
"""

def shortcut_of(name: str) -> str:
    """Return the name of the shortcut of a term; '' without one."""
    return name + SHORTCUT if name + SHORTCUT in _KNOWN else ''


_of_term = interface(by_tag('switching', lambda name: _KNOWN[name].formulas))


@_of_term
def reach(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the reaching force u on the task's axes in N."""


@_of_term
def correct(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Account for the held `torque`; the law requested `raw`."""


@formula
def reaching_force(s: float, k_s1: float, k_s2: float, switched: float) -> float:
    """Return -K_s1 s - K_s2 sw(s) of (15) on one axis."""
    return -k_s1 * s - k_s2 * switched


@formula
def force_of(settings: Settings, tick: Tick, switched: Axes) -> Axes:
    """Return the reaching force of an explicit term from sw(s) on every axis."""
    return elementwise(reaching_force, tick.surface, settings.k_s1, settings.k_s2, switched)
