# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Robust adaptive sliding mode control (17): the torque of `smc`, and the update law (23).

After the tick, theta_hat changes by an explicit Euler step of d theta_hat / dt = -Gamma^-1 Y' s.
`parts.adaptation` bounds the adaptation.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import adapt, GAMMA, project
from masmc_ros.law.reaching.reaching import correct
from masmc_ros.law.smc import SMC, torque
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula


@formula
def learn(settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, held: Numbers) -> None:
    """Correct the prediction of the reaching term, and adapt."""
    correct(settings, tick, memory, lane, raw, held)
    adapt(settings, tick, memory, lane, raw, held)


RASMC = register(
    Law(
        'rasmc',
        torque,
        (*SMC.parameters, GAMMA),
        SMC.memory,
        learn,
        project,
        summary='sliding mode control with adaptation of the base inertial parameters',
        source='(17) and (23) of the paper',
    )
)
