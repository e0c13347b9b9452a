# SPDX-License-Identifier: Apache-2.0
"""What a tick's law is made of: surface and reference state, H_x, torque and gradient."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula
from masmc_ros.control.surface import (
    reference_acceleration,
    reference_velocity,
    sliding_surface,
)
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.dynamics import (
    BaseParameters,
    inertia,
    inertia_times,
    Quad,
    Regressor,
    regressor_times,
    regressor_transpose_times,
)
from masmc_ros.robot.geometry import Geometry, joint_torque, Posture
from masmc_ros.robot.kinematics import (
    quasi_force_from_task,
    quasi_from_task,
    task_drift,
    task_force_from_quasi,
    task_position,
    task_velocity,
)


@formula
def surface_and_reference(
    geometry: Geometry,
    bend: Posture,
    v: Quad,
    position: Any,
    reference: Any,
    sigma: Any,
    error: Any,
    surface: Any,
) -> tuple[Quad, Quad]:
    """Write e and s (4) and return v_r and a_r; all velocities are quasi-velocities.

    `reference` (12) holds x_d, xdot_d and xddot_d; v_r = J^-1 xdot_r and
    a_r = J^-1 (xddot_r - Jdot v_r).
    """
    x = task_position(geometry, bend, position[0], position[1])
    x_dot = task_velocity(geometry, bend, v[0], v[1], v[2], v[3])
    # Axis by axis; the tuples are spelled out because compiled tuples have no loops.
    error[0] = x[0] - reference[0]
    error[1] = x[1] - reference[1]
    error[2] = x[2] - reference[2]
    error[3] = x[3] - reference[3]
    rate_0 = x_dot[0] - reference[4]
    rate_1 = x_dot[1] - reference[5]
    rate_2 = x_dot[2] - reference[6]
    rate_3 = x_dot[3] - reference[7]
    surface[0] = sliding_surface(error[0], rate_0, sigma[0])
    surface[1] = sliding_surface(error[1], rate_1, sigma[1])
    surface[2] = sliding_surface(error[2], rate_2, sigma[2])
    surface[3] = sliding_surface(error[3], rate_3, sigma[3])
    v_r = quasi_from_task(
        geometry,
        bend,
        reference_velocity(reference[4], error[0], sigma[0]),
        reference_velocity(reference[5], error[1], sigma[1]),
        reference_velocity(reference[6], error[2], sigma[2]),
        reference_velocity(reference[7], error[3], sigma[3]),
    )
    drift = task_drift(geometry, bend, v, v_r)
    a_r = quasi_from_task(
        geometry,
        bend,
        reference_acceleration(reference[8], rate_0, sigma[0]) - drift[0],
        reference_acceleration(reference[9], rate_1, sigma[1]) - drift[1],
        reference_acceleration(reference[10], rate_2, sigma[2]) - drift[2],
        reference_acceleration(reference[11], rate_3, sigma[3]) - drift[3],
    )
    return v_r, a_r


@formula
def task_inertia(
    theta: BaseParameters, geometry: Geometry, bend: Posture, matrix: Any
) -> None:
    """Write H_x = J^-T H J^-1 of (11), 4 x 4 in kg."""
    h = inertia(theta, geometry, bend)
    for j in range(AXES):
        v = quasi_from_task(
            geometry,
            bend,
            1.0 if j == 0 else 0.0,
            1.0 if j == 1 else 0.0,
            1.0 if j == 2 else 0.0,
            1.0 if j == 3 else 0.0,
        )
        f = inertia_times(h, v[0], v[1], v[2], v[3])
        column = task_force_from_quasi(geometry, bend, f[0], f[1], f[2], f[3])
        matrix[0, j] = column[0]
        matrix[1, j] = column[1]
        matrix[2, j] = column[2]
        matrix[3, j] = column[3]


@formula
def torque_and_gradient(
    geometry: Geometry,
    bend: Posture,
    y: Regressor,
    estimate: BaseParameters,
    surface: Any,
    reaching: Any,
    torque: Any,
    gradient: Any,
) -> None:
    """Write tau = Y theta_hat + J' u (4, N m) and the gradient Y' J^-1 s (7) of (23)."""
    model = regressor_times(y, estimate)
    force = quasi_force_from_task(
        geometry, bend, reaching[0], reaching[1], reaching[2], reaching[3]
    )
    tau = joint_torque(
        geometry,
        model[0] + force[0],
        model[1] + force[1],
        model[2] + force[2],
        model[3] + force[3],
    )
    for i in range(AXES):
        torque[i] = tau[i]
    w = quasi_from_task(geometry, bend, surface[0], surface[1], surface[2], surface[3])
    slope = regressor_transpose_times(y, w[0], w[1], w[2], w[3])
    for j in range(BASE_PARAMETERS):
        gradient[j] = slope[j]
