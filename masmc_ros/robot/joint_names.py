# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Names of joints and frames of any type of robot."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from

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
