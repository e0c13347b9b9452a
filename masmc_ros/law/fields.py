# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of the settings and the memory that every law has.

They have no values: formulas get a lane of a record (`jit.lanes`) with these fields. Editors
complete the names, and mypy checks them. A law with own parameters or memory derives classes with
its fields, next to its declarations; `test/law/test_field_types.py` compares both.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters
from masmc_ros.robot.formula_types import LawMemory, LawSettings


class Settings(LawSettings):
    """Values of the parameters that every law has; choices are indices."""

    geometry: Numbers
    group: tuple[int, ...]
    by_velocity: tuple[int, ...]
    k_s1: Axes
    k_s2: Axes
    sigma: Axes
    boundary_layer: float
    observer_gain: float
    slip_backoff: float
    model_scale: float
    payload_mass: float
    payload_com: Numbers
    payload_inertia: Numbers
    leakage: float
    e_modification: float
    dead_zone: float
    freeze_when_saturated: int
    torque_limit: Joints
    torque_rate_limit: Joints
    limit_deceleration: float
    velocity_source: int
    estimator_bandwidth: float
    enable_stamped_cmd_vel: int
    base_lag: float
    latency: float
    motor_lag: float
    compensation_horizon: float
    compensation_gain: float
    compensation_slope: float


class Memory(LawMemory):
    """State that every law has, with that of the reaching terms."""

    estimate: Parameters
    estimator_initialised: int
    uncomputed_ticks: int
    angles: Joints
    rates: Joints
    unmodelled: Joints
    disturbance_torque: Joints
    commanded: Joints
    velocity_command: Joints
    disturbance: Axes
    reaching: Axes
    predicted: Axes
    needs_full: float
