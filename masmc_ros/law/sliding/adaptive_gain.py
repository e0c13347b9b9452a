# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sliding mode with an adaptive gain: the switching gain grows outside a dead zone.

    tau = Y theta_hat + J' u,    u = -K s - k sat(s / delta)
    k_i' = gamma (|s_i| - dead zone)+ - leak k_i,    0 <= k_i <= k_max

per axis. With gamma |s_i| alone (reference [7] of the paper), k grows indefinitely if s is never
exactly zero; dead zone, leak and bound prevent this.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.adaptive_bound import grown
from masmc_ros.law.parts.inverse_dynamics import limited_force
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.realisable import realisable_part, secant
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, reaching_force
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='adaptive_gain'):
    """Settings of the law."""

    adaptive_gain_k: Axes = gain(100.0, 'Gain K of the linear term', 'N·s/m')
    adaptive_gain_gamma: Axes = gain(1000.0, 'Growth gamma of k by |s|', 'N/m')
    adaptive_gain_dead_zone: Axes = gain(0.01, '|s| below which k does not grow', 'm/s')
    adaptive_gain_leak: float = gain(0.1, 'Rate at which k returns to zero', '1/s')
    adaptive_gain_k_max: Axes = gain(200.0, 'Largest k', 'N')


class Memory(fields.Memory):
    """Memory of the law."""

    adaptive_gain_switching: Axes = field('k', 'N')


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    u = elementwise(
        reaching_force,
        tick.surface,
        settings.adaptive_gain_k,
        memory.adaptive_gain_switching,
        elementwise(saturation, tick.surface, settings.boundary_layer),
    )
    return model_torque(tick, memory.estimate, u)


@formula
def _following(
    k: float,
    s: float,
    gamma: float,
    dead_zone: float,
    leak: float,
    most: float,
    period: float,
) -> float:
    """Return the k of one axis after a period."""
    gain = grown(k, s, gamma, dead_zone, leak, period)
    return gain if gain < most else most


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Adapt the gains by the s that fits the commanded torque."""
    slope = elementwise(
        secant,
        settings.adaptive_gain_k,
        memory.adaptive_gain_switching,
        tick.surface,
        settings.boundary_layer,
    )
    excess = limited_force(tick, raw, torque)
    following = elementwise(
        _following,
        memory.adaptive_gain_switching,
        elementwise(realisable_part, tick.surface, excess, slope),
        settings.adaptive_gain_gamma,
        settings.adaptive_gain_dead_zone,
        settings.adaptive_gain_leak,
        settings.adaptive_gain_k_max,
        tick.period,
    )
    memory.adaptive_gain_switching = following


ADAPTIVE_GAIN = Law(
    'adaptive_gain',
    torque,
    (*Settings, BOUNDARY_LAYER, SIGMA),
    Memory,
    learn,
    project,
    summary='sliding mode whose switching gain grows while s is outside a dead zone',
    source='[7] of the paper; Huang, Kuo and Chang 2008',
    uses_switching=False,
)
