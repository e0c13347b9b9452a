# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sliding mode with a barrier function as gain, without a known bound of the disturbance.

    sdot = nu,    nu = -K sgn s,    K = rho |s| / (eps - |s|)

after |s| was below eps / 2. Before, K starts at K_0 and grows at the rate K' |s|. In implicit
Euler, with s+ in place of s on the right, |s+| < eps for any s.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import limited_acceleration, surface_torque
from masmc_ros.law.parts.realisable import realisable_part
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='barrier'):
    """Settings of the law."""

    barrier_width: Axes = gain(
        0.02, 'Barrier eps that |s| does not reach', 'm/s', is_positive=True
    )
    barrier_gain: Axes = gain(50.0, 'Gain rho at |s| = eps / 2', 'm/s²')
    barrier_start: Axes = gain(10.0, 'Initial gain K_0 outside the barrier', 'm/s²')
    barrier_growth: Axes = gain(
        100.0, "Growth K' of the gain outside the barrier, per |s|", '1/s²'
    )


class Memory(fields.Memory):
    """Memory of the law."""

    barrier_growth: Axes = field('K less K_0 outside', 'm/s²')
    barrier_inside: Axes = field('1 once |s| has been within eps / 2 and has not left')


@formula
def is_inside(inside: float, s: float, width: float) -> float:
    """Return 1 if the barrier is active, else 0."""
    entered = 1.0 if abs(s) <= 0.5 * width else inside
    return entered if abs(s) < width else 0.0


@formula
def surface_rate(
    s: float, inside: float, growth: float, start: float, width: float, gain: float, period: float
) -> float:
    """Return nu = (s+ - s) / T of one axis in m/s2."""
    size = abs(s)
    half = 0.5 * (width + period * gain + size)
    # By rounding it is negative next to the end of the barrier with a gain of 0.
    radicand = half * half - width * size
    held = width * size / (half + math.sqrt(radicand if radicand > 0.0 else 0.0))
    left = size - period * (start + growth)
    reached = left if left > 0.0 else 0.0
    return sign(s) * ((held if inside > 0.0 else reached) - size) / period


@formula
def _requested(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the integral term nu of the law."""
    width = settings.barrier_width
    return elementwise(
        surface_rate,
        tick.surface,
        elementwise(is_inside, memory.barrier_inside, tick.surface, width),
        memory.barrier_growth,
        settings.barrier_start,
        width,
        settings.barrier_gain,
        tick.period,
    )


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    nu = _requested(settings, tick, memory)
    return surface_torque(tick, memory.estimate, settings.sigma, nu)


@formula
def grown(
    growth: float,
    inside: float,
    s: float,
    nu: float,
    start: float,
    excess: float,
    rate: float,
    period: float,
) -> float:
    """
    Return the next growth; limits reduce |s| to the part of nu that is applied.

    A gain that reaches s = 0 within the period does not grow: more would not act. A disturbance
    that moves s by more than eps / 2 per period would otherwise let it grow without bound.
    """
    part = realisable_part(s, excess, -nu / (s if s != 0.0 else 1.0))
    is_enough = abs(s) <= period * (start + growth)
    return growth if (inside > 0.0) | is_enough else growth + period * rate * abs(part)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Increase the gain outside the barrier by the s that fits the commanded torque."""
    inside = elementwise(is_inside, memory.barrier_inside, tick.surface, settings.barrier_width)
    growth = elementwise(
        grown,
        memory.barrier_growth,
        inside,
        tick.surface,
        _requested(settings, tick, memory),
        settings.barrier_start,
        limited_acceleration(tick, memory.estimate, raw, torque),
        settings.barrier_growth,
        tick.period,
    )
    memory.barrier_inside = inside
    memory.barrier_growth = growth


BARRIER = Law(
    'barrier',
    torque,
    (SIGMA, *Settings),
    Memory,
    learn,
    project,
    summary='sliding mode whose gain grows without bound towards a barrier around s = 0',
    source='Obeid, Fridman, Laghrouche and Harmouche 2018',
    uses_switching=False,
)
