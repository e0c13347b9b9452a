# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Physical parameters of a robot with other base inertial parameters."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import MutableValues
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.two_link.dynamics import BaseParameters
import numpy as np

_STEPS = 2.0 ** -np.arange(40)
"""Parts of the way from the smallest possible masses of the links to the nominal ones."""

_SHARES = (1.0, 0.5, 0.25, 0.0)
"""Shares of the nominal wheels."""


def values_of(robot: Robot, theta: Array) -> MutableValues:
    """
    Return the values of `robot.` parameters of a robot with these base parameters (7).

    Base parameters do not determine masses. Lengths stay. The masses of the links are between the
    nominal ones and the smallest with which their inertias are positive; close to these, all
    masses and inertias are positive for every positive definite consistency matrix. Wheels stay,
    or become lighter if they are too heavy.
    """
    base = BaseParameters(*theta.tolist())
    for share in _SHARES:
        nominal = dict(robot.values)
        for name in ('wheel_mass', 'wheel_spin_inertia', 'wheel_yaw_inertia'):
            nominal[name] *= share
        for step in _STEPS:
            least = base.moment_2**2 / base.inertia_2
            second = least + step * max(nominal['link_2_mass'] - least, 0.1 * least)
            moment = base.moment_1 - second * nominal['link_1_length']
            inertia = base.inertia_1 - second * nominal['link_1_length'] ** 2
            if inertia <= 0.0:
                continue
            least = moment**2 / inertia
            first = least + step * max(nominal['link_1_mass'] - least, 0.1 * least)
            values = _values(dict(nominal), base, first, second)
            if values is not None:
                return {f'robot.{name}': float(value) for name, value in values.items()}
    raise InputError(
        f'no bodies have the base parameters {theta.tolist()}; expected a positive definite '
        'consistency matrix'
    )


def _values(
    values: dict[str, float], theta: BaseParameters, first: float, second: float
) -> dict[str, float] | None:
    """Return physical parameters for masses of the links in kg; None if they are not possible."""
    arm_base = values['com_offset'] + values['arm_offset']
    length, half_track = values['link_1_length'], values['half_track']
    spin = 2.0 * values['wheel_spin_inertia'] / values['wheel_radius'] ** 2
    platform = theta.mass - 2.0 * values['wheel_mass'] - spin - first - second
    if platform <= 0.0:
        return None
    ahead = (theta.offset - (first + second) * arm_base) / platform
    com_1, com_2 = (theta.moment_1 - second * length) / first, theta.moment_2 / second
    values |= {
        'platform_mass': platform,
        'link_1_mass': first,
        'link_2_mass': second,
        'com_offset': ahead,
        'arm_offset': arm_base - ahead,
        'link_1_com': com_1,
        'link_2_com': com_2,
        'platform_inertia': theta.yaw_inertia
        - platform * ahead**2
        - 2.0 * values['wheel_yaw_inertia']
        - (2.0 * values['wheel_mass'] + spin) * half_track**2
        - (first + second) * arm_base**2,
        'link_1_inertia': theta.inertia_1 - first * com_1**2 - second * length**2,
        'link_2_inertia': theta.inertia_2 - second * com_2**2,
    }
    inertias = (values[f'{name}_inertia'] for name in ('platform', 'link_1', 'link_2'))
    return values if min(inertias) > 0.0 else None


def exciting_task(robot: Robot) -> MutableValues:
    """Return the values of parameters whose task determines the motion of all joints."""
    return {}
