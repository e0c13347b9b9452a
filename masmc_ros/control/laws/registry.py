# SPDX-License-Identifier: Apache-2.0
"""All control laws by name: the built-in ones and those that users plug in."""

from __future__ import annotations

from importlib.metadata import entry_points

from masmc_ros.control.laws.plug_in import PlugInLaw
from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter

ENTRY_POINTS = 'masmc_ros.laws'
"""Group of entry points through which a user's own law plugs in."""


def names() -> tuple[str, ...]:
    """Names of all laws, built in and plugged in."""
    return (*BUILT_IN, *plug_ins())


def plug_ins() -> tuple[str, ...]:
    """Names of the laws plugged in by installed packages."""
    return tuple(sorted(point.name for point in entry_points(group=ENTRY_POINTS)))


def load(name: str) -> type[PlugInLaw]:
    """Return the class of a plugged-in law; InputError where it cannot be loaded."""
    for point in entry_points(group=ENTRY_POINTS, name=name):
        try:
            found: type[PlugInLaw] = point.load()
        except Exception as error:
            raise InputError(f'law = {name}: {point.value} cannot be loaded: {error}') from error
        return found
    raise InputError(f'law = {name}: expected one of {", ".join(names())}')


def parameters() -> tuple[Parameter, ...]:
    """Return the declarations of the parameters that plugged-in laws bring."""
    return tuple(p for name in plug_ins() for p in load(name).parameters)
