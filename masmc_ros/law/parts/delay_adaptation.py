# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Adaptation under latency, of the measured state.

The predicted state depends on theta_hat, so its error does not show that of theta_hat. The
acceleration d that the model does not explain does.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, subroutine
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law.parts import moving_base
from masmc_ros.law.parts.delay_fields import CompensationMemory, CompensationSettings
from masmc_ros.law.parts.delay_prediction import usual_latency
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, times
from masmc_ros.robot import mechanism

ADAPTATION_TIME = 0.01
"""Time c in s: the estimates follow sigma = c d."""

SLOWNESS = 8.0
"""Smallest time constant of the adaptation in latencies."""


@formula
def _relative(gradient: float, nominal: float) -> float:
    return gradient * nominal * nominal


@subroutine
def measured_gradient(
    settings: CompensationSettings, memory: CompensationMemory, tick: Tick
) -> Numbers:
    """
    Return Y' c d of the measured state and its estimated acceleration.

    Steps are relative to theta, as those of natural adaptation. The adaptation must be slower
    than d. Its rate is that at which a step of theta_hat reduces d, in the metric of H; a factor
    limits it to 1 / (SLOWNESS (L + T)).
    """
    model, theta = tick.model, memory.estimate
    posture = mechanism.posture(model, memory.measured_position)
    v = mechanism.motion(model, memory.measured_rates)
    d = moving_base.by_torque(settings, memory.acceleration)
    y = mechanism.regressor(model, posture, v, v, memory.measured_acceleration)
    w = elementwise(times, d, ADAPTATION_TIME)
    along = mechanism.regressor_transpose_times(model, y, w, tick.nominal)
    if not mechanism.preserves_consistency(model, settings):
        along = elementwise(_relative, along, tick.nominal)
    adapted = mechanism.theta_step(model, settings, theta, along, tick.period)
    change = elementwise(
        minus,
        mechanism.regressor_times(model, y, adapted),
        mechanism.regressor_times(model, y, theta),
    )
    h = mechanism.inertia(model, posture, theta)
    energy = tick.period * dot(d, mechanism.inertia_times(model, h, d))
    reduction = max(0.0, dot(d, change))
    time = SLOWNESS * (usual_latency(settings) + tick.period)
    whole = energy + time * reduction
    return elementwise(times, along, energy / whole if whole > 0.0 else 0.0)
