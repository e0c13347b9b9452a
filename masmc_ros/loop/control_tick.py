# SPDX-License-Identifier: Apache-2.0
"""One tick of the sampled control law: state and reference in, torque out."""

from __future__ import annotations

from typing import Any

import numpy as np

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.implicit import disturbance_estimate, implicit_reaching
from masmc_ros.control.laws.update import updated_estimate
from masmc_ros.control.reaching import explicit_reaching, IMPLICIT
from masmc_ros.control.surface import (
    reference_acceleration,
    reference_velocity,
    sliding_surface,
)
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.dynamics import (
    BaseParameters,
    inertia,
    inertia_times,
    Quad,
    Regressor,
    regressor,
    regressor_times,
    regressor_transpose_times,
)
from masmc_ros.robot.geometry import Geometry, joint_torque, Posture, posture, quasi_velocity
from masmc_ros.robot.kinematics import (
    is_singular,
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
    position: Any,
    velocity: Any,
    reference: Any,
    sigma: Any,
    error: Any,
    surface: Any,
) -> tuple[Quad, Quad, Quad]:
    """Write e and s (4) and return v, v_r and a_r as quasi-velocities.

    `reference` (12) holds x_d, xdot_d and xddot_d; v_r = J^-1 xdot_r and
    a_r = J^-1 (xddot_r - Jdot v_r).
    """
    v = quasi_velocity(geometry, velocity[3], velocity[4], velocity[5], velocity[6])
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
    return v, v_r, a_r


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


@formula
def control(
    geometry: Geometry,
    nominal: BaseParameters,
    period: float,
    law: int,
    switching: int,
    k_s1: Any,
    k_s2: Any,
    sigma: Any,
    gamma: Any,
    boundary_layer: float,
    observer_gain: float,
    position: Any,
    velocity: Any,
    reference: Any,
    estimate: Any,
    disturbance: Any,
    predicted: Any,
    torque: Any,
    error: Any,
    surface: Any,
    reaching: Any,
    gradient: Any,
    matrix: Any,
    work: Any,
    zeta: Any,
) -> bool:
    """Compute one tick; see `control_tick`. The last five arrays are workspace."""
    bend = posture(position[2], position[5], position[6])
    v, v_r, a_r = surface_and_reference(
        geometry, bend, position, velocity, reference, sigma, error, surface
    )
    if switching == IMPLICIT:
        task_inertia(nominal, geometry, bend, matrix)
        disturbance_estimate(
            AXES, matrix, surface, predicted, observer_gain / period, disturbance
        )
        implicit_reaching(
            AXES, matrix, period, k_s1, k_s2, surface, predicted, zeta, work
        )
        for i in range(AXES):
            reaching[i] = -(k_s1[i] * predicted[i] + k_s2[i] * zeta[i]) - disturbance[i]
    else:
        for i in range(AXES):
            reaching[i] = explicit_reaching(
                switching, surface[i], k_s1[i], k_s2[i], boundary_layer
            )
    y = regressor(geometry, bend, v, v_r, a_r)
    torque_and_gradient(
        geometry,
        bend,
        y,
        as_base_parameters(estimate),
        surface,
        reaching,
        torque,
        gradient,
    )
    for j in range(BASE_PARAMETERS):
        estimate[j] = updated_estimate(law, estimate[j], gradient[j], gamma[j], period)
    return is_singular(bend)


@kernel
def control_tick(
    geometry: Any,
    nominal: Any,
    period: float,
    law: int,
    switching: int,
    k_s1: Any,
    k_s2: Any,
    sigma: Any,
    gamma: Any,
    boundary_layer: float,
    observer_gain: float,
    position: Any,
    velocity: Any,
    reference: Any,
    estimate: Any,
    disturbance: Any,
    predicted: Any,
    torque: Any,
    error: Any,
    surface: Any,
) -> bool:
    """Compute the torque of one tick; True where the arm is close to singular.

    In: lengths (5), nominal theta (7), period in s, positions of law and switching in their
    lists, gains per axis (4) and per parameter (7), state as positions and velocities (7, in
    the order of joint_states), reference (12: x_d, xdot_d, xddot_d).
    In and out: theta_hat (7), disturbance estimate d (4, N) and s+ (4, m/s, not-a-number
    where there is none), which the next tick takes up.
    Out: torque (4, N m), e (4, m) and s (4, m/s).
    """
    return control(
        as_geometry(geometry),
        as_base_parameters(nominal),
        period,
        law,
        switching,
        k_s1,
        k_s2,
        sigma,
        gamma,
        boundary_layer,
        observer_gain,
        position,
        velocity,
        reference,
        estimate,
        disturbance,
        predicted,
        torque,
        error,
        surface,
        np.empty(AXES),
        np.empty(BASE_PARAMETERS),
        np.empty((AXES, AXES)),
        np.empty((AXES, AXES + 1)),
        np.empty(AXES),
    )
