# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's robot without its formulas: joints, frames, parameters and quantities by name."""

from __future__ import annotations

import math

from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import (
    BASE_FRAME,
    Coordinate,
    Group,
    Mechanism,
    ODOM_FRAME,
    Point,
    Quantity,
    register,
    Velocity,
)


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


BASE = (
    Coordinate('base_x_joint', 'x', 'x', 'm'),
    Coordinate('base_y_joint', 'y', 'y', 'm'),
    Coordinate('base_yaw_joint', 'yaw', 'yaw'),
)
"""Pose of the axle midpoint in the world: m, m, rad; velocities m/s, m/s, rad/s."""

DRIVEN = (
    Coordinate('wheel_right_joint', 'wheel_right', 'right wheel'),
    Coordinate('wheel_left_joint', 'wheel_left', 'left wheel'),
    Coordinate('arm_joint_1', 'arm_1', 'arm joint 1'),
    Coordinate('arm_joint_2', 'arm_2', 'arm joint 2'),
)
"""Driven joints in the order of the reduced velocity v; rad, rad/s, N·m."""

FIXED_JOINT = 'end_effector_joint'
"""The joint between the last link and its end."""

AXES = tuple(Quantity(name, 'm') for name in ('x_E', 'y_E', 'x_F', 'y_F'))
"""Task axes, in the world."""

THETA = (
    Quantity('mass', 'kg', 'M'),
    Quantity('yaw_inertia', 'kg·m²', 'J'),
    Quantity('offset', 'kg·m', 'c'),
    Quantity('moment_1', 'kg·m', 'p_1'),
    Quantity('moment_2', 'kg·m', 'p_2'),
    Quantity('inertia_1', 'kg·m²', 'i_1'),
    Quantity('inertia_2', 'kg·m²', 'i_2'),
)
"""Base inertial parameters."""

TWIST = (Velocity('forward speed', 'm/s', 0), Velocity('yaw rate', 'rad/s', 5))
"""Velocities of the platform."""

POINTS = (
    Point('E', 'end_effector', 'end effector', 'the end effector', 0),
    Point('F', 'platform', 'platform', 'platform point F', 2),
)
"""Points that follow a path."""

GROUPS = (Group('wheel', 0, 2), Group('arm', 2, 4))
"""Joints that figures show together."""

FRAMES = (
    (ODOM_FRAME, BASE_FRAME),
    (BASE_FRAME, 'wheel_right'),
    (BASE_FRAME, 'wheel_left'),
    (BASE_FRAME, 'link_1'),
    ('link_1', 'link_2'),
    ('link_2', 'end_effector'),
)
"""Parent and child of every transform, parents first."""

TORQUE_LIMIT = (8.0, 8.0, 20.0, 10.0)
"""Torque limits in N·m of drives that fit the default robot: wheels, then arm joints."""

TORQUE_RATE_LIMIT = (400.0, 400.0, 1000.0, 500.0)
"""Limits of their torque rates in N·m/s: from zero to the torque limit in 20 ms."""

TWO_LINK = register(
    Mechanism(
        name='two_link',
        base=BASE,
        joints=DRIVEN,
        axes=AXES,
        theta=THETA,
        twist=TWIST,
        points=POINTS,
        carrier=POINTS[1],
        groups=GROUPS,
        frames=FRAMES,
        parameters=ROBOT,
        lengths=('wheel_radius', 'half_track', 'arm_base', 'link_1', 'link_2'),
        module='masmc_ros.robot.two_link.two_link',
        defaults={
            'initial_pose': (0.0, 0.0, math.pi / 2),
            'initial_joints': (0.0, 0.0, math.pi / 4, -math.pi / 2),
            'disturbance.amplitude': (1.5, 1.5, 3.0, 3.0),
            'disturbance.frequency': (3.0, 3.0, 1.5, 1.5),
            'disturbance.phase': (0.0, math.pi / 2, 0.0, math.pi / 2),
            'torque_limit': TORQUE_LIMIT,
            'torque_rate_limit': TORQUE_RATE_LIMIT,
            'line_sine.offset': (0.3, 0.5, 0.0, 0.0),
            'line_sine.slope': (0.2, 0.0, 0.2, 0.0),
            'line_sine.amplitude': (0.0, 0.25, 0.0, 0.0),
            'line_sine.frequency': (0.0, 0.2 * math.pi, 0.0, 0.0),
        },
        start_names=('x_C', 'y_C', 'yaw'),
        fixed_joints=(FIXED_JOINT,),
        origin='middle of the axle',
        lost='the arm',
        singular='|sin theta_2| < 0.02',
        is_planar=True,
    )
)
"""The paper's robot."""
