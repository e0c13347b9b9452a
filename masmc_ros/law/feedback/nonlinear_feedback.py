# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Nonlinear feedback: inverse model, with task errors that decay like those of springs.

    xddot_c = xddot_d - K_d edot - K_p e - K_i w,    wdot = e
    tau = H J^-1 (xddot_c - Jdot v) + V v

is known as computed torque in task space (reference [1] of the paper). In [4] it decouples inputs
from outputs, which is equivalent for equal numbers of inputs and outputs. K_i is an addition; the
source has 0.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.law.declared import PerEntry
from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.integral import integrated
from masmc_ros.law.parts.inverse_dynamics import (
    acceleration_torque,
    limited_acceleration,
    spring,
)
from masmc_ros.law.parts.model import ESTIMATE
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.tuples import elementwise

PARAMETERS = (
    PerEntry('nonlinear_feedback.k_p', 'axes', 100.0, 'Stiffness K_p per mass', '1/s²'),
    PerEntry('nonlinear_feedback.k_d', 'axes', 20.0, 'Damping K_d per mass', '1/s'),
    PerEntry('nonlinear_feedback.k_i', 'axes', 0.0, 'Gain K_i of the integral', '1/s³'),
)

MEMORY = (
    ESTIMATE,
    Field('nonlinear_feedback_integral', 'axes', 'w, integral of the error', 'm·s'),
)


@formula
def _with_integral(acceleration: float, k_i: float, w: float) -> float:
    """Return xddot_c of one axis."""
    return acceleration - k_i * w


@formula
def torque(settings: Any, tick: Tick, memory: Any, lane: int) -> Numbers:
    """Return the joints' torques in N m."""
    acceleration = elementwise(
        _with_integral,
        spring(
            tick,
            get(settings, 'nonlinear_feedback_k_d', lane),
            get(settings, 'nonlinear_feedback_k_p', lane),
        ),
        get(settings, 'nonlinear_feedback_k_i', lane),
        get(memory, 'nonlinear_feedback_integral', lane),
    )
    return acceleration_torque(tick, tick.nominal, acceleration)


@formula
def learn(
    settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, torque: Numbers
) -> None:
    """Integrate the error, with back-calculation from the commanded torque."""
    w = elementwise(
        integrated,
        get(memory, 'nonlinear_feedback_integral', lane),
        tick.error,
        limited_acceleration(tick, tick.nominal, raw, torque),
        get(settings, 'nonlinear_feedback_k_p', lane),
        get(settings, 'nonlinear_feedback_k_i', lane),
        tick.period,
    )
    put(memory, 'nonlinear_feedback_integral', lane, w)


NONLINEAR_FEEDBACK = register(
    Law(
        'nonlinear_feedback',
        torque,
        PARAMETERS,
        MEMORY,
        learn,
        project,
        summary='the model inverted in task space, with PD feedback (and an integral)',
        source='[1] of the paper; computed torque in task space',
        uses_switching=False,
    )
)
