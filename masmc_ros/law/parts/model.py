# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Model of the laws: theta_hat, its initial value, and its torque."""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import ESTIMATE as ESTIMATE
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
from masmc_ros.robot.moments import second_moments
import numpy as np

_ROUNDED = 1.0e-9
"""Tolerance for a negative smallest second moment, relative to the moments of inertia."""


def _is_inertia(moments: Numbers) -> bool:
    """Return True if a body has the moments of inertia xx, yy, zz, xy, yz, zx."""
    smallest = float(np.linalg.eigvalsh(second_moments(moments))[0])
    return smallest >= -_ROUNDED * (moments[0] + moments[1] + moments[2])


MODEL_SCALE = Parameter(
    'model_scale',
    0.5,
    'Nominal model, and initial theta_hat, as a multiple of the robot parameters',
    minimum=0.0,
    exclusive_minimum=True,
)

PAYLOAD_MASS = Parameter(
    'payload.mass',
    0.0,
    'Announced mass of a payload at the tip, part of the nominal model and of theta_hat',
    unit='kg',
    minimum=0.0,
    maximum=1000.0,
    read_only=False,
)

PAYLOAD_COM: Parameter[Numbers] = Parameter(
    'payload.com',
    (0.0, 0.0, 0.0),
    'Centre of mass of the payload in the frame of the tip',
    unit='m',
    length=3,
    minimum=-10.0,
    maximum=10.0,
    read_only=False,
)

PAYLOAD_INERTIA = Parameter(
    'payload.inertia',
    (0.0,) * 6,
    'Moments of inertia xx, yy, zz, xy, yz, zx of the payload about its centre of mass, in '
    'the directions of the frame of the tip',
    unit='kg·m²',
    length=6,
    minimum=-1000.0,
    maximum=1000.0,
    read_only=False,
    rule=_is_inertia,
    rule_text='6 moments of inertia of a body',
)

PARAMETERS = (MODEL_SCALE, PAYLOAD_MASS, PAYLOAD_COM, PAYLOAD_INERTIA)

PAYLOAD = (PAYLOAD_MASS.name, PAYLOAD_COM.name, PAYLOAD_INERTIA.name)
"""Parameters of the announced payload."""

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
