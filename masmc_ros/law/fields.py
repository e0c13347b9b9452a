# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings and memory that every law has, and the functions that declare those of a law.

    class Settings(fields.Settings, group='pid'):
        pid_k_p: Axes = gain(2000.0, 'Stiffness K_p', 'N/m')

    class Memory(fields.Memory):
        pid_integral: Axes = field('w, integral of the error', 'm·s')

The annotation is the type in compiled functions. The gain is the parameter `pid.k_p` of the
controller. `Law` takes both classes. They have no instances: compiled functions get a lane of a
record (`jit.lanes`) with these fields. Editors complete the names, and mypy checks them.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters
from masmc_ros.jit.field import Field, field, Fields
from masmc_ros.law.declared import gain
from masmc_ros.robot.formula_types import LawMemory, LawSettings

__all__ = ['ESTIMATE', 'EstimatorMemory', 'Memory', 'Settings', 'field', 'gain']


class SharedParameters:
    """
    Values of the parameters that every law has; choices are indices.

    The modules of `parts` and `reaching` declare them, because plant, nodes and reports use these
    declarations as well; `test/law/test_field_types.py` compares both.
    """

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


class Settings(LawSettings, SharedParameters, is_shared=True):
    """Settings that every law has; those with a declaration here are not parameters."""

    by_velocity: tuple[int, ...] = field(
        'Whether a joint follows a commanded velocity', size='joints'
    )
    group: tuple[int, ...] = field('Number of the group of each joint: 0, 1, ...', size='joints')


class EstimateMemory(Fields):
    """Adapted parameters of any law; a change of law keeps them."""

    estimate: Parameters = field('theta_hat of the next tick')


class EstimatorMemory(Fields):
    """Memory of the velocity estimator."""

    estimator_initialised: int = field('1 after the first measured position')
    uncomputed_ticks: int = field('Preceding ticks without a computation')
    angles: Joints = field('Estimated angles', 'rad')
    rates: Joints = field('Estimated rates', 'rad/s')
    unmodelled: Joints = field('Estimated unmodelled accelerations', 'rad/s²')
    disturbance_torque: Joints = field('Disturbance estimate of the law', 'N·m')
    commanded: Joints = field('Torque of the last tick', 'N·m')


class Memory(LawMemory, EstimatorMemory, EstimateMemory, is_shared=True):
    """
    Memory that every law has, with that of the reaching terms.

    In a record, fields of the bases stand before these, and those of the last base first.
    """

    velocity_command: Joints = field('Rates commanded at the last tick', 'm/s, rad/s')
    disturbance: Axes = field("The law's disturbance estimate d", 'N')
    reaching: Axes = field('Reaching force u of the last tick', 'N')
    predicted: Axes = field('s+; NaN: no prediction', 'm/s', initial=math.nan)
    needs_full: float = field('Not 0 if a shortcut does not apply to the tick')


ESTIMATE: Field
(ESTIMATE,) = EstimateMemory
"""`estimate`, for laws that declare their memory as a tuple."""
