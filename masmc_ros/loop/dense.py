# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Dense matrices of one tick for laws in plain Python, computed with the formulas of `robot/`."""

from __future__ import annotations

from masmc_ros.law.plug_in import TickInput
from masmc_ros.law.tick import tick_of
from masmc_ros.numerics.aliases import Axes, Columns, Joints, Numbers, Records
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.lanes import lane_of
from masmc_ros.numerics.scalars import zero
from masmc_ros.numerics.tuples import elementwise, from_index, tail, thirds, unit
from masmc_ros.params.declaration import Values
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import (
    Lengths,
    MechanismInertia,
    MechanismPosture,
    MechanismRegressor,
)
import numpy as np
from numpy.typing import NDArray

_Inputs = tuple[Axes, Axes, Joints, Joints, Columns, Columns, Columns, Columns, Columns, bool]
"""Vectors, matrices by their columns, and True close to a singularity."""


@formula
def _reduced_inertia_column(
    arguments: tuple[Lengths, MechanismInertia, Numbers], j: int
) -> Numbers:
    model, h, template = arguments
    f = mechanism.inertia_times(model, h, mechanism.motion(model, unit(template, j)))
    return mechanism.joint_torques(model, f)


@formula
def _jacobian_column(arguments: tuple[Lengths, MechanismPosture, Numbers], j: int) -> Numbers:
    model, posture, template = arguments
    return mechanism.task_velocity(model, posture, mechanism.motion(model, unit(template, j)))


@formula
def _inverse_column(
    arguments: tuple[Lengths, MechanismPosture, Numbers, Numbers], j: int
) -> Numbers:
    model, posture, axes, template = arguments
    v = mechanism.motion_from_task(model, posture, unit(axes, j), template)
    return mechanism.joint_rates(model, v)


@formula
def _regressor_column(arguments: tuple[Lengths, MechanismRegressor, Numbers], j: int) -> Numbers:
    model, y, template = arguments
    f = mechanism.regressor_times(model, y, unit(template, j))
    return mechanism.joint_torques(model, f)


@kernel
def dense(settings: Records, row: Records) -> _Inputs:
    """Return the inputs of a plain Python law as vectors and matrix columns, for `tick_input`."""
    gains, signals = lane_of(settings[0], 0), lane_of(row[0], 0)
    position, velocity = signals.position, signals.velocity
    model = mechanism.model_of(gains)
    posture = mechanism.posture(model, position)
    rates = tail(velocity, signals.torque)
    v = mechanism.motion(model, rates)
    desired, nothing = thirds(signals.reference), elementwise(zero, v)
    tick = tick_of(gains, posture, v, position, velocity, desired, nothing, nothing)
    h = mechanism.inertia(model, posture, tick.nominal)
    return (
        tick.error,
        tick.surface,
        mechanism.joint_rates(model, tick.reference_velocity),
        mechanism.joint_rates(model, tick.reference_acceleration),
        from_index(_jacobian_column, rates, (model, posture, rates)),
        from_index(_inverse_column, tick.error, (model, posture, tick.error, rates)),
        from_index(_reduced_inertia_column, rates, (model, h, rates)),
        mechanism.task_inertia(model, posture, tick.nominal, tick.error),
        from_index(_regressor_column, tick.nominal, (model, tick.regressor, tick.nominal)),
        tick.is_singular,
    )


def tick_input(
    settings: NDArray[np.void],
    signals: NDArray[np.void],
    gains: Values,
    estimate: NDArray[np.float64],
    commanded: NDArray[np.float64],
) -> TickInput:
    """
    Return the input of a law in plain Python: state, reference and dense matrices.

    Parameters
    ----------
    settings
        Settings (1) of a built-in law, with the current parameters.
    signals
        Signals (1) with the state and the reference.
    gains
        All parameters by name.
    estimate
        theta_hat (parameters).
    commanded
        Torque (joints) of the last tick in N·m.

    """
    error, surface, v_r, a_r, jacobian, inverse, inertia, task_inertia, y, singular = dense(
        settings, signals
    )
    return TickInput(
        period=float(settings['period'][0, 0]),
        gains=gains,
        position=signals['position'][0, :, 0].copy(),
        velocity=signals['velocity'][0, :, 0].copy(),
        reference=signals['reference'][0].reshape(3, -1).copy(),
        error=np.array(error),
        error_rate=np.array(surface) - gains['sigma'] * np.array(error),
        surface=np.array(surface),
        reference_velocity=np.array(v_r),
        reference_acceleration=np.array(a_r),
        jacobian=np.array(jacobian).T,
        inverse_jacobian=np.array(inverse).T,
        inertia=np.array(inertia).T,
        task_inertia=np.array(task_inertia).T,
        regressor=np.array(y).T,
        estimate=estimate.copy(),
        commanded=commanded.copy(),
        singular=bool(singular),
    )
