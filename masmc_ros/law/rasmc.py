# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Robust adaptive sliding mode control (17): the torque of `smc`, and the update law (23).

After the tick, theta_hat changes by an explicit Euler step of d theta_hat / dt = -Gamma^-1 Y' s.
`parts.adaptation` bounds the adaptation.
"""

from __future__ import annotations

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import adapt, GAMMA, project
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.reaching.reaching import correct, reach
from masmc_ros.law.smc import SMC
from masmc_ros.law.tick import Tick


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m, and store the reaching force."""
    u = reach(settings, tick, memory)
    memory.reaching = u
    return model_torque(tick, memory.estimate, u)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, held: Joints) -> None:
    """Correct the prediction of the reaching term, and adapt."""
    correct(settings, tick, memory, raw, held)
    adapt(settings, tick, memory, raw, held)


RASMC = Law(
    'rasmc',
    torque,
    (*SMC.parameters, GAMMA),
    learn=learn,
    post_update=project,
    summary='sliding mode control with adaptation of the base inertial parameters',
    source='(17) and (23) of the paper',
)
