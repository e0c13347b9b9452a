# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Super-twisting of accelerations, in a discretisation with |s| <= L T^2.

    sdot = nu + delta,    nu = -k_1 sqrt|s| sgn s + w,    wdot = -k_2 sgn s

with a disturbance |d delta/dt| <= L. The sampled law is implicit Euler in (z, w + delta):

    z + T k_1 sqrt|z| sgn z + T^2 k_2 zeta = s,    zeta in Sgn(z),
    nu = w - k_1 sqrt|z| sgn z - 2 T k_2 zeta,    w+ = w - T k_2 zeta

|s| <= T^2 k_2 gives z = 0; then the next s is T (delta_k - delta_{k-1}).
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import limited_acceleration, surface_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus


class Settings(fields.Settings, group='super_twisting'):
    """Settings of the law."""

    super_twisting_k_1: Axes = gain(15.0, 'Gain k_1 of the root', 'm^0.5/s^1.5')
    super_twisting_k_2: Axes = gain(110.0, 'Gain k_2 of the integral', 'm/s³')


class Memory(fields.Memory):
    """Memory of the law."""

    super_twisting_w: Axes = field('w, integral part of nu', 'm/s²')


@formula
def _within(value: float, bound: float) -> float:
    """Return a number limited to -bound ... bound."""
    return bound if value > bound else (-bound if value < -bound else value)


@formula
def surface_rate(s: float, w: float, k_1: float, k_2: float, period: float) -> float:
    """
    Return nu of one axis in m/s².

    Parameters
    ----------
    s
        Surface in m/s.
    w
        Integral part of nu in m/s².
    k_1, k_2
        Gains of the root and of the integral.
    period
        Control period T in s.

    """
    beyond = abs(s) - period * period * k_2
    beyond = beyond if beyond > 0.0 else 0.0
    half = 0.5 * period * k_1
    root = math.sqrt(half * half + beyond) - half
    return w - k_1 * root * sign(s) - 2.0 * _within(s / period, period * k_2)


@formula
def integrated(w: float, nu: float, k_2: float, period: float) -> float:
    """
    Return the next w of one axis in m/s² for the nu of the commanded torque.

    Half of w - nu, limited to T k_2, is T k_2 zeta of the requested nu. If the torque is limited,
    it is that of the surface for which the law would request the limited nu, as in the
    conditioned super-twisting algorithm.
    """
    return w - _within(0.5 * (w - nu), period * k_2)


@formula
def applied(tick: Tick, theta: Numbers, nu: Numbers, raw: Joints, torque: Joints) -> Numbers:
    """
    Return nu of the commanded torque.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base parameters of the model.
    nu
        Acceleration that the law requests, in m/s².
    raw, torque
        Joint torques that the law requests and that are commanded, in N·m.

    """
    return elementwise(plus, nu, limited_acceleration(tick, theta, raw, torque))


@formula
def _requested(settings: Settings, tick: Tick, memory: Memory) -> Numbers:
    """Return the integral term nu of the law."""
    return elementwise(
        surface_rate,
        tick.surface,
        memory.super_twisting_w,
        settings.super_twisting_k_1,
        settings.super_twisting_k_2,
        tick.period,
    )


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    nu = _requested(settings, tick, memory)
    return surface_torque(tick, memory.estimate, settings.sigma, nu)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Integrate w for the commanded torque."""
    nu = _requested(settings, tick, memory)
    w = elementwise(
        integrated,
        memory.super_twisting_w,
        applied(tick, memory.estimate, nu, raw, torque),
        settings.super_twisting_k_2,
        tick.period,
    )
    memory.super_twisting_w = w


SUPER_TWISTING = Law(
    'super_twisting',
    torque,
    (SIGMA, *Settings),
    Memory,
    learn,
    project,
    summary='second-order sliding mode: a root and an integral of the sign, error of order T²',
    source='Levant 1993; Seeber and Andritsch 2025',
    uses_switching=False,
)
