# SPDX-License-Identifier: Apache-2.0
"""Dense matrices of one tick for laws in plain Python, made by the formulas of `robot/`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.compiled import kernel
from masmc_ros.control.laws.plug_in import TickInput
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.task_terms import surface_and_reference, task_inertia
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.dynamics import (
    BaseParameters,
    inertia,
    inertia_times,
    regressor,
    regressor_times,
)
from masmc_ros.robot.geometry import joint_torque, posture, quasi_velocity, reduced_velocity
from masmc_ros.robot.kinematics import is_singular, quasi_from_task, task_velocity


@kernel
def _dense(
    geometry: Any,
    nominal: Any,
    position: Any,
    velocity: Any,
    reference: Any,
    sigma: Any,
    error: Any,
    surface: Any,
    v_r: Any,
    a_r: Any,
    jacobian: Any,
    inverse: Any,
    reduced_inertia: Any,
    inertia_x: Any,
    y_matrix: Any,
) -> bool:
    lengths = as_geometry(geometry)
    bend = posture(position[2], position[5], position[6])
    v = quasi_velocity(lengths, velocity[3], velocity[4], velocity[5], velocity[6])
    v_ref, a_ref = surface_and_reference(
        lengths, bend, v, position, reference, sigma, error, surface
    )
    h = inertia(as_base_parameters(nominal), lengths, bend)
    task_inertia(as_base_parameters(nominal), lengths, bend, inertia_x)
    reduced = reduced_velocity(lengths, v_ref[0], v_ref[1], v_ref[2], v_ref[3])
    reduced_dot = reduced_velocity(lengths, a_ref[0], a_ref[1], a_ref[2], a_ref[3])
    y = regressor(lengths, bend, v, v_ref, a_ref)
    for j in range(AXES):
        v_r[j] = reduced[j]
        a_r[j] = reduced_dot[j]
        e0 = 1.0 if j == 0 else 0.0
        e1 = 1.0 if j == 1 else 0.0
        e2 = 1.0 if j == 2 else 0.0
        e3 = 1.0 if j == 3 else 0.0
        q = quasi_velocity(lengths, e0, e1, e2, e3)
        x = task_velocity(lengths, bend, q[0], q[1], q[2], q[3])
        f = inertia_times(h, q[0], q[1], q[2], q[3])
        tau = joint_torque(lengths, f[0], f[1], f[2], f[3])
        back = quasi_from_task(lengths, bend, e0, e1, e2, e3)
        column = reduced_velocity(lengths, back[0], back[1], back[2], back[3])
        for i in range(AXES):
            jacobian[i, j] = x[i]
            reduced_inertia[i, j] = tau[i]
            inverse[i, j] = column[i]
    for j in range(BASE_PARAMETERS):
        unit = BaseParameters(
            1.0 if j == 0 else 0.0,
            1.0 if j == 1 else 0.0,
            1.0 if j == 2 else 0.0,
            1.0 if j == 3 else 0.0,
            1.0 if j == 4 else 0.0,
            1.0 if j == 5 else 0.0,
            1.0 if j == 6 else 0.0,
        )
        f = regressor_times(y, unit)
        tau = joint_torque(lengths, f[0], f[1], f[2], f[3])
        for i in range(AXES):
            y_matrix[i, j] = tau[i]
    return is_singular(bend)


def tick_input(
    geometry: NDArray[np.float64],
    nominal: NDArray[np.float64],
    period: float,
    gains: Mapping[str, Any],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    reference: NDArray[np.float64],
    estimate: NDArray[np.float64],
    commanded: NDArray[np.float64],
) -> TickInput:
    """Return what a law in plain Python is given: state, reference and dense matrices."""
    error, surface, v_r, a_r = (np.empty(AXES) for _ in range(4))
    jacobian, inverse, reduced, inertia_x = (np.empty((AXES, AXES)) for _ in range(4))
    y_matrix = np.empty((AXES, BASE_PARAMETERS))
    sigma = gains['sigma']
    singular = _dense(
        geometry,
        nominal,
        position,
        velocity,
        reference,
        sigma,
        error,
        surface,
        v_r,
        a_r,
        jacobian,
        inverse,
        reduced,
        inertia_x,
        y_matrix,
    )
    return TickInput(
        period=period,
        gains=gains,
        position=position.copy(),
        velocity=velocity.copy(),
        reference=reference.reshape(3, AXES).copy(),
        error=error,
        error_rate=surface - sigma * error,
        surface=surface,
        reference_velocity=v_r,
        reference_acceleration=a_r,
        jacobian=jacobian,
        inverse_jacobian=inverse,
        inertia=reduced,
        task_inertia=inertia_x,
        regressor=y_matrix,
        estimate=estimate.copy(),
        commanded=commanded.copy(),
        singular=bool(singular),
    )
