# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Super-twisting whose gains adapt to the disturbance.

    alpha' = rate sgn(|s| - zone),  alpha >= least,    beta = 2 epsilon alpha

are k_1 and k_2 of `super_twisting`, whose implicit step this law uses.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.declared import PerEntry
from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import surface_torque
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.sliding.super_twisting import following, integrated, surface_rate
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import plus
from masmc_ros.numerics.tuples import elementwise

PARAMETERS = (
    SIGMA,
    PerEntry(
        'adaptive_super_twisting.rate', 'axes', 100.0, 'Rate of the gain alpha', 'm^0.5/s^2.5'
    ),
    PerEntry(
        'adaptive_super_twisting.zone',
        'axes',
        0.02,
        'Part of |s| below which alpha decreases',
        'm/s',
        is_positive=True,
    ),
    PerEntry(
        'adaptive_super_twisting.least',
        'axes',
        2.0,
        'Smallest and initial alpha',
        'm^0.5/s^1.5',
        is_positive=True,
    ),
    PerEntry(
        'adaptive_super_twisting.epsilon',
        'axes',
        10.0,
        'Half the ratio of beta to alpha',
        'm^0.5/s^1.5',
    ),
)

MEMORY = (
    ESTIMATE,
    Field('adaptive_super_twisting_w', 'axes', 'w, integral part of nu', 'm/s²'),
    Field('adaptive_super_twisting_growth', 'axes', 'alpha beyond its least', 'm^0.5/s^1.5'),
)


@formula
def _beta(alpha: float, epsilon: float) -> float:
    return 2.0 * epsilon * alpha


@formula
def _gains(settings: Any, memory: Any, lane: int) -> tuple[Numbers, Numbers]:
    """Return alpha and beta."""
    alpha = elementwise(
        plus,
        get(settings, 'adaptive_super_twisting_least', lane),
        get(memory, 'adaptive_super_twisting_growth', lane),
    )
    return alpha, elementwise(_beta, alpha, get(settings, 'adaptive_super_twisting_epsilon', lane))


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    alpha, beta = _gains(settings, memory, lane)
    w = get(memory, 'adaptive_super_twisting_w', lane)
    s_next = elementwise(following, tick.surface, w, alpha, beta, tick.period)
    nu = elementwise(surface_rate, tick.surface, s_next, tick.period)
    return surface_torque(
        tick, get(memory, 'estimate', lane), get(settings, 'sigma', lane), nu
    )


@formula
def _grown(growth: float, s: float, rate: float, zone: float, period: float) -> float:
    """Return alpha minus its minimum, a period later."""
    moved = growth + (period * rate if abs(s) > zone else -period * rate)
    return moved if moved > 0.0 else 0.0


@formula
def learn(
    settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, torque: Numbers
) -> None:
    """Integrate and adapt the gains, except while the torque is limited."""
    if torque == raw:
        alpha, beta = _gains(settings, memory, lane)
        w = get(memory, 'adaptive_super_twisting_w', lane)
        s_next = elementwise(following, tick.surface, w, alpha, beta, tick.period)
        w = elementwise(integrated, w, tick.surface, s_next, beta, tick.period)
        put(memory, 'adaptive_super_twisting_w', lane, w)
        growth = elementwise(
            _grown,
            get(memory, 'adaptive_super_twisting_growth', lane),
            tick.surface,
            get(settings, 'adaptive_super_twisting_rate', lane),
            get(settings, 'adaptive_super_twisting_zone', lane),
            tick.period,
        )
        put(memory, 'adaptive_super_twisting_growth', lane, growth)


ADAPTIVE_SUPER_TWISTING = register(
    Law(
        'adaptive_super_twisting',
        torque,
        PARAMETERS,
        MEMORY,
        learn,
        project,
        summary='super-twisting whose gains grow until s stays near the surface, and fall there',
        source='Shtessel, Taleb and Plestan 2012',
        uses_switching=False,
    )
)
