# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Dense matrices of one tick for laws in plain Python, computed with the formulas of `robot/`."""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers, Records
from masmc_ros.jit.arrays import write_columns, write_part
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.tuples import elementwise, from_index, tail, thirds, unit
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.law.plug_in import TickInput
from masmc_ros.law.tick import tick_of
from masmc_ros.numerics.scalars import zero
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
def dense(
    settings: Records,
    row: Records,
    of_axes: Array,
    of_joints: Array,
    jacobian: Array,
    inverse: Array,
    inertia: Array,
    task_inertia: Array,
    regressor: Array,
) -> bool:
    """
    Write the inputs of a plain Python law for `tick_input`; return True close to a singularity.

    Parameters
    ----------
    settings, row
        Settings (1) of a built-in law, and signals (1) with the state and the reference.
    of_axes
        Output (2, axes): error and surface.
    of_joints
        Output (2, joints): v_r and a_r as joint rates and their derivatives.
    jacobian, inverse, inertia, task_inertia, regressor
        Output: matrices (columns, rows), see `arrays_of`.

    """
    gains, signals = lane_of(settings[0], 0), lane_of(row[0], 0)
    position, velocity = signals.position, signals.velocity
    model = mechanism.model_of(gains)
    posture = mechanism.posture(model, position)
    rates = tail(velocity, signals.torque)
    v = mechanism.motion(model, rates)
    desired, nothing = thirds(signals.reference), elementwise(zero, v)
    tick = tick_of(gains, posture, v, position, velocity, desired, nothing, nothing)
    h = mechanism.inertia(model, posture, tick.nominal)
    write_part(of_axes, 0, 0, tick.error)
    write_part(of_axes, 1, 0, tick.surface)
    write_part(of_joints, 0, 0, mechanism.joint_rates(model, tick.reference_velocity))
    write_part(of_joints, 1, 0, mechanism.joint_rates(model, tick.reference_acceleration))
    write_columns(from_index(_jacobian_column, rates, (model, posture, rates)), jacobian)
    write_columns(
        from_index(_inverse_column, tick.error, (model, posture, tick.error, rates)), inverse
    )
    write_columns(from_index(_reduced_inertia_column, rates, (model, h, rates)), inertia)
    write_columns(
        mechanism.task_inertia(model, posture, tick.nominal, tick.error), task_inertia
    )
    write_columns(
        from_index(_regressor_column, tick.nominal, (model, tick.regressor, tick.nominal)),
        regressor,
    )
    check_workspace(gains)
    return tick.is_singular


def arrays_of(settings: Records, signals: Records) -> tuple[Array, ...]:
    """Return the output arrays of `dense` for settings and signals of a robot."""
    axes, joints = signals['error'].shape[1], signals['torque'].shape[1]
    parameters = settings['nominal'].shape[1]
    shapes = (
        (2, axes), (2, joints), (joints, axes), (axes, joints), (joints, joints), (axes, axes),
        (parameters, joints),
    )  # fmt: skip
    return tuple(np.empty(shape) for shape in shapes)


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
    arrays = arrays_of(settings, signals)
    singular = dense(settings, signals, *arrays)
    (error, surface), (v_r, a_r), jacobian, inverse, inertia, task_inertia, y = arrays
    return TickInput(
        period=float(settings['period'][0, 0]),
        gains=gains,
        position=signals['position'][0, :, 0].copy(),
        velocity=signals['velocity'][0, :, 0].copy(),
        reference=signals['reference'][0].reshape(3, -1).copy(),
        error=error,
        error_rate=surface - gains['sigma'] * error,
        surface=surface,
        reference_velocity=v_r,
        reference_acceleration=a_r,
        jacobian=jacobian.T,
        inverse_jacobian=inverse.T,
        inertia=inertia.T,
        task_inertia=task_inertia.T,
        regressor=y.T,
        estimate=estimate.copy(),
        commanded=commanded.copy(),
        singular=bool(singular),
    )
