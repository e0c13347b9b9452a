# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sliding mode with an adaptive network of radial basis functions for the model error.

    tau = Y theta_hat + J' (W' Phi - K s - k sat(s / delta))
    W' = -Gamma^-1 (Phi s' + nu |s| W)

per axis of 25 normalised Gaussians on a grid of xdot_r and xddot_r; reference [5] of the paper,
with the e-modification of K. S. Narendra and A. M. Annaswamy, "A new adaptive law for robust
adaptation without persistent excitation", IEEE Transactions on Automatic Control 32, 1987.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Columns, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.fuzzy_sets import (
    FIVE,
    gaussian,
    learning_step,
    mean_of_rules,
    RULES,
    train_rules,
)
from masmc_ros.law.parts.inverse_dynamics import limited_force
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.realisable import realisable_for_growth, secant
from masmc_ros.law.parts.surface import reference_acceleration, reference_velocity, SIGMA
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, reaching_force
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus


class Settings(fields.Settings, group='rbf_sliding'):
    """Settings of the law."""

    rbf_sliding_k: Axes = gain(100.0, 'Gain K of the linear term', 'N·s/m')
    rbf_sliding_k_s: Axes = gain(60.0, 'Gain k of the switching term', 'N')
    rbf_sliding_rate: float = gain(10000.0, 'Adaptation rate Gamma^-1', 'N/m')
    rbf_sliding_nu: float = gain(
        0.001, 'Leakage nu in proportion to |s|, the inverse of the largest weight; 0: none', '1/N'
    )
    rbf_sliding_velocity_span: float = gain(
        0.5, 'xdot_r at the centre of the outermost functions', 'm/s', is_positive=True
    )
    rbf_sliding_acceleration_span: float = gain(
        1.0, 'xddot_r at the centre of the outermost functions', 'm/s²', is_positive=True
    )


class Memory(fields.Memory):
    """Memory of the law."""

    rbf_sliding_weights: Numbers = field('W', 'N', size=('axes', RULES))


@formula
def _velocity(desired: float, error: float, sigma: float, span: float) -> Numbers:
    """Return the functions of xdot_r of one axis."""
    activations: Numbers = gaussian(reference_velocity(desired, error, sigma) / span, FIVE)
    return activations


@formula
def _acceleration(desired: float, rate: float, sigma: float, span: float) -> Numbers:
    """Return the functions of xddot_r of one axis."""
    activations: Numbers = gaussian(reference_acceleration(desired, rate, sigma) / span, FIVE)
    return activations


@formula
def _inputs(settings: Settings, tick: Tick) -> tuple[Columns, Columns]:
    """Return the memberships of both inputs, for all axes."""
    sigma = settings.sigma
    velocity_span = settings.rbf_sliding_velocity_span
    acceleration_span = settings.rbf_sliding_acceleration_span
    return (
        elementwise(_velocity, tick.desired_velocity, tick.error, sigma, velocity_span),
        elementwise(
            _acceleration,
            tick.desired_acceleration,
            tick.error_derivative,
            sigma,
            acceleration_span,
        ),
    )


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    first, second = _inputs(settings, tick)
    network = mean_of_rules(in_place(memory, 'rbf_sliding_weights'), first, second)
    reaching = elementwise(
        reaching_force,
        tick.surface,
        settings.rbf_sliding_k,
        settings.rbf_sliding_k_s,
        elementwise(saturation, tick.surface, settings.boundary_layer),
    )
    return model_torque(tick, memory.estimate, elementwise(plus, network, reaching))


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Train the networks by the s that fits the commanded torque."""
    first, second = _inputs(settings, tick)
    rate = settings.rbf_sliding_rate
    k, k_s = settings.rbf_sliding_k, settings.rbf_sliding_k_s
    slope = elementwise(secant, k, k_s, tick.surface, settings.boundary_layer)
    excess = limited_force(tick, raw, torque)
    s = elementwise(realisable_for_growth, tick.surface, excess, slope, rate, tick.period)
    distance = math.sqrt(dot(s, s))
    train_rules(
        in_place(memory, 'rbf_sliding_weights'),
        first,
        second,
        elementwise(learning_step, s, -rate, tick.period),
        tick.period * rate * settings.rbf_sliding_nu * distance,
    )


RBF_SLIDING = Law(
    'rbf_sliding',
    torque,
    (*Settings, BOUNDARY_LAYER, SIGMA),
    Memory,
    learn,
    project,
    summary='sliding mode with the model and a network of radial basis functions',
    source='[5] of the paper; e-modification of Narendra and Annaswamy 1987',
    uses_switching=False,
)
