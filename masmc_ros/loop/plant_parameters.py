# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the simulated robot: its physics, start, disturbance, drives and sensors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from masmc_ros.aliases import Numbers
from masmc_ros.law.command_interface import (
    COMMAND_INTERFACE,
    ENABLE_STAMPED_CMD_VEL,
    MEASURES_VELOCITY,
)
from masmc_ros.law.parts.moving_base import BASE_LAG
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import Mechanism

RIGID = 'rigid'
"""Physics without slip of the wheels."""

CLASSES = {
    RIGID: ('masmc_ros.loop.simulated_robot', 'SimulatedRobot'),
    'mujoco': ('masmc_ros.physics.contact_robot', 'ContactRobot'),
}
"""Classes of plants by `physics`, with their modules, which are imported on demand."""


def _per_joint(
    name: str, description: str, unit: str, default: float = 0.0, **options: Any
) -> Parameter[Numbers]:
    """Return a declaration with one number; `parameters` has one for each joint of a robot."""
    return Parameter(name, (default,), description, unit=unit, length=1, **options)


PHYSICS = Parameter(
    'physics',
    RIGID,
    'Physics of the plant: rigid integrates the equations of motion, without slip of the '
    'wheels; mujoco simulates their contact with the ground',
    choices=tuple(CLASSES),
)

FRICTION = Parameter(
    'friction',
    0.8,
    'Friction coefficient of the wheels on the ground, with MuJoCo',
    minimum=0.0,
    exclusive_minimum=True,
)

CASTOR_DISTANCE = Parameter(
    'castor_distance',
    0.0,
    'Distance of the frictionless castors from the axle, or of the wheels from the '
    'centre of an omnidirectional base, with MuJoCo; 0: half of the track, or 0.4 m',
    unit='m',
    minimum=0.0,
)

PAYLOAD_MASS = Parameter(
    'payload.mass',
    0.0,
    'Mass of a payload in the tip of the robot; 0: no payload. A change after '
    'payload.time acts at once; read-only with MuJoCo',
    unit='kg',
    minimum=0.0,
    read_only=False,
)

PAYLOAD_TIME = Parameter(
    'payload.time',
    0.0,
    'Time at which the tip picks up the payload, rounded to control periods',
    unit='s',
    minimum=0.0,
)

INITIAL_POSE: Parameter[Numbers] = Parameter(
    'initial_pose', (0.0,), 'Pose of the base at t = 0'
)

INITIAL_JOINTS = _per_joint('initial_joints', 'Angles of {joints} at t = 0', 'rad')

INITIAL_VELOCITY = _per_joint('initial_velocity', 'Velocities of {joints} at t = 0', 'rad/s')

AMPLITUDE = _per_joint(
    'disturbance.amplitude',
    'Amplitude of the disturbance torque, amplitude sin(frequency t + phase)',
    'N·m',
)

FREQUENCY = _per_joint('disturbance.frequency', 'Frequency of the disturbance torque', 'rad/s')

PHASE = _per_joint('disturbance.phase', 'Phase of the disturbance torque at t = 0', 'rad')

PUSH = _per_joint(
    'push.torque',
    'Constant disturbance torque that starts when it is set, and returns to 0 after '
    'push.duration; meanwhile a pushed joint has no other disturbance',
    'N·m',
    read_only=False,
)

PUSH_DURATION = Parameter(
    'push.duration',
    0.3,
    'Duration of a push, rounded to control periods',
    unit='s',
    minimum=0.0,
    exclusive_minimum=True,
    maximum=60.0,
    read_only=False,
)

INTEGRATOR_STEP = Parameter(
    'integrator_step',
    0.0005,
    'Step of the Runge-Kutta integration, rounded to a whole number per control period',
    unit='s',
    minimum=0.0,
    exclusive_minimum=True,
)

TORQUE_LIMIT = _per_joint(
    'torque_limit',
    "Torque limit of each motor, unknown to the controller; 0: no limit",
    'N·m',
    minimum=0.0,
)

TORQUE_RATE_LIMIT = _per_joint(
    'torque_rate_limit',
    'Limit of the rate of the commanded torques; 0: no limit',
    'N·m/s',
    broadcast=True,
    minimum=0.0,
)

BANDWIDTH = _per_joint(
    'velocity_loop.bandwidth',
    "Bandwidth of the drives' velocity loops, which follow commanded velocities, and hold "
    'the joints without a command',
    'rad/s',
    100.0,
    broadcast=True,
    minimum=0.0,
    exclusive_minimum=True,
)

ENCODER_RESOLUTION = _per_joint(
    'encoder_resolution',
    'Step of the encoders of {joints}; 0: exact',
    'rad',
    broadcast=True,
    minimum=0.0,
)

VELOCITY_NOISE = _per_joint(
    'velocity_noise',
    'Standard deviation of the noise of the measured velocities of the same joints',
    'rad/s',
    broadcast=True,
    minimum=0.0,
)

MEASUREMENT_DELAY = Parameter(
    'measurement_delay',
    0.0,
    'Delay of the measured state, rounded to whole control periods',
    unit='s',
    minimum=0.0,
    maximum=1.0,
)

COMMAND_DELAY = Parameter(
    'command_delay',
    0.0,
    'Delay from a command to its effect, rounded to whole control periods',
    unit='s',
    minimum=0.0,
    maximum=1.0,
)

DELAY_JITTER = Parameter(
    'delay_jitter',
    0.0,
    'Jitter of both delays as a part of them: they are uniform on 1 - jitter to '
    '1 + jitter times their value, rounded to whole control periods',
    minimum=0.0,
    maximum=1.0,
)

MEASUREMENT_LOSS = Parameter(
    'measurement_loss',
    0.0,
    'Probability that a measured state is lost; the state before it is then repeated',
    minimum=0.0,
    maximum=1.0,
)

