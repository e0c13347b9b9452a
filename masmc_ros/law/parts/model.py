# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Model of the laws: theta_hat, its initial value, and its torque."""

from __future__ import annotations

from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.scalars import plus
from masmc_ros.numerics.tuples import elementwise
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism

PARAMETERS = (
    Parameter(
        'model_scale',
        0.5,
        'Nominal model, and initial theta_hat, as a multiple of the robot parameters',
        minimum=0.0,
        exclusive_minimum=True,
    ),
)

ESTIMATE = Field('estimate', 'parameters', 'theta_hat of the next tick')
"""Adapted parameters of any law; a change of law keeps them."""


@formula
def model_torque(tick: Tick, theta: Numbers, u: Numbers) -> Numbers:
    """
    Return the joint torques (joints) in N·m of Y theta + J' u.

    Parameters
    ----------
    tick
        State and reference, with the regressor Y(q, v, v_r, a_r).
    theta
        Base inertial parameters (parameters).
    u
        Force (axes) on the task axes in N.

    """
    model = mechanism.regressor_times(tick.model, tick.regressor, theta)
    force = mechanism.forces_from_task(tick.model, tick.posture, u, tick.velocity)
    return mechanism.joint_torques(tick.model, elementwise(plus, model, force))
