# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of the settings and the memory of the plant, and of the signals of a tick.

They have no values: formulas get a lane of a record (`jit.lanes`) with these fields. Editors
complete the names, and mypy checks them. `test/law/test_field_types.py` compares them with the
declarations in `plant_model/plant_tick.py` and `loop/signals.py`.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters


class PlantSettings:
    """Settings of the plant: robot, disturbances and measurement."""

    geometry: Numbers
    theta: Parameters
    amplitude: Joints
    frequency: Joints
    phase: Joints
    limit: Joints
    rate_limit: Joints
    period: float
    steps: int
    takes_rates: int
    is_hybrid: int
    by_velocity: tuple[int, ...]
    base_decay: Joints
    is_exact: int
    resolution: Joints
    noise: Joints
    lacks_velocity: int
    delay: int
    delay_span: int
    command_delay: int
    command_delay_span: int
    measurement_loss: float
    command_loss: float
    seed: int
    bandwidth: Joints
    inertia: Joints
    has_losses: int
    lag_decay: Joints
    lag_mean: Joints
    stiction: Joints
    stiction_velocity: Joints
    bristle_stiffness: Joints
    bristle_damping: Joints
    is_elastic: int
    joint_stiffness: Joints
    joint_damping: Joints
    rotor_inertia: Joints


class PlantMemory:
    """State of the plant from tick to tick."""

    position: Numbers
    velocity: Numbers
    rates: Joints
    reached: Numbers
    reached_rates: Joints
    slopes: Numbers
    accelerations: Joints
    disturbance: Joints
    torque: Joints
    commanded_rates: Joints
    followed_rates: Joints
    acting: int
    shown: int
    target: Joints
    motor: Joints
    deflection: Joints
    stiction: Joints
    driven: Joints
    drive_integral: Joints
    rotor_angles: Joints
    rotor_rates: Joints
    reached_rotors: Joints
    reached_rotor_rates: Joints
    rotor_slopes: Joints
    rotor_accelerations: Joints
    actuated: Joints
    odometry: Numbers
    counted: Joints
    standard_noise: Joints


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
