# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Interface of a control law.

A control law is a `Law` object in a separate module. It declares gains and state variables, and
has one to three compiled functions (`@formula`):

    torque(settings, tick, memory) -> joint torques
    learn(settings, tick, memory, raw, torque)
    post_update(settings, memory)

In every control period the controller calls

1. `torque`, which returns the joint torques the law requests (`raw`);
2. `learn`, after the torque limits: `torque` is what is actually commanded. Adaptation and
   anti-windup belong here;
3. `post_update`, for parts with loops of unknown length, such as projections. It is also called
   after a change of parameters.

Arguments of these functions:

settings
    Values of the parameters, read-only: `settings.k_s1`.
tick
    `law.tick.Tick`: measured state, reference, sliding surface and regressor.
memory
    State of the law: `memory.estimate` reads a field, `memory.estimate = value` writes it.

The law declares its fields in two classes, which `law.fields` describes. A field is a number, or
a vector with one number per task axis, joint or inertial parameter. A law must not assume how
many of them a robot has. Reading a vector returns a copy; loops over rules and networks
use the array `in_place(memory, 'name')` of `jit.lanes`.

The functions of a law are selected at compile time, from the type of the records. A law that is
not in use costs nothing at run time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import SimpleNamespace

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.field import Field
from masmc_ros.law.declared import Declared
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.tick import Tick
from masmc_ros.mistakes import MistakeError
from masmc_ros.robot.declaration import Mechanism


@formula
def _no_learning(
    settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints
) -> None:
    """Do nothing; default of `Law.learn`."""


@formula
def _no_post_update(settings: Settings, memory: Memory) -> None:
    """Do nothing; default of `Law.post_update`."""


@dataclass(frozen=True)
class Law:
    """
    Definition of a control law.

    Attributes
    ----------
    name
        Value of the parameter `law` that selects it.
    torque
        Formula that computes the joint torques; see the module docstring.
    parameters
        Gains of this law: its class derived from `fields.Settings`, or declarations such as
        `(*Settings, SIGMA)`. Parameters of the model, of adaptation and of the torque limits
        are common to all laws and are not listed here.
    memory
        Its class derived from `fields.Memory`, or a tuple of fields.
    learn
        Formula called with the commanded torque. Default: no adaptation.
    post_update
        Formula called at the end of a tick and after parameter changes. Default: nothing.
    summary
        One-line description, shown by `masmc laws`.
    source
        Reference to the literature.
    uses_switching
        True if the law uses the reaching term selected by the parameter `switching`.
    most_parameters
        Largest supported number of base inertial parameters; None for no limit.

    """

    name: str
    torque: Callable[..., Joints]
    parameters: Iterable[Declared] = ()
    memory: Iterable[Field] = ()
    learn: Callable[..., None] = _no_learning
    post_update: Callable[..., None] = _no_post_update
    summary: str = ''
    source: str = ''
    uses_switching: bool = True
    most_parameters: int | None = None

    def __post_init__(self) -> None:
        """Read the declarations, and make the law available to compiled code under its name."""
        for name, kinds, expected in (
            ('parameters', Declared, 'a class derived from fields.Settings, or Parameter'),
            ('memory', Field, 'a class derived from fields.Memory, or Field'),
        ):
            declared = getattr(self, name)
            entries = (declared,) if type(declared) is type else tuple(declared)
            for entry in entries:
                if not isinstance(entry, kinds):
                    raise MistakeError(f'{self.name}: {name}: {entry}: expected {expected}')
            object.__setattr__(self, name, entries)
        _registered[self.name] = self

    def fits(self, mechanism: Mechanism) -> bool:
        """Return True if the law supports a robot of this type."""
        return self.most_parameters is None or len(mechanism.theta) <= self.most_parameters

    @property
    def formulas(self) -> SimpleNamespace:
        """Return the formulas by the names of the functions of this interface."""
        return SimpleNamespace(torque=self.torque, learn=self.learn, post_update=self.post_update)


_registered: dict[str, Law] = {}


_dispatch = interface(by_tag('law', lambda name: _registered[name.split(' ')[0]].formulas))


@_dispatch
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques requested by the law, a tuple in N·m."""


@_dispatch
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Update the state of the law: it requested `raw`, and `torque` is commanded (N·m)."""


@_dispatch
def post_update(settings: Settings, memory: Memory) -> None:
    """Complete the tick with loops of unknown length, such as projections."""
