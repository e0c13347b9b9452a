# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled code that a controller needs for its law: kernels with examples of their arguments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from masmc_ros.aliases import AnyArray, Function
from masmc_ros.jit.compiled import bound, is_loaded, is_on_disk, is_whole_on_disk, machine_code
from masmc_ros.jit.sources import files_of
from masmc_ros.law import registry
from masmc_ros.law.command_interface import is_hybrid, takes_rates
from masmc_ros.law.law import Law
from masmc_ros.law.parts.delay_fields import ENABLING
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.law.smc import SMC
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import (
    control_tick,
    estimate_velocity,
    limit_torque,
    post_update,
    predict_state,
    reduce_torque,
)
from masmc_ros.loop.dense import arrays_of, dense
from masmc_ros.loop.law_dry_run import check
from masmc_ros.loop.signals import inputs
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Mechanism

CHOOSES_CODE = ('law', 'switching', *ENABLING)
"""Live parameters that require other compiled code."""

_Call = tuple[Function, tuple[AnyArray, ...]]
"""Kernel with its arguments."""


class Code(NamedTuple):
    """Compiled code of one law with one switching term."""

    name: tuple[str, str, bool]
    """Names of the law and of the switching term, empty for a law without it; compensated."""
    calls: tuple[_Call, ...]
    """Kernels, each with example arguments of the required types."""

    @property
    def is_loaded(self) -> bool:
        """Return True if this process can compute a tick without compiling or loading."""
        return all(is_loaded(kernel, *arguments) for kernel, arguments in self.calls)

    @property
    def is_on_disk(self) -> bool:
        """Return True if the disk has a file for each kernel; a file may be damaged."""
        return all(is_on_disk(kernel, *arguments) for kernel, arguments in self._to_load)

    @property
    def is_whole_on_disk(self) -> bool:
        """Return True if loading compiles nothing; reads the files to check them."""
        return all(is_whole_on_disk(kernel, *arguments) for kernel, arguments in self._to_load)

    @property
    def _to_load(self) -> Iterator[_Call]:
        return (call for call in self.calls if not is_loaded(call[0], *call[1]))

    def load(self) -> None:
        """Load the code, and compile missing kernels."""
        for kernel, arguments in self.calls:
            bound(kernel, *arguments)


def code_of_law(
    mechanism: Mechanism,
    law: Law,
    switching: str,
    *,
    is_hybrid: bool = False,
    compensated: bool = False,
    limited: bool = False,
) -> Code:
    """Return the code of a compiled law for a type of robot."""
    signals = records.signals(mechanism)
    memory = records.law_memory(mechanism, law, compensated=compensated, limited=limited)
    settings = records.law_settings(
        mechanism,
        law,
        switching,
        is_hybrid=is_hybrid,
        compensated=compensated,
        limited=limited,
    )
    return Code(
        (law.name, switching if law.uses_switching else '', compensated),
        (
            (control_tick, (settings, memory, signals, *inputs(signals))),
            # Called when a parameter changes while a projection is active.
            (post_update, (settings, memory)),
        ),
    )


def code_of_plain_law(
    mechanism: Mechanism,
    name: str,
    switching: str,
    *,
    compensated: bool = False,
    limited: bool = False,
) -> Code:
    """Return the code around a user law in plain Python for a type of robot."""
    signals = records.signals(mechanism)
    memory = records.law_memory(mechanism, SMC, compensated=compensated, limited=limited)
    settings = records.law_settings(
        mechanism, SMC, switching, compensated=compensated, limited=limited
    )
    before: tuple[_Call, ...] = (
        (estimate_velocity, (settings, memory, signals)),
    )
    if compensated:
        before = (
            (predict_state, (settings, memory, signals, signals)),
            (reduce_torque, (settings, memory, signals, signals)),
        )
    return Code(
        (name, switching, compensated),
        (
            *before,
            (dense, (settings, signals, *arrays_of(settings, signals))),
            (limit_torque, (settings, memory, signals)),
        ),
    )


def code_for(mechanism: Mechanism, values: Values) -> Code:
    """Return the code required by a controller with these parameter values."""
    compensated = records.is_compensated(values)
    if takes_rates(values):
        return code_of_law(mechanism, registry.OF_RATES, SWITCHING_TERM.of(values))
    limited = records.is_limited(values, mechanism)
    law = registry.load_for(LAW.of(values), mechanism)
    if isinstance(law, Law):
        return code_of_law(
            mechanism,
            law,
            SWITCHING_TERM.of(values),
            is_hybrid=is_hybrid(values),
            compensated=compensated,
            limited=limited,
        )
    return code_of_plain_law(
        mechanism, LAW.of(values), SWITCHING_TERM.of(values), compensated=compensated,
        limited=limited,
    )


def fitting(mechanism: Mechanism) -> tuple[Law, ...]:
    """Return the compiled laws that support a type of robot."""
    return tuple(law for law in laws() if law.fits(mechanism))


def laws() -> tuple[Law, ...]:
    """Return all compiled laws, including user laws."""
    loaded = (registry.load(name) for name in registry.names())
    return tuple(law for law in loaded if isinstance(law, Law))


def laws_loaded_at_start() -> tuple[Law, ...]:
    """Return the laws of the paper and of users, which a controller loads while it starts."""
    others = set(registry.LAWS) - {SMC.name, RASMC.name}
    return tuple(law for law in laws() if law.name not in others)


def plain_laws() -> tuple[str, ...]:
    """Return the names of user laws in plain Python."""
    return tuple(name for name in registry.names() if not isinstance(registry.load(name), Law))


def load(mechanism: Mechanism, which: Iterable[Law]) -> None:
    """
    Load the code of laws with all switching terms; compile it if it is not on the disk.

    If a user law in plain Python is installed, this includes the code around it.
    """
    for law in which:
        for switching in registry.SWITCHING if law.uses_switching else ('',):
            check(law, mechanism, switching)
            code_of_law(mechanism, law, switching).load()
    # All laws in plain Python have the same code around them.
    for name in plain_laws()[:1]:
        for switching in registry.SWITCHING:
            code_of_plain_law(mechanism, name, switching).load()


def mark(mechanism: Mechanism) -> Path:
    """Return the marker file of the compiled kernels of these laws on this machine."""
    name = f'prepared-{mechanism.tag}'.replace(' ', '-')
    plain = ('plain',) if plain_laws() else ()
    sources = {__file__, *files_of(mechanism.formulas)}
    for law in laws():
        sources |= files_of(law.formulas)
    return machine_code(name, sources, *map(records.law_tag, laws()), *plain)
