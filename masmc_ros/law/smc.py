# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robust sliding mode control (15): tau = Y theta_hat + J' u, with a constant estimate."""

from __future__ import annotations

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.reaching import correct, GAINS, reach
from masmc_ros.law.tick import Tick


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    u = reach(settings, tick, memory)
    return model_torque(tick, memory.estimate, u)


SMC = Law(
    'smc',
    torque,
    (*GAINS, SIGMA),
    learn=correct,
    post_update=project,
    summary='sliding mode control with the nominal model',
    source='(15) of the paper',
)
