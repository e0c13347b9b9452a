# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
All mechanisms by name: those of this folder, and users' own.

A new one is a file or folder next to the others and one line here, or in a package of its own
an entry point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
from masmc_ros.robot.declaration import Mechanism, register, SPEED_LIMITS, URDF
from masmc_ros.robot.two_link.names import TWO_LINK

DEFAULT = TWO_LINK
"""The paper's robot."""

BUILT_IN = {mechanism.name: mechanism for mechanism in (TWO_LINK,)}

ENTRY_POINTS = 'masmc_ros.mechanisms'
"""Group of entry points through which a user's own mechanism plugs in."""

NAME = 'robot.mechanism'
"""Parameter of every node that needs the robot."""


def names() -> tuple[str, ...]:
    """Names of all mechanisms, built in and plugged in."""
    return (*BUILT_IN, *plugged_in(ENTRY_POINTS))


@cache
def load(name: str) -> Mechanism:
    """Return a mechanism; InputError where a plugged-in one cannot be loaded."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    mechanism = load_plug_in(ENTRY_POINTS, NAME, name)
    if not isinstance(mechanism, Mechanism) or mechanism.name != name:
        name_of_plug_in = getattr(mechanism, 'name', mechanism)
        raise InputError(
            f'{NAME} = {name}: found {name_of_plug_in}, expected a Mechanism of this name'
        )
    return register(mechanism)


def mechanism_from(values: Mapping[str, Any]) -> Mechanism:
    """
    Return the mechanism that values name, checked or not; the default one for no known name.

    Where they have a URDF, it is that robot; where they have speed limits, it has those. Raises
    InputError for what is no robot.
    """
    urdf = values.get(URDF)
    if isinstance(urdf, str) and urdf:
        # Only who has such a robot waits for its formulas.
        from masmc_ros.robot.tree.tree_mechanism import tree_mechanism

        return tree_mechanism(values)
    name = values.get(NAME)
    mechanism = load(name) if isinstance(name, str) and name in names() else DEFAULT
    settings: Any = SPEED_LIMITS.check(values.get(SPEED_LIMITS.name, ()))
    return _limited(mechanism, settings) if settings else mechanism


@lru_cache(maxsize=16)
def _limited(mechanism: Mechanism, settings: tuple[str, ...]) -> Mechanism:
    """Return a mechanism with speed limits of its joints, the same one for the same limits."""
    limited = replace(mechanism, speed_settings=settings)
    # An unknown joint is found now, not when a limit is first asked for.
    assert len(limited.speed_limits) == len(limited.joints)
    return limited


def parameters() -> tuple[Parameter, ...]:
    """Return the declarations of what chooses among them."""
    return (
        Parameter(
            NAME,
            DEFAULT.name,
            'Type of robot; each type has its own robot parameters',
            choices=names(),
        ),
        Parameter(URDF, '', 'URDF file, or its text: any robot, in place of the built-in types'),
        SPEED_LIMITS,
    )
