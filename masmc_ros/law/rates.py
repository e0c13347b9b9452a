# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Kinematic law of commanded rates, for drives with a separate velocity loop.

If the drives follow v_r, the error decays as on the sliding surface, edot = -sigma e. The command
v_r + T a_r / 2 is v_r in the middle of the period for which it is held.
"""

from __future__ import annotations

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import zero
from masmc_ros.robot import mechanism


@formula
def _ahead(velocity: float, acceleration: float, time: float) -> float:
    """Return a velocity `time` s later."""
    return velocity + time * acceleration


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return zero torque; write the command of the drives into the memory."""
    half = 0.5 * tick.period
    v = elementwise(_ahead, tick.reference_velocity, tick.reference_acceleration, half)
    memory.velocity_command = mechanism.rate_command(tick.model, v)
    return elementwise(zero, memory.commanded)


RATES = Law('rates', torque, (SIGMA,), post_update=project, uses_switching=False)
