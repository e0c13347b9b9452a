# SPDX-License-Identifier: Apache-2.0
"""All control laws by name: the built-in ones and those that users plug in."""

from __future__ import annotations

from masmc_ros.control.laws.plug_in import PlugInLaw
from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.plug_ins import load_plug_in, plugged_in

ENTRY_POINTS = 'masmc_ros.laws'
"""Group of entry points through which a user's own law plugs in."""


def names() -> tuple[str, ...]:
    """Names of all laws, built in and plugged in."""
    return (*BUILT_IN, *plugged_in(ENTRY_POINTS))


def load(name: str) -> type[PlugInLaw]:
    """Return the class of a plugged-in law; InputError where it cannot be loaded."""
    law: type[PlugInLaw] = load_plug_in(ENTRY_POINTS, 'law', name)
    return law


def parameters() -> tuple[Parameter, ...]:
    """Return the declarations of the parameters that plugged-in laws bring."""
    return tuple(p for name in plugged_in(ENTRY_POINTS) for p in load(name).parameters)
