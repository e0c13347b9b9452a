# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Type of the command: torques, velocities for drives with a velocity loop, or both."""

from __future__ import annotations

from masmc_ros.aliases import Flags
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import NAME as MECHANISM
import numpy as np

COMMAND_INTERFACES = ('effort', 'velocity', 'hybrid')
"""Choices of `command_interface`; compiled code knows them by their position here."""

EFFORT, VELOCITY, HYBRID = range(len(COMMAND_INTERFACES))

COMMAND_INTERFACE = Parameter(
    'command_interface',
    'effort',
    'effort: torques; velocity: joint velocities for drives with their own velocity loop; hybrid: '
    'velocities of the base and torques of the arm',
    choices=COMMAND_INTERFACES,
)
"""Parameter of the controller and of the plant, with equal values."""

ENABLE_STAMPED_CMD_VEL = Parameter(
    'enable_stamped_cmd_vel',
    False,
    'Type of cmd_vel with command_interface velocity or hybrid: TwistStamped instead of Twist',
)
"""Parameter of both; Nav2 nodes use the same name for their topic."""

MEASURES_VELOCITY = Parameter(
    'measures_velocity',
    True,
    'Velocities are measured; false: encoders only, for a controller with '
    'velocity_source estimated',
)
"""Parameter of the plant."""


def takes_rates(values: Values) -> bool:
    """Return True if values of the plant or of the controller select commanded velocities."""
    return COMMAND_INTERFACE.of(values) == COMMAND_INTERFACES[VELOCITY]


def is_hybrid(values: Values) -> bool:
    """Return True if values select velocities of the base and torques of the arm."""
    return COMMAND_INTERFACE.of(values) == COMMAND_INTERFACES[HYBRID]


def by_velocity(values: Values, mechanism: Mechanism) -> Flags:
    """
    Return for each joint (joints) whether it follows a commanded velocity.

    Raises InputError for a hybrid interface of a robot without a base.
    """
    base = len(mechanism.twist)
    if is_hybrid(values) and not base:
        raise InputError(
            f'{COMMAND_INTERFACE.name} = hybrid: expected effort or velocity, because the robot '
            'has no base'
        )
    return np.array(
        [takes_rates(values) or (is_hybrid(values) and j < base)
         for j in range(len(mechanism.joints))]
    )


def check_agreement(plant: Values, controller: Values) -> None:
    """Raise InputError if plant and controller values select different commands or states."""
    for name in (MECHANISM, COMMAND_INTERFACE.name, ENABLE_STAMPED_CMD_VEL.name):
        if plant[name] != controller[name]:
            raise InputError(
                f'controller.{name} = {yaml_text(controller[name])}: expected '
                f'{yaml_text(plant[name])}, which plant.{name} is'
            )
    if not MEASURES_VELOCITY.of(plant) and controller['velocity_source'] == 'measured':
        raise InputError(
            'controller.velocity_source = measured: expected estimated, because '
            'plant.measures_velocity is false'
        )