COMMAND_LOSS = Parameter(
    'command_loss',
    0.0,
    'Probability that a command is lost; the command before it then acts longer',
    minimum=0.0,
    maximum=1.0,
)

MOTOR_LAG = _per_joint(
    'motor_lag',
    'Time constant of the first-order lag of the torque of each motor; 0: no lag',
    's',
    broadcast=True,
    minimum=0.0,
    maximum=1.0,
)

STICTION_TORQUE = _per_joint(
    'stiction.torque',
    'Friction of each joint at standstill beyond its Coulomb friction; 0: no stiction',
    'N·m',
    broadcast=True,
    minimum=0.0,
)

STICTION_VELOCITY = _per_joint(
    'stiction.velocity',
    'Velocity at which half of this friction remains',
    'rad/s',
    0.05,
    broadcast=True,
    minimum=0.0,
    exclusive_minimum=True,
)

JOINT_STIFFNESS = _per_joint(
    'joint_stiffness',
    'Stiffness of each joint between its motor, whose angle is measured, and its link; '
    '0: rigid',
    'N·m/rad',
    broadcast=True,
    minimum=0.0,
)

JOINT_DAMPING = _per_joint(
    'joint_damping',
    'Damping of each elastic joint',
    'N·m·s/rad',
    broadcast=True,
    minimum=0.0,
)

ROTOR_INERTIA = _per_joint(
    'rotor_inertia',
    'Inertia of the rotor of each elastic joint, at the joint and in addition to that of '
    'the robot',
    'kg·m²',
    0.1,
    broadcast=True,
    minimum=0.0,
    exclusive_minimum=True,
)

SEED = Parameter(
    'seed', 0, 'Seed of the measurement noise, of the jitter and of the losses',
    minimum=0, maximum=4294967295,
)

_PARAMETERS: tuple[Parameter, ...] = (
    PHYSICS, FRICTION, CASTOR_DISTANCE, PAYLOAD_MASS, PAYLOAD_TIME, INITIAL_POSE, INITIAL_JOINTS,
    INITIAL_VELOCITY, AMPLITUDE, FREQUENCY, PHASE, PUSH, PUSH_DURATION, INTEGRATOR_STEP,
    TORQUE_LIMIT, TORQUE_RATE_LIMIT, COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL,
    replace(BASE_LAG, read_only=True), BANDWIDTH, ENCODER_RESOLUTION, VELOCITY_NOISE,
    MEASUREMENT_DELAY, COMMAND_DELAY, DELAY_JITTER, MEASUREMENT_LOSS, COMMAND_LOSS, MOTOR_LAG,
    STICTION_TORQUE, STICTION_VELOCITY, JOINT_STIFFNESS, JOINT_DAMPING, ROTOR_INERTIA,
    MEASURES_VELOCITY, SEED,
)  # fmt: skip


def parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the declarations of the simulated robot for a mechanism."""
    base = mechanism.start_names or tuple(coordinate.short for coordinate in mechanism.base)
    pose = replace(
        INITIAL_POSE,
        default=mechanism.default(INITIAL_POSE.name, 'base'),
        description=f'{", ".join(base)} at t = 0',
        unit=', '.join(coordinate.unit for coordinate in mechanism.base),
        length=len(mechanism.base),
    )
    of_joints = {
        p.name: replace(
            p,
            default=mechanism.default(p.name, 'joints', *p.default),
            description=p.description.replace('{joints}', mechanism.joint_list),
            length=len(mechanism.joints),
        )
        for p in _PARAMETERS if p.length == 1
    }  # fmt: skip
    return tuple(
        pose if p is INITIAL_POSE else of_joints.get(p.name, p) for p in _PARAMETERS
    )


def _is_speed_limit(value: float) -> bool:
    """Return True for a speed that `real_time_factor` may have, and for 0, which is no limit."""
    return value == 0.0 or value >= 0.01


REAL_TIME_FACTOR = Parameter(
    'real_time_factor', 1.0,
    'Speed of the simulated time relative to real time, with pacing realtime',
    minimum=0.01, maximum=100.0, read_only=False,
)

MAX_REAL_TIME_FACTOR = Parameter(
    'max_real_time_factor', 0.0,
    'Largest speed of the simulated time relative to real time, with pacing lockstep; '
    '0: no limit',
    minimum=0.0, maximum=100.0, rule=_is_speed_limit,
    rule_text='0, or a number in [0.01, 100]',
)

COMMAND_TIMEOUT = Parameter(
    'command_timeout', 0.1,
    'Age from which a command is ignored and the drives hold, with pacing realtime',
    unit='s', minimum=0.0, exclusive_minimum=True,
)

WAIT_FOR: Parameter[tuple[str, ...]] = Parameter(
    'wait_for', ('controller',),
    'Nodes of the same namespace for which the plant waits before the run starts',
)

ODOM_DECIMATION = Parameter(
    'odom_decimation', 2,
    'Ticks between two messages on odom and base_twist, and on plant/contact with MuJoCo',
    minimum=1,
)

CLOCK_DECIMATION = Parameter(
    'clock_decimation', 1,
    'Ticks between two messages on clock (/clock without a namespace); 0: no messages',
    minimum=0,
)

TF_DECIMATION = Parameter(
    'tf_decimation', 1,
    'Ticks between two messages on /tf, or on tf of the namespace if frame_prefix is empty; '
    '0: no messages',
    minimum=0,
)

NODE = (
    REAL_TIME_FACTOR, MAX_REAL_TIME_FACTOR, COMMAND_TIMEOUT, WAIT_FOR, ODOM_DECIMATION,
    CLOCK_DECIMATION, TF_DECIMATION,
)  # fmt: skip
"""Further parameters of the node."""
