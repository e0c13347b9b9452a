# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the simulated robot: its physics, start, disturbance, drives and sensors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.law.parts.moving_base import BASE_LAG
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import Mechanism

RIGID = 'rigid'
"""Physics without slip of the wheels."""

PAYLOAD_MASS, PUSH = 'payload.mass', 'push.torque'
"""Parameters that act on the running robot."""

PHYSICS = {
    RIGID: ('masmc_ros.loop.simulated_robot', 'SimulatedRobot'),
    'mujoco': ('masmc_ros.physics.contact_robot', 'ContactRobot'),
}
"""Physics of the plant: modules, imported on demand, and their classes."""


def parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the plant's declarations for a mechanism."""
    joints = mechanism.joint_list

    def of_joints(
        name: str, description: str, unit: str, default: float = 0.0, **options: Any
    ) -> Parameter:
        values = mechanism.default(name, 'joints', default)
        count = len(mechanism.joints)
        return Parameter(name, values, description, unit=unit, length=count, **options)

    base = mechanism.start_names or tuple(coordinate.short for coordinate in mechanism.base)
    return (
        Parameter(
            'physics',
            RIGID,
            'Physics of the plant: rigid integrates the equations of motion, without slip of the '
            'wheels; mujoco simulates their contact with the ground',
            choices=tuple(PHYSICS),
        ),
        Parameter(
            'friction',
            0.8,
            'Friction coefficient of the wheels on the ground, with MuJoCo',
            minimum=0.0,
            exclusive_minimum=True,
        ),
        Parameter(
            'castor_distance',
            0.0,
            'Distance of the frictionless castors from the axle, or of the wheels from the '
            'centre of an omnidirectional base, with MuJoCo; 0: half of the track, or 0.4 m',
            unit='m',
            minimum=0.0,
        ),
        Parameter(
            PAYLOAD_MASS,
            0.0,
            'Mass of a payload in the tip of the robot; 0: no payload. A change after '
            'payload.time acts at once; read-only with MuJoCo',
            unit='kg',
            minimum=0.0,
            read_only=False,
        ),
        Parameter(
            'payload.time',
            0.0,
            'Time at which the tip picks up the payload, rounded to control periods',
            unit='s',
            minimum=0.0,
        ),
        Parameter(
            'initial_pose',
            mechanism.default('initial_pose', 'base'),
            f'{", ".join(base)} at t = 0',
            unit=', '.join(coordinate.unit for coordinate in mechanism.base),
            length=len(mechanism.base),
        ),
        of_joints('initial_joints', f'Angles of {joints} at t = 0', 'rad'),
        of_joints('initial_velocity', f'Velocities of {joints} at t = 0', 'rad/s'),
        of_joints(
            'disturbance.amplitude',
            'Amplitude of the disturbance torque, amplitude sin(frequency t + phase)',
            'N·m',
        ),
        of_joints('disturbance.frequency', 'Frequency of the disturbance torque', 'rad/s'),
        of_joints('disturbance.phase', 'Phase of the disturbance torque at t = 0', 'rad'),
        of_joints(
            PUSH,
            'Constant disturbance torque that starts when it is set, and returns to 0 after '
            'push.duration; meanwhile a pushed joint has no other disturbance',
            'N·m',
            read_only=False,
        ),
        Parameter(
            'push.duration',
            0.3,
            'Duration of a push, rounded to control periods',
            unit='s',
            minimum=0.0,
            exclusive_minimum=True,
            maximum=60.0,
            read_only=False,
        ),
        Parameter(
            'integrator_step',
            0.0005,
            'Step of the Runge-Kutta integration, rounded to a whole number per control period',
            unit='s',
            minimum=0.0,
            exclusive_minimum=True,
        ),
        of_joints(
            'torque_limit',
            "Torque limit of each motor, unknown to the controller; 0: no limit",
            'N·m',
            minimum=0.0,
        ),
        of_joints(
            'torque_rate_limit',
            'Limit of the rate of the commanded torques; 0: no limit',
            'N·m/s',
            broadcast=True,
            minimum=0.0,
        ),
        COMMAND_INTERFACE,
        ENABLE_STAMPED_CMD_VEL,
        replace(BASE_LAG, read_only=True),
        of_joints(
            'velocity_loop.bandwidth',
            "Bandwidth of the drives' velocity loops, which follow commanded velocities, and hold "
            'the joints without a command',
            'rad/s',
            100.0,
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=True,
        ),
        of_joints(
            'encoder_resolution',
            f'Step of the encoders of {joints}; 0: exact',
            'rad',
            broadcast=True,
            minimum=0.0,
        ),
        of_joints(
            'velocity_noise',
            'Standard deviation of the noise of the measured velocities of the same joints',
            'rad/s',
            broadcast=True,
            minimum=0.0,
        ),
        Parameter(
            'measurement_delay',
            0.0,
            'Delay of the measured state, rounded to whole control periods',
            unit='s',
            minimum=0.0,
            maximum=1.0,
        ),
        Parameter(
            'command_delay',
            0.0,
            'Delay from a command to its effect, rounded to whole control periods',
            unit='s',
            minimum=0.0,
            maximum=1.0,
        ),
        Parameter(
            'delay_jitter',
            0.0,
            'Jitter of both delays as a part of them: they are uniform on 1 - jitter to '
            '1 + jitter times their value, rounded to whole control periods',
            minimum=0.0,
            maximum=1.0,
        ),
        Parameter(
            'measurement_loss',
            0.0,
            'Probability that a measured state is lost; the state before it is then repeated',
            minimum=0.0,
            maximum=1.0,
        ),
        Parameter(
            'command_loss',
            0.0,
            'Probability that a command is lost; the command before it then acts longer',
            minimum=0.0,
            maximum=1.0,
        ),
        of_joints(
            'motor_lag',
            'Time constant of the first-order lag of the torque of each motor; 0: no lag',
            's',
            broadcast=True,
            minimum=0.0,
            maximum=1.0,
        ),
        of_joints(
            'stiction.torque',
            'Friction of each joint at standstill beyond its Coulomb friction; 0: no stiction',
            'N·m',
            broadcast=True,
            minimum=0.0,
        ),
        of_joints(
            'stiction.velocity',
            'Velocity at which half of this friction remains',
            'rad/s',
            0.05,
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=True,
        ),
        of_joints(
            'joint_stiffness',
            'Stiffness of each joint between its motor, whose angle is measured, and its link; '
            '0: rigid',
            'N·m/rad',
            broadcast=True,
            minimum=0.0,
        ),
        of_joints(
            'joint_damping',
            'Damping of each elastic joint',
            'N·m·s/rad',
            broadcast=True,
            minimum=0.0,
        ),
        of_joints(
            'rotor_inertia',
            'Inertia of the rotor of each elastic joint, at the joint and in addition to that of '
            'the robot',
            'kg·m²',
            0.1,
            broadcast=True,
            minimum=0.0,
            exclusive_minimum=True,
        ),
        Parameter(
            'measures_velocity',
            True,
            'Velocities are measured; false: encoders only, for a controller with '
            'velocity_source estimated',
        ),
        Parameter(
            'seed', 0, 'Seed of the measurement noise, of the jitter and of the losses',
            minimum=0, maximum=4294967295,
        ),
    )
