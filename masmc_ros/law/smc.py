# SPDX-License-Identifier: Apache-2.0
"""Robust sliding mode control (15): tau = Y theta_hat + J' u, the estimate stays as it is."""

from __future__ import annotations

from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.reaching.reaching import correct, reach
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import Field, get
from masmc_ros.numerics.tuples import each
from masmc_ros.robot import mechanism

Numbers = tuple[float, ...]

ESTIMATE = Field('estimate', 'parameters', 'theta_hat of the next tick')
"""What was learned, whatever law learned it; a change of law takes it on."""


@formula
def _sum(a: float, b: float) -> float:
    return a + b


@formula
def model_torque(tick: Tick, theta: Numbers, u: Numbers) -> Numbers:
    """Return Y theta + J' u in N m: of a model, and of a force u (N) on the task's axes."""
    model = mechanism.regressor_times(tick.model, tick.regressor, theta)
    force = mechanism.forces_from_task(tick.model, tick.posture, u)
    return mechanism.joint_torques(tick.model, each(_sum, model, force))


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    u = reach(settings, tick, memory, lane)
    return model_torque(tick, get(memory, 'estimate', lane), u)


SMC = register(Law('smc', torque, memory=(ESTIMATE,), learn=correct, settle=project))
