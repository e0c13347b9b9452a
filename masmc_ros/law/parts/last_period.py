# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Acceleration of the robot in the last period, measured and according to the model.

`before` is v (joints) at the previous tick. Without a previous tick it is NaN, and so are the
results.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, subroutine
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.tick import Tick
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import MechanismRegressor


@formula
def _rate(value: float, before: float, period: float) -> float:
    return (value - before) / period


@formula
def _middle(value: float, before: float) -> float:
    return 0.5 * (value + before)


@formula
def last_acceleration(tick: Tick, before: Numbers) -> Numbers:
    """Return dv/dt (joints) over the last period: (v - before) / T."""
    return elementwise(_rate, tick.velocity, before, tick.period)


@subroutine
def last_regressor(tick: Tick, before: Numbers) -> MechanismRegressor:
    """
    Return W = Y(q, v, v, dv/dt) of the last period, where v is the mean velocity of the period.

    The forces in the period were W theta.
    """
    v = elementwise(_middle, tick.velocity, before)
    return mechanism.regressor(tick.model, tick.posture, v, v, last_acceleration(tick, before))
