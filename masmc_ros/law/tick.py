# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a law at a tick: state, reference, and sliding surface."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import inlined
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.fields import Settings
from masmc_ros.law.parts import moving_base
from masmc_ros.law.parts.surface import reference_acceleration, reference_velocity, sliding_surface
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture, MechanismRegressor


class Tick(NamedTuple):
    """Inputs of a tick; vectors are tuples, velocities those of `robot.mechanism`."""

    period: float  # T in s
    model: Lengths  # lengths
    posture: MechanismPosture  # of the measured state
    nominal: Numbers  # theta of the nominal model
    velocity: Numbers  # v
    reference_velocity: Numbers  # v_r
    reference_acceleration: Numbers  # a_r
    position: Numbers  # measured
    position_rates: Numbers  # measured, including those of the base
    desired_velocity: Numbers  # xdot_d of the task
    desired_acceleration: Numbers  # xddot_d
    error: Numbers  # e of the task, x - x_d
    error_derivative: Numbers  # de/dt
    error_rate: Numbers  # task velocity minus the desired one; edot if e = x - x_d
    surface: Numbers  # s = edot + sigma e, reduced if v_r cannot be J^-1 xdot_r
    regressor: MechanismRegressor  # Y(q, v, v_r, a_r)
    command: Numbers  # velocities of a base that follows them
    is_singular: bool  # True if J is close to singular, and v_r and a_r are damped


@inlined
def tick_of(
    settings: Settings,
    posture: MechanismPosture,
    v: Numbers,
    position: Numbers,
    position_rates: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
    drift: Numbers,
    commanded: Numbers,
) -> Tick:
    """
    Return the tick of a measured state with velocities v, and of x_d, xdot_d and xddot_d.

    (14) gives xdot_r and xddot_r. The mechanism determines v_r and a_r with J v_r = xdot_r, and
    estimates the `drift`. A base that follows velocities was `commanded` those of the last tick.
    """
    model = mechanism.model_of(settings)
    sigma = settings.sigma
    follows = mechanism.tracking(model, posture, position, v, desired)
    v_r, a_r, is_singular = mechanism.reference_motion(
        model,
        posture,
        position,
        v,
        elementwise(reference_velocity, follows.velocity, follows.error, sigma),
        elementwise(reference_acceleration, follows.acceleration, follows.error_derivative, sigma),
    )
    a_r = mechanism.compensated(model, a_r, drift)
    v_r, a_r, command = moving_base.carried(settings, posture, v, v_r, a_r, commanded)
    surface = elementwise(sliding_surface, follows.error, follows.velocity_error, sigma)
    return Tick(
        settings.period,
        model,
        posture,
        settings.nominal,
        v,
        v_r,
        a_r,
        position,
        position_rates,
        follows.velocity,
        follows.acceleration,
        follows.error,
        follows.error_derivative,
        follows.velocity_error,
        moving_base.surface(settings, posture, v, v_r, surface),
        mechanism.regressor(model, posture, v, v_r, a_r),
        command,
        is_singular,
    )

