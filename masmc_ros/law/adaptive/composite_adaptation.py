# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Composite adaptation: theta_hat adapts to prediction errors as well.

The torque is that of `rasmc`. W = Y(q, v, v, dv/dt) is the regressor of the last period, f are the
forces that were commanded in it, and H is that of the nominal model. Then
epsilon = H^-1 (W theta_hat - f) is the error of the predicted acceleration, and

    theta_hat' = -Gamma^-1 (Y' sigma + kappa W' epsilon_f)
    epsilon_f' = lambda (epsilon - epsilon_f)
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import adapt_along, project
from masmc_ros.law.parts.delay_compensation import gradient
from masmc_ros.law.parts.last_period import last_regressor
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.reaching.reaching import correct
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='composite_adaptation'):
    """Settings of the law."""

    composite_adaptation_kappa: float = gain(
        0.1, 'Weight kappa of the prediction error relative to the tracking error; 0: rasmc', 's'
    )
    composite_adaptation_rate: float = gain(
        200.0, 'Rate lambda of the filter of the prediction error', '1/s', is_positive=True
    )


class Memory(fields.Memory):
    """Memory of the law."""

    composite_adaptation_error: Joints = field('Filtered error of the acceleration')
    composite_adaptation_torque: Joints = field('Torque of the tick before', 'N·m')
    composite_adaptation_velocity: Joints = field('v of the tick before', initial=math.nan)


@formula
def _finite(value: float, instead: float) -> float:
    return value if value == value else instead


@formula
def _filtered(before: float, value: float, share: float, is_known: bool) -> float:
    return before + share * (value - before) if is_known else 0.0


@formula
def _divided(gradient: float, gamma: float) -> float:
    return gradient / gamma


@formula
def _sum(tracking: float, prediction: float, weight: float) -> float:
    return tracking + weight * prediction


@formula
def _gradient(settings: Settings, tick: Tick, memory: Memory) -> Numbers:
    """Return Y' sigma + kappa W' epsilon_f, and store epsilon_f."""
    before = memory.composite_adaptation_velocity
    w = last_regressor(tick, elementwise(_finite, before, tick.velocity))
    h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
    forces = mechanism.forces(tick.model, memory.composite_adaptation_torque)
    predicted = mechanism.regressor_times(tick.model, w, memory.estimate)
    error = mechanism.inertia_solve(tick.model, h, elementwise(minus, predicted, forces))
    gain = tick.period * settings.composite_adaptation_rate
    error = elementwise(
        _filtered,
        memory.composite_adaptation_error,
        error,
        gain / (1.0 + gain),
        before[0] == before[0],
    )
    memory.composite_adaptation_error = error
    prediction = mechanism.regressor_transpose_times(tick.model, w, error, tick.nominal)
    # An explicit step along W' epsilon overshoots at large accelerations. The gain
    # kappa / (1 + T kappa q), with the curvature q along the step, stops it at the minimum.
    step = elementwise(_divided, prediction, settings.gamma)
    change = mechanism.regressor_times(tick.model, w, step)
    curvature = dot(change, mechanism.inertia_solve(tick.model, h, change))
    slope = dot(prediction, step)
    kappa = settings.composite_adaptation_kappa
    whole = slope + tick.period * kappa * curvature
    weight = kappa * slope / (whole if whole > 0.0 else 1.0)
    tracking = gradient(settings, memory, tick)
    return elementwise(_sum, tracking, prediction, weight)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, held: Joints) -> None:
    """Correct the prediction of the reaching term, and adapt."""
    correct(settings, tick, memory, raw, held)
    along = _gradient(settings, tick, memory)
    adapt_along(settings, tick, memory, raw, held, along)
    memory.composite_adaptation_torque = held
    memory.composite_adaptation_velocity = tick.velocity


COMPOSITE_ADAPTATION = Law(
    'composite_adaptation',
    RASMC.torque,
    (*RASMC.parameters, *Settings),
    Memory,
    learn,
    project,
    summary='rasmc that learns from the error of its predicted acceleration as well',
    source='Slotine and Li 1989',
)
