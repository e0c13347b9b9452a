# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Slip of the base's wheels, and the reduction of a gain by it.

Slip is the measured velocity of the base minus that of rolling wheels; it is zero if the base is
measured by its wheels. Slip is no disturbance of the robot: an estimate that followed it would
request ever more torque from a slipping wheel.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law.fields import Settings
from masmc_ros.law.parts.velocity_estimator import MEASURED
from masmc_ros.numerics.scalars import minus
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture

SLIP_BACKOFF = Parameter(
    'slip_backoff',
    0.0,
    'Slip of the wheels, in m/s and rad/s together, at which the disturbance estimate of the '
    'implicit law adapts at half its rate; 0: no reduction',
    unit='m/s',
    minimum=0.0,
    read_only=False,
)


@formula
def squared_slip(
    model: Lengths, posture: MechanismPosture, position_rates: Numbers, rates: Numbers
) -> float:
    """
    Return the squared velocity of the base relative to its rolling wheels, in (m/s)² and (rad/s)².

    Parameters
    ----------
    model, posture
        Lengths, and posture of the state.
    position_rates
        Measured derivative of the positions (positions), with that of the base.
    rates
        Measured joint rates (joints).

    """
    rolling = mechanism.position_rates(model, posture, rates)
    slip = elementwise(minus, position_rates, rolling)
    return dot(slip, slip)


@formula
def backed_off(
    settings: Settings,
    model: Lengths,
    posture: MechanismPosture,
    position_rates: Numbers,
    rates: Numbers,
    gain: float,
) -> float:
    """
    Return a gain reduced by slip: gain / (1 + (slip / slip_backoff)^2).

    It is not reduced if `slip_backoff` is 0, or without measured rates, because the slip is then
    unknown. Noise of measured rates appears as slip.

    Parameters
    ----------
    settings
        Settings of the law.
    model, posture
        Lengths, and posture of the state.
    position_rates
        Measured derivative of the positions (positions), with that of the base.
    rates
        Measured joint rates (joints).
    gain
        Gain of a disturbance estimate.

    """
    scale = settings.slip_backoff
    if (scale > 0.0) & (settings.velocity_source == MEASURED):
        return gain / (1.0 + squared_slip(model, posture, position_rates, rates) / (scale * scale))
    return gain
