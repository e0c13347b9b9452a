# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Mechanisms by name, those of this folder and plug-ins, and their names of joints and frames.

A new one needs a file or folder next to the others and one line here, or an entry point in a
separate package.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import copyreg
from dataclasses import replace
from functools import cache, lru_cache, partial
from typing import cast

from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
from masmc_ros.robot.declaration import check_points, Mechanism, register, SPEED_LIMITS, URDF
from masmc_ros.robot.two_link.paper_robot import TWO_LINK

DEFAULT = TWO_LINK
"""Robot of the paper."""

BUILT_IN = {mechanism.name: mechanism for mechanism in (TWO_LINK,)}

ENTRY_POINTS = 'masmc_ros.mechanisms'
"""Group of entry points of plug-in mechanisms."""

NAME = 'robot.mechanism'
"""Parameter of every node that needs the robot."""


def names() -> tuple[str, ...]:
    """Return the names of all mechanisms, built in and plugged in."""
    return (*BUILT_IN, *plugged_in(ENTRY_POINTS))


@cache
def load(name: str) -> Mechanism:
    """Return a mechanism; raise InputError if a plug-in cannot be loaded."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    mechanism = load_plug_in(ENTRY_POINTS, NAME, name)
    if not isinstance(mechanism, Mechanism) or mechanism.name != name:
        name_of_plug_in = getattr(mechanism, 'name', mechanism)
        raise InputError(
            f'{NAME} = {name}: found {name_of_plug_in}, expected a Mechanism of this name'
        )
    check_points(mechanism)
    return register(mechanism)


def mechanism_from(values: Values) -> Mechanism:
    """
    Return the mechanism selected by values, checked or not; the default for an unknown name.

    A URDF in the values has priority, and speed limits apply to it. Raises InputError for an
    invalid robot.
    """
    urdf = values.get(URDF)
    if isinstance(urdf, str) and urdf:
        # The import takes time, so it happens only for such robots.
        from masmc_ros.robot.tree.tree_mechanism import tree_mechanism

        return tree_mechanism(values)
    name = values.get(NAME)
    mechanism = load(name) if isinstance(name, str) and name in names() else DEFAULT
    checked = SPEED_LIMITS.check(values.get(SPEED_LIMITS.name, ()))
    settings = cast(tuple[str, ...], checked)
    return _limited(mechanism, settings) if settings else mechanism


def _pickled(mechanism: Mechanism) -> tuple[Callable[..., Mechanism], tuple[Values]]:
    return mechanism_from, (mechanism.choice,)


# Formulas are modules or bound methods; copies and other processes have the same object.
copyreg.pickle(Mechanism, _pickled)


@lru_cache(maxsize=16)
def _limited(mechanism: Mechanism, settings: tuple[str, ...]) -> Mechanism:
    """Return a mechanism with speed limits of its joints; the same object for equal limits."""
    limited = replace(mechanism, speed_settings=settings)
    # This raises the error of an unknown joint now, instead of at the first use of a limit.
    assert len(limited.speed_limits) == len(limited.joints)
    return limited


def parameters() -> tuple[Parameter, ...]:
    """Return the declarations of the parameters that select a mechanism."""
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


JOINT_NAMES_PARAMETER = 'robot.joint_names'


def all_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the joints' own names in the order of a joint state."""
    return tuple(joint.name for joint in mechanism.positions)


def joint_names(values: Values) -> tuple[str, ...]:
    """
    Return the names of the joints in the order of a joint state, from checked values.

    Joints that the values do not rename keep their names.
    """
    return joint_names_of(mechanism_from(values), values.get(JOINT_NAMES_PARAMETER, ()))


def driven_joint_names(values: Values) -> tuple[str, ...]:
    """Return the names of the joints that take torques, by checked values."""
    return joint_names(values)[len(mechanism_from(values).base):]


def joint_names_of(mechanism: Mechanism, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the joint names with `names` for the last joints of a mechanism."""
    own = all_joints(mechanism)
    return (*own[:len(own) - len(names)], *names)


def _are_joint_names(mechanism: Mechanism, names: Sequence[str]) -> bool:
    """Return True if a robot may have joints of these names: all of them, or the driven ones."""
    whole = joint_names_of(mechanism, names)
    taken = {*whole, *mechanism.fixed_joints}
    return (
        len(names) in (len(mechanism.positions), len(mechanism.joints))
        and len(taken) == len(mechanism.positions) + len(mechanism.fixed_joints)
        and all(name and name.isprintable() and name == name.strip() for name in whole)
    )


def joint_names_parameter(mechanism: Mechanism) -> Parameter:
    """Return the declaration of every node that knows joints by name."""
    base = ', '.join(coordinate.short for coordinate in mechanism.base)
    driven = len(mechanism.joints)
    return Parameter(
        JOINT_NAMES_PARAMETER,
        all_joints(mechanism),
        f'Names of the joints: pose of the base ({base}), {mechanism.joint_list}',
        rule=partial(_are_joint_names, mechanism),
        rule_text=(
            f'{len(mechanism.positions)} different names, or {driven} of the driven joints alone'
        ),
    )


FRAME_PREFIX = Parameter(
    'frame_prefix',
    '',
    'Prefix of the name of every frame, such as left/, if several robots are shown',
)

PREFIX = (FRAME_PREFIX,)
"""Parameter of every node that names frames."""


def check_frame_prefix(prefix: str) -> str:
    """Return a prefix of frame names; InputError for one that tf2 or URDF would not take."""
    if prefix.startswith('/') or any(c.isspace() for c in prefix) or not prefix.isprintable():
        raise InputError(
            f"frame_prefix = '{prefix}': expected printable characters without spaces, the "
            'first one no slash, such as left/'
        )
    return prefix
