# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Super-twisting of accelerations in implicit Euler, without chatter.

    sdot = nu,    nu = -k_1 sqrt|s| sgn s + w,    wdot = -k_2 sgn s

with s+ = s + T nu in place of s on the right. With b = s + T w, |b| <= T^2 k_2 gives s+ = 0;
otherwise s+ has the sign of b, and |s+| + T k_1 sqrt|s+| + T^2 k_2 = |b|.
"""

from __future__ import annotations

import math
from typing import Any

from masmc_ros.law.declared import PerEntry
from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import surface_torque
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.tuples import elementwise

PARAMETERS = (
    SIGMA,
    PerEntry('super_twisting.k_1', 'axes', 15.0, 'Gain k_1 of the root', 'm^0.5/s^1.5'),
    PerEntry('super_twisting.k_2', 'axes', 110.0, 'Gain k_2 of the integral', 'm/s³'),
)

MEMORY = (ESTIMATE, Field('super_twisting_w', 'axes', 'w, integral part of nu', 'm/s²'))


@formula
def following(s: float, w: float, k_1: float, k_2: float, period: float) -> float:
    """Return s+ of one axis in m/s, for s in m/s and w in m/s²."""
    b = s + period * w
    beyond = abs(b) - period * period * k_2
    beyond = beyond if beyond > 0.0 else 0.0
    half = 0.5 * period * k_1
    root = math.sqrt(half * half + beyond) - half
    return sign(b) * root * root


@formula
def surface_rate(s: float, s_next: float, period: float) -> float:
    """Return nu = (s+ - s) / T in m/s2."""
    return (s_next - s) / period


@formula
def integrated(w: float, s: float, s_next: float, k_2: float, period: float) -> float:
    """Return the next w in m/s²; on the surface it equals nu."""
    return -s / period if s_next == 0.0 else w - period * k_2 * sign(s_next)


@formula
def _following(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    return elementwise(
        following,
        tick.surface,
        get(memory, 'super_twisting_w', lane),
        get(settings, 'super_twisting_k_1', lane),
        get(settings, 'super_twisting_k_2', lane),
        tick.period,
    )


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    s_next = _following(settings, tick, memory, lane)
    nu = elementwise(surface_rate, tick.surface, s_next, tick.period)
    return surface_torque(
        tick, get(memory, 'estimate', lane), get(settings, 'sigma', lane), nu
    )


@formula
def learn(
    settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, torque: Numbers
) -> None:
    """Integrate, except while the torque is limited, to avoid wind-up."""
    if torque == raw:
        w = elementwise(
            integrated,
            get(memory, 'super_twisting_w', lane),
            tick.surface,
            _following(settings, tick, memory, lane),
            get(settings, 'super_twisting_k_2', lane),
            tick.period,
        )
        put(memory, 'super_twisting_w', lane, w)


SUPER_TWISTING = register(
    Law(
        'super_twisting',
        torque,
        PARAMETERS,
        MEMORY,
        learn,
        project,
        summary='second-order sliding mode: a root and an integral of the sign, implicit',
        source='Levant 1993; Brogliato, Polyakov and Efimov 2020',
        uses_switching=False,
    )
)
