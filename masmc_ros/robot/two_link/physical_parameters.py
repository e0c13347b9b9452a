# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The robot's physical parameters."""

from __future__ import annotations

from masmc_ros.params.declaration import Parameter


def _length(name: str, default: float, description: str, *, positive: bool = True) -> Parameter:
    # Smaller lengths overflow when they are divided by.
    minimum = 1e-6 if positive else None
    return Parameter(f'robot.{name}', default, description, unit='m', minimum=minimum)


def _inertial(
    name: str, default: float, description: str, unit: str, *, positive: bool
) -> Parameter:
    return Parameter(
        f'robot.{name}',
        default,
        description,
        unit=unit,
        minimum=0.0,
        exclusive_minimum=positive,
    )


ROBOT = (
    _length('wheel_radius', 0.0508, 'Radius r of the driving wheels'),
    _length('half_track', 0.182, 'Half the distance b between the driving wheels'),
    _length(
        'com_offset', 0.0, "Platform's centre of mass C ahead of the axle, d", positive=False
    ),
    _length('arm_offset', 0.116, "Arm's base F ahead of C, L_a", positive=False),
    _length('link_1_length', 0.514, 'Length L_1 of link 1'),
    _length('link_2_length', 0.362, 'Length L_2 of link 2'),
    _length('link_1_com', 0.252, 'Joint 1 to the centre of mass of link 1, l_c1', positive=False),
    _length('link_2_com', 0.243, 'Joint 2 to the centre of mass of link 2, l_c2', positive=False),
    _inertial('platform_mass', 17.25, 'Mass m_c of the platform', 'kg', positive=True),
    _inertial('wheel_mass', 0.159, 'Mass m_w of each wheel', 'kg', positive=False),
    _inertial('link_1_mass', 2.56, 'Mass m_1 of link 1', 'kg', positive=True),
    _inertial('link_2_mass', 1.07, 'Mass m_2 of link 2', 'kg', positive=True),
    _inertial(
        'platform_inertia',
        0.297,
        'Yaw inertia I_c of the platform about C',
        'kg·m²',
        positive=True,
    ),
    _inertial(
        'wheel_spin_inertia',
        0.0002,
        'Inertia I_w of each wheel about its axle',
        'kg·m²',
        positive=False,
    ),
    _inertial(
        'wheel_yaw_inertia', 0.0, 'Yaw inertia I_m of each wheel', 'kg·m²', positive=False
    ),
    _inertial(
        'link_1_inertia',
        0.148,
        'Inertia I_1 of link 1 about its centre of mass',
        'kg·m²',
        positive=True,
    ),
    _inertial(
        'link_2_inertia',
        0.0228,
        'Inertia I_2 of link 2 about its centre of mass',
        'kg·m²',
        positive=True,
    ),
)
"""Parameters of every node that needs the robot; defaults are a published platform and arm."""
