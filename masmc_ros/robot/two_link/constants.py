# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lengths and base parameters from physical parameters, reach of the arm, and payload."""

from __future__ import annotations

from functools import lru_cache

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.params.declaration import Values
from masmc_ros.robot.two_link.dynamics import BaseParameters
from masmc_ros.robot.two_link.geometry import Geometry
import numpy as np

_SHORTEST_ARM_BASE = 1.0e-3

_COMFORTABLE = 0.3, 0.65
"""Parts of the way from the least to the largest reach that bound the comfortable one."""


def constants(values: Values) -> tuple[Geometry, BaseParameters]:
    """
    Return the lengths and base parameters of checked values, named as in ROBOT without `robot.`.

    Raises InputError if the arm's base is on the axle: its sideways motion would
    then not depend on the platform's rotation, and (3) could not be inverted.
    """
    arm_base = values['com_offset'] + values['arm_offset']
    if abs(arm_base) < _SHORTEST_ARM_BASE:
        raise InputError(
            f'robot.com_offset + robot.arm_offset = {arm_base:g}: expected at least '
            f'{_SHORTEST_ARM_BASE:g} m between the axle and the base of the arm'
        )
    geometry = Geometry(
        values['wheel_radius'],
        values['half_track'],
        arm_base,
        values['link_1_length'],
        values['link_2_length'],
    )
    return geometry, base_parameters(**values)


# The runs of a campaign mostly have the same initial yaw.
_sin_cos = lru_cache(maxsize=16)(sin_cos)


def start(
    values: Values, pose: tuple[float, ...], angles: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the positions for a pose (x, y, yaw) of C and joint angles."""
    x, y, yaw = pose
    s, c = _sin_cos(yaw)
    d = values['com_offset']
    return x - d * c, y - d * s, yaw, *angles


def out_of_reach(
    lengths: Array, task: Array
) -> tuple[int, str] | None:
    """Return the first row (x_E, y_E, x_F, y_F) whose E the arm cannot reach, and a line on it."""
    robot = Geometry(*lengths)
    x, y = task[:, 0] - task[:, 2], task[:, 1] - task[:, 3]
    # Not by hypot, which takes six times as long.
    distance = np.sqrt(x * x + y * y)
    least, most = abs(robot.link_1 - robot.link_2), robot.link_1 + robot.link_2
    outside = (distance < least) | (distance > most)
    if not outside.any():
        return None
    bad = int(np.argmax(outside))
    return bad, (
        f'the end effector is to be {distance[bad]:.3f} m from the base of the arm, outside its '
        f'reach; expected {least:.3f} to {most:.3f} m'
    )


def comfortable_reach(lengths: Array) -> tuple[float, float]:
    """Return the distances in m from F to E between which the arm is clear of its limits."""
    robot = Geometry(*lengths)
    least, most = abs(robot.link_1 - robot.link_2), robot.link_1 + robot.link_2
    low, high = _COMFORTABLE
    return least + low * (most - least), least + high * (most - least)


def payload_factors(lengths: Array) -> Array:
    """Return the changes (7, 10) of theta by the moments of a payload on link 2."""
    geometry, fields = Geometry(*lengths), BaseParameters._fields
    factors = np.zeros((len(fields), 10))
    by_mass = {
        'mass': 1.0,
        'yaw_inertia': geometry.arm_base**2,
        'offset': geometry.arm_base,
        'moment_1': geometry.link_1,
        'inertia_1': geometry.link_1**2,
    }
    for name, value in by_mass.items():
        factors[fields.index(name), 0] = value
    factors[fields.index('moment_2'), 1] = 1.0
    factors[fields.index('inertia_2'), 4:6] = 1.0
    return factors


def tip_on_link(lengths: Array) -> tuple[Array, ...]:
    """Return rotation (3, 3) and origin (3) in m of the tip's frame in that of link 2."""
    return np.eye(3), np.array([Geometry(*lengths).link_2, 0.0, 0.0])


def base_parameters(
    *,
    wheel_radius: float,
    half_track: float,
    com_offset: float,
    arm_offset: float,
    link_1_length: float,
    link_2_length: float,
    link_1_com: float,
    link_2_com: float,
    platform_mass: float,
    wheel_mass: float,
    link_1_mass: float,
    link_2_mass: float,
    platform_inertia: float,
    wheel_spin_inertia: float,
    wheel_yaw_inertia: float,
    link_1_inertia: float,
    link_2_inertia: float,
) -> BaseParameters:
    """Return theta (7) of a robot from its physical parameters in m, kg and kg·m²."""
    arm_mass = link_1_mass + link_2_mass
    arm_base = com_offset + arm_offset
    spin = 2.0 * wheel_spin_inertia / (wheel_radius * wheel_radius)
    return BaseParameters(
        mass=platform_mass + 2.0 * wheel_mass + spin + arm_mass,
        yaw_inertia=platform_inertia
        + platform_mass * com_offset * com_offset
        + 2.0 * wheel_yaw_inertia
        + 2.0 * wheel_mass * half_track * half_track
        + spin * half_track * half_track
        + arm_mass * arm_base * arm_base,
        offset=platform_mass * com_offset + arm_mass * arm_base,
        moment_1=link_1_mass * link_1_com + link_2_mass * link_1_length,
        moment_2=link_2_mass * link_2_com,
        inertia_1=link_1_inertia
        + link_1_mass * link_1_com * link_1_com
        + link_2_mass * link_1_length * link_1_length,
        inertia_2=link_2_inertia + link_2_mass * link_2_com * link_2_com,
    )
