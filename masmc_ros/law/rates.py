# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The kinematic law of commanded rates, for drives that have a velocity loop of their own.

Drives that follow v_r let the error decay as on the sliding surface, edot = -sigma e. The
command v_r + T a_r / 2 is held for a period, whose middle its second term looks ahead to.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import zero
from masmc_ros.numerics.tuples import elementwise
from masmc_ros.robot import mechanism


@formula
def _ahead(velocity: float, acceleration: float, time: float) -> float:
    """Return a velocity so much later."""
    return velocity + time * acceleration


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return no torque; write the command as the drives take it to the memory."""
    half = 0.5 * tick.period
    v = elementwise(_ahead, tick.reference_velocity, tick.reference_acceleration, half)
    put(memory, 'velocity_command', lane, mechanism.rate_command(tick.model, v))
    return elementwise(zero, get(memory, 'commanded', lane))


RATES = register(
    Law('rates', torque, (SIGMA,), (ESTIMATE,), post_update=project, uses_switching=False)
)
