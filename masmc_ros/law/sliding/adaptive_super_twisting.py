# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Super-twisting with gains that adapt to the disturbance.

    alpha' = rate sgn(|s_r| - zone),  least <= alpha <= largest,    beta = 2 epsilon alpha

are k_1 and k_2 of `super_twisting`, whose sampled law this law uses. s_r is s if the torque is not
limited; otherwise it is the surface for which the law would request the limited torque.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import surface_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.sliding.super_twisting import applied, integrated, surface_rate
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus


class Settings(fields.Settings, group='adaptive_super_twisting'):
    """Settings of the law."""

    adaptive_super_twisting_rate: Axes = gain(100.0, 'Rate of the gain alpha', 'm^0.5/s^2.5')
    adaptive_super_twisting_zone: Axes = gain(
        0.02, 'Part of |s| below which alpha decreases', 'm/s', is_positive=True
    )
    adaptive_super_twisting_least: Axes = gain(
        2.0, 'Smallest and initial alpha', 'm^0.5/s^1.5', is_positive=True
    )
    adaptive_super_twisting_largest: Axes = gain(
        50.0, 'Upper bound of alpha; least if that is larger', 'm^0.5/s^1.5', is_positive=True
    )
    adaptive_super_twisting_epsilon: Axes = gain(
        10.0, 'Half the ratio of beta to alpha', 'm^0.5/s^1.5'
    )


class Memory(fields.Memory):
    """Memory of the law."""

    adaptive_super_twisting_w: Axes = field('w, integral part of nu', 'm/s²')
    adaptive_super_twisting_growth: Axes = field('alpha beyond its least', 'm^0.5/s^1.5')


@formula
def _beta(alpha: float, epsilon: float) -> float:
    return 2.0 * epsilon * alpha


@formula
def _gains(settings: Settings, memory: Memory) -> tuple[Numbers, Numbers]:
    """Return alpha and beta."""
    alpha = elementwise(
        plus,
        settings.adaptive_super_twisting_least,
        memory.adaptive_super_twisting_growth,
    )
    return alpha, elementwise(_beta, alpha, settings.adaptive_super_twisting_epsilon)


@formula
def _requested(settings: Settings, tick: Tick, memory: Memory) -> Numbers:
    """Return the integral term nu of the law."""
    alpha, beta = _gains(settings, memory)
    w = memory.adaptive_super_twisting_w
    return elementwise(surface_rate, tick.surface, w, alpha, beta, tick.period)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    nu = _requested(settings, tick, memory)
    return surface_torque(tick, memory.estimate, settings.sigma, nu)


@formula
def realisable_surface(w: float, nu: float, alpha: float, beta: float, period: float) -> float:
    """
    Return |s| in m/s for which the law would request nu: the inverse of `surface_rate`.

    Parameters
    ----------
    w
        Integral part of nu in m/s².
    nu
        Acceleration of the commanded torque in m/s².
    alpha, beta
        Gains of the root and of the integral.
    period
        Control period T in s.

    """
    distance = abs(w - nu)
    beyond = distance - 2.0 * period * beta
    root = beyond / alpha if beyond > 0.0 else 0.0
    held = 0.5 * distance if beyond < 0.0 else period * beta
    return root * root + period * alpha * root + period * held


@formula
def _grown(
    growth: float,
    s: float,
    rate: float,
    zone: float,
    least: float,
    largest: float,
    period: float,
) -> float:
    """Return the next alpha minus its minimum."""
    upper = largest - least
    grown = growth + (period * rate if s > zone else -period * rate)
    grown = grown if grown < upper else upper
    return grown if grown > 0.0 else 0.0


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Integrate w and adapt the gains for the commanded torque."""
    alpha, beta = _gains(settings, memory)
    w = memory.adaptive_super_twisting_w
    requested = _requested(settings, tick, memory)
    nu = applied(tick, memory.estimate, requested, raw, torque)
    growth = elementwise(
        _grown,
        memory.adaptive_super_twisting_growth,
        elementwise(realisable_surface, w, nu, alpha, beta, tick.period),
        settings.adaptive_super_twisting_rate,
        settings.adaptive_super_twisting_zone,
        settings.adaptive_super_twisting_least,
        settings.adaptive_super_twisting_largest,
        tick.period,
    )
    memory.adaptive_super_twisting_growth = growth
    memory.adaptive_super_twisting_w = elementwise(integrated, w, nu, beta, tick.period)


ADAPTIVE_SUPER_TWISTING = Law(
    'adaptive_super_twisting',
    torque,
    (SIGMA, *Settings),
    Memory,
    learn,
    project,
    summary='super-twisting whose gains grow until s stays near the surface, and fall there',
    source='Shtessel, Taleb and Plestan 2012',
    uses_switching=False,
)
