# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of robots described by a URDF, in addition to those of all robots."""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.tree import assembly

FRICTIONLESS = 'none'
"""Of the choices of robot.friction."""

BASE_TYPE = Parameter('robot.base', 'fixed', 'Type of the base', choices=tuple(assembly.BASES))

BASE_FRAME = Parameter('robot.base_frame', '', 'Link of the base frame; empty: the root link')

WHEELS: Parameter[tuple[str, ...]] = Parameter(
    'robot.wheels', (), 'Joints of the wheels: right and left, all of a skid-steer base, or '
    'three or more of an omnidirectional one',
)  # fmt: skip

WHEEL_RADIUS = Parameter(
    'robot.wheel_radius', 0.0, 'Radius of the wheels; 0: their height above the ground',
    unit='m', minimum=0.0,
)  # fmt: skip

ROLLER_ANGLES: Parameter[Numbers] = Parameter(
    'robot.roller_angles', (0.0,), 'Angle of the rollers of each omnidirectional wheel, or of '
    'all; 0, or that of a mecanum wheel', unit='rad',
)  # fmt: skip

TRACK_FACTOR = Parameter(
    'robot.track_factor', assembly.TRACK_FACTOR,
    'Effective track of a skid-steer base, relative to the distance of its wheels',
    minimum=0.0, exclusive_minimum=True,
)  # fmt: skip

TIP_FRAME = Parameter('robot.tip_frame', '', 'Link of the task; empty: the last link')

TASK: Parameter[tuple[str, ...]] = Parameter(
    'robot.task', ('pose',), 'Tasks, one or several: pose, position, orientation or planar '
    '(x, y) of the tip, base (x, y, yaw), heading (yaw), or joints; names of another frame or '
    'of joints follow a task: [pose, heading]',
    broadcast=True,
)  # fmt: skip

JOINTS: Parameter[tuple[str, ...]] = Parameter(
    'robot.joints', (), 'Controlled joints; empty: all movable joints'
)

HELD_JOINTS: Parameter[tuple[str, ...]] = Parameter(
    'robot.held_joints', (), 'Joints held at a constant position'
)

HELD_POSITIONS: Parameter[Numbers] = Parameter(
    'robot.held_positions', (0.0,), 'Positions of the held joints, or 0 for all'
)

ARMATURE = Parameter(
    'robot.armature', 0.01, 'Inertia of the rotor of every joint, at the joint', unit='kg·m²',
    minimum=0.0,
)  # fmt: skip

FRICTION = Parameter(
    'robot.friction', FRICTIONLESS, 'Joint friction, whose coefficients laws adapt: none, '
    "urdf (the URDF's <dynamics>), or parameters (the two below)",
    choices=(FRICTIONLESS, 'urdf', 'parameters'),
)  # fmt: skip

VISCOUS_FRICTION: Parameter[Numbers] = Parameter(
    'robot.viscous_friction', (0.0,), 'Viscous friction of wheels and joints, or of all',
    unit='N·m·s', minimum=0.0,
)  # fmt: skip

COULOMB_FRICTION: Parameter[Numbers] = Parameter(
    'robot.coulomb_friction', (0.0,), 'Coulomb friction of wheels and joints, or of all',
    unit='N·m', minimum=0.0,
)  # fmt: skip

POSTURE: Parameter[Numbers] = Parameter(
    'robot.posture', (0.0,),
    'Preferred joint positions in the null space of the task, or 0 for all',
)  # fmt: skip

POSTURE_GAIN = Parameter(
    'robot.posture_gain', 0.5, 'Rate of the motion to the preferred positions', unit='1/s',
    minimum=0.0,
)  # fmt: skip

BASE_MOBILITY = Parameter(
    'robot.base_mobility', 1.0,
    'Share of the base in the task, relative to that of the joints',
    minimum=0.0, exclusive_minimum=True,
)  # fmt: skip

LIMIT_MARGIN = Parameter(
    'robot.limit_margin', 0.05, "Part of a joint's range at both ends in which its motion for "
    'the task fades to zero; 0: the ends are ignored',
    minimum=0.0, maximum=0.5,
)  # fmt: skip

DAMPING = Parameter(
    'robot.damping', 20.0, 'Damping rate of the motion in the null space of the task',
    unit='1/s', minimum=0.0,
)  # fmt: skip

DRIFT_RATE = Parameter(
    'robot.drift_rate', 50.0, 'Rate of the estimate of disturbance accelerations in the null '
    'space of the task; 0: no estimate', unit='1/s', minimum=0.0,
)  # fmt: skip

LEAST_PIVOT = Parameter(
    'robot.least_pivot', 1.0e-3,
    'Measure of singularity (smallest pivot) below which the task is damped',
    minimum=0.0, exclusive_minimum=True,
)  # fmt: skip

PARAMETERS = (
    BASE_TYPE, BASE_FRAME, WHEELS, WHEEL_RADIUS, ROLLER_ANGLES, TRACK_FACTOR, TIP_FRAME, TASK,
    JOINTS, HELD_JOINTS, HELD_POSITIONS, ARMATURE, FRICTION, VISCOUS_FRICTION, COULOMB_FRICTION,
    POSTURE, POSTURE_GAIN, BASE_MOBILITY, LIMIT_MARGIN, DAMPING, DRIFT_RATE, LEAST_PIVOT,
)  # fmt: skip
"""Parameters of a tree in addition to URDF, which selects it."""
