# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
PID control in task space, without a model: spring, damper and integral on each axis.

    tau = J' u,    u = -K_p e - K_d edot - K_i w,    wdot = e
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.declared import PerEntry
from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.integral import integrated
from masmc_ros.law.parts.inverse_dynamics import limited_force, task_force_torque
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.tuples import elementwise

PARAMETERS = (
    PerEntry('pid.k_p', 'axes', 2000.0, 'Stiffness K_p', 'N/m'),
    PerEntry('pid.k_d', 'axes', 200.0, 'Damping K_d', 'N·s/m'),
    PerEntry('pid.k_i', 'axes', 5000.0, 'Gain K_i of the integral', 'N/(m·s)'),
)

MEMORY = (ESTIMATE, Field('pid_integral', 'axes', 'w, integral of the error', 'm·s'))


@formula
def _force(error: float, rate: float, w: float, k_p: float, k_d: float, k_i: float) -> float:
    """Return u of one axis in N."""
    return -k_p * error - k_d * rate - k_i * w


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    u = elementwise(
        _force,
        tick.error,
        tick.error_rate,
        get(memory, 'pid_integral', lane),
        get(settings, 'pid_k_p', lane),
        get(settings, 'pid_k_d', lane),
        get(settings, 'pid_k_i', lane),
    )
    return task_force_torque(tick, u)


@formula
def learn(
    settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, torque: Numbers
) -> None:
    """Integrate the error, with back-calculation from the commanded torque."""
    w = elementwise(
        integrated,
        get(memory, 'pid_integral', lane),
        tick.error,
        limited_force(tick, raw, torque),
        get(settings, 'pid_k_p', lane),
        get(settings, 'pid_k_i', lane),
        tick.period,
    )
    put(memory, 'pid_integral', lane, w)


PID = register(
    Law(
        'pid',
        torque,
        PARAMETERS,
        MEMORY,
        learn,
        project,
        summary='a spring, a damper and an integral on each axis of the task, without a model',
        source='Takegaki and Arimoto 1981; Arimoto and Miyazaki 1984',
        uses_switching=False,
    )
)
