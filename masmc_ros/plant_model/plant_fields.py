# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings and memory of the plant, and types of the signals of a tick.

They have no instances: formulas get a lane of a record (`jit.lanes`) with these fields. Editors
complete the names, and mypy checks them. `loop/signals.py` declares the signals with their labels
and plots, which the plant does not know; `test/law/test_field_types.py` compares both.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, BasePose, Joints, Numbers, Parameters, Positions
from masmc_ros.jit.field import field, Fields


class PlantSettings(Fields):
    """Settings of the plant: robot, disturbances and measurement."""

    geometry: Numbers = field('Lengths of the robot', 'm', size='lengths')
    theta: Parameters = field('Its base inertial parameters')
    amplitude: Joints = field('Amplitude of the disturbance', 'N·m')
    frequency: Joints = field('Frequency of the disturbance', 'rad/s')
    phase: Joints = field('Phase of the disturbance', 'rad')
    limit: Joints = field("Limit of each motor's torque; 0: no limit", 'N·m')
    rate_limit: Joints = field('Limit of its rate; 0: no limit', 'N·m/s')
    period: float = field('Control period, that of all lanes', 's')
    steps: int = field('Integration steps in a period, in all lanes')
    takes_rates: int = field('Whether rates are commanded, in all lanes')
    is_hybrid: int = field('Whether only the base follows rates, in all lanes')
    by_velocity: tuple[int, ...] = field(
        'Whether a joint follows a commanded velocity', size='joints'
    )
    base_decay: Joints = field('Share of a past base velocity that remains after a step')
    is_exact: int = field('Whether the measurement is the true state')
    resolution: Joints = field('Step of the encoders; 0: exact', 'rad')
    noise: Joints = field('Standard deviation of the measured rates', 'rad/s')
    lacks_velocity: int = field('Whether velocities are not measured')
    delay: int = field('Largest delay of the measurement in ticks')
    delay_span: int = field('Largest minus smallest delay in ticks')
    command_delay: int = field('Largest delay of commands in ticks')
    command_delay_span: int = field('Largest minus smallest delay in ticks')
    measurement_loss: float = field('Probability that a measurement is lost')
    command_loss: float = field('Probability that a command is lost')
    seed: int = field('Seed of noise, jitter and losses')
    bandwidth: Joints = field("Bandwidth of the drives' velocity loops", 'rad/s')
    inertia: Joints = field('Inertia for which the drives are tuned', 'kg·m²')
    has_losses: int = field('Whether motors lag or joints stick')
    lag_decay: Joints = field("Share of a motor's torque that remains after half a step")
    lag_mean: Joints = field('Mean of this share over a period')
    stiction: Joints = field('Level of stiction; 0: no stiction', 'N·m')
    stiction_velocity: Joints = field('Velocity with half of it', 'rad/s')
    bristle_stiffness: Joints = field('sigma_0 of stiction', 'N·m/rad')
    bristle_damping: Joints = field('sigma_1 of stiction', 'N·m·s/rad')
    is_elastic: int = field('Whether a joint is elastic')
    joint_stiffness: Joints = field('Stiffness of elastic joints; 0: rigid', 'N·m/rad')
    joint_damping: Joints = field('Damping of elastic joints', 'N·m·s/rad')
    rotor_inertia: Joints = field('Inertia of the rotors of elastic joints', 'kg·m²')


class PlantMemory(Fields):
    """State of the plant from tick to tick."""

    position: Positions = field('True positions', 'm, rad')
    velocity: Positions = field('Their derivatives', 'm/s, rad/s')
    rates: Joints = field('True joint rates', 'rad/s')
    reached: Positions = field('Positions at the stage of a step', 'm, rad')
    reached_rates: Joints = field('Rates of the joints there', 'rad/s')
    slopes: Positions = field('Sum of the derivatives of the positions so far')
    accelerations: Joints = field('Sum of the derivatives of the rates so far', 'rad/s²')
    disturbance: Joints = field('Disturbance torque at the time reached', 'N·m')
    torque: Joints = field('Commanded torque that has arrived', 'N·m')
    commanded_rates: Joints = field('Commanded velocities that have arrived', 'm/s, rad/s')
    followed_rates: Joints = field('Velocities that the drives follow', 'm/s, rad/s')
    acting: int = field('Tick of the command that has arrived')
    shown: int = field('Tick of the measurement that has arrived')
    target: Joints = field('Torque that the motors follow', 'N·m')
    motor: Joints = field('Torque of lagging motors', 'N·m')
    deflection: Joints = field('Deflection of the bristles of stiction', 'rad')
    stiction: Joints = field('Torque of stiction', 'N·m')
    driven: Joints = field('Torque of drives and stiction', 'N·m')
    drive_integral: Joints = field("Integrals of the drives' velocity loops", 'N·m')
    rotor_angles: Joints = field('Angles of the rotors of elastic joints', 'rad')
    rotor_rates: Joints = field('Their rates', 'rad/s')
    reached_rotors: Joints = field('Angles of the rotors at the stage of a step', 'rad')
    reached_rotor_rates: Joints = field('Their rates there', 'rad/s')
    rotor_slopes: Joints = field('Sum of the derivatives of their angles so far')
    rotor_accelerations: Joints = field('Sum of those of their rates', 'rad/s²')
    actuated: Joints = field('Torque on the rotors', 'N·m')
    odometry: BasePose = field('Pose of the base by odometry', 'm, rad')
    counted: Joints = field('Encoder angles in the odometry', 'rad')
    standard_noise: Joints = field('Standard normal numbers of the tick')


class Signals:
    """Signals of a tick of plant and controller."""

    position: Numbers
    velocity: Numbers
    true_position: Numbers
    true_velocity: Numbers
    applied: Joints
    age: int
    reference: Numbers
    torque: Joints
    rates: Joints
    error: Axes
    surface: Axes
    estimate: Parameters
    raw_torque: Joints
    singular: int
