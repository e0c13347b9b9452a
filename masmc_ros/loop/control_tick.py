# SPDX-License-Identifier: Apache-2.0
"""One tick of the sampled control law: state and reference in, torque out."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.implicit import disturbance_estimate, implicit_reaching
from masmc_ros.control.limits import limited
from masmc_ros.control.reaching import explicit_reaching, IMPLICIT
from masmc_ros.control.surface import (
    reference_acceleration,
    reference_velocity,
    sliding_surface,
)
from masmc_ros.control.velocity_estimator import ESTIMATED
from masmc_ros.loop.adaptation_tick import adapt
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.velocity_tick import estimate_rates, note_disturbance
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.dynamics import (
    BaseParameters,
    inertia,
    inertia_solve,
    inertia_times,
    Quad,
    Regressor,
    regressor,
    regressor_times,
    regressor_transpose_times,
)
from masmc_ros.robot.geometry import (
    Geometry,
    joint_torque,
    Posture,
    posture,
    quasi_force,
    quasi_velocity,
)
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


class Workspace(NamedTuple):
    """Arrays that one tick writes before it reads them."""

    reaching: Any  # u (4), N
    gradient: Any  # Y' J^-1 s (7)
    normal: Any  # (7)
    matrix: Any  # H_x (4, 4), kg
    elimination: Any  # (4, 5)
    zeta: Any  # (4)


@formula
def workspace() -> Workspace:
    """Make the arrays where the compiler sees that nothing else refers to them."""
    return Workspace(
        np.empty(AXES),
        np.empty(BASE_PARAMETERS),
        np.empty(BASE_PARAMETERS),
        np.empty((AXES, AXES)),
        np.empty((AXES, AXES + 1)),
        np.empty(AXES),
    )


@formula
def implicit_law(
    settings: Any, memory: Any, geometry: Geometry, bend: Posture, surface: Any, work: Workspace
) -> None:
    """Write the reaching force u (4, N) of the implicit law, and what it predicts."""
    predicted, disturbance = memory['predicted'], memory['disturbance']
    k_s1, k_s2, period = settings['k_s1'], settings['k_s2'], settings['period']
    task_inertia(as_base_parameters(settings['nominal']), geometry, bend, work.matrix)
    disturbance_estimate(
        AXES,
        work.matrix,
        surface,
        predicted,
        settings['observer_gain'] / period,
        disturbance,
    )
    implicit_reaching(
        AXES,
        work.matrix,
        period,
        k_s1,
        k_s2,
        surface,
        predicted,
        work.zeta,
        work.elimination,
    )
    for i in range(AXES):
        work.reaching[i] = (
            -(k_s1[i] * predicted[i] + k_s2[i] * work.zeta[i]) - disturbance[i]
        )


@formula
def limit_torque(settings: Any, commanded: Any, raw_torque: Any, torque: Any) -> bool:
    """Write the torque (4, N m) within its limits; tell whether any of it was cut.

    `commanded` (4) is the last tick's torque and becomes this one's.
    """
    saturated = False
    for i in range(AXES):
        torque[i] = limited(
            raw_torque[i],
            commanded[i],
            settings['torque_limit'][i],
            settings['torque_rate_limit'][i],
            settings['period'],
        )
        commanded[i] = torque[i]
        saturated |= torque[i] != raw_torque[i]
    return saturated


@kernel
def correct_prediction(
    settings: Any,
    geometry: Geometry,
    bend: Posture,
    raw_torque: Any,
    torque: Any,
    predicted: Any,
) -> None:
    """Add to s+ (4, m/s) what limits change in it: T J H^-1 (torque - raw torque).

    The disturbance estimate then takes for a disturbance only what is one.
    """
    force = quasi_force(
        geometry,
        torque[0] - raw_torque[0],
        torque[1] - raw_torque[1],
        torque[2] - raw_torque[2],
        torque[3] - raw_torque[3],
    )
    h = inertia(as_base_parameters(settings['nominal']), geometry, bend)
    a = inertia_solve(h, force[0], force[1], force[2], force[3])
    change = task_velocity(geometry, bend, a[0], a[1], a[2], a[3])
    predicted[0] += settings['period'] * change[0]
    predicted[1] += settings['period'] * change[1]
    predicted[2] += settings['period'] * change[2]
    predicted[3] += settings['period'] * change[3]


@formula
def control(
    settings: Any,
    memory: Any,
    position: Any,
    velocity: Any,
    reference: Any,
    raw_torque: Any,
    torque: Any,
    error: Any,
    surface: Any,
    work: Workspace,
) -> bool:
    """Compute one tick; see `control_tick`."""
    geometry = as_geometry(settings['geometry'])
    bend = posture(position[2], position[5], position[6])
    if settings['velocity_source'] == ESTIMATED:
        estimate_rates(settings, memory, position)
        rates = memory['rates']
        v = quasi_velocity(geometry, rates[0], rates[1], rates[2], rates[3])
    else:
        v = quasi_velocity(geometry, velocity[3], velocity[4], velocity[5], velocity[6])
    v_r, a_r = surface_and_reference(
        geometry, bend, v, position, reference, settings['sigma'], error, surface
    )
    switching = settings['switching']
    if switching == IMPLICIT:
        implicit_law(settings, memory, geometry, bend, surface, work)
    else:
        for i in range(AXES):
            work.reaching[i] = explicit_reaching(
                switching,
                surface[i],
                settings['k_s1'][i],
                settings['k_s2'][i],
                settings['boundary_layer'],
            )
    torque_and_gradient(
        geometry,
        bend,
        regressor(geometry, bend, v, v_r, a_r),
        as_base_parameters(memory['estimate']),
        surface,
        work.reaching,
        raw_torque,
        work.gradient,
    )
    saturated = False
    if settings['has_limits']:
        saturated = limit_torque(settings, memory['commanded'], raw_torque, torque)
        if saturated and switching == IMPLICIT:
            correct_prediction(
                settings, geometry, bend, raw_torque, torque, memory['predicted']
            )
    else:
        for i in range(AXES):
            torque[i] = raw_torque[i]
            memory['commanded'][i] = torque[i]
    if settings['velocity_source'] == ESTIMATED:
        note_disturbance(memory, geometry, bend)
    adapt(settings, surface, saturated, work.gradient, work.normal, memory['estimate'])
    return is_singular(bend)


@kernel
def control_tick(
    settings: Any,
    memory: Any,
    position: Any,
    velocity: Any,
    reference: Any,
    raw_torque: Any,
    torque: Any,
    error: Any,
    surface: Any,
) -> bool:
    """Compute the torque of one tick; True where the arm is close to singular.

    In: one record of SETTINGS; the state as positions and velocities (7, in the order of
    joint_states), reference (12: x_d, xdot_d, xddot_d).
    In and out: one record of MEMORY, which the next tick takes up.
    Out: the law's torque (4, N m) and that within the limits, e (4, m) and s (4, m/s).
    """
    return control(
        settings[0],
        memory[0],
        position,
        velocity,
        reference,
        raw_torque,
        torque,
        error,
        surface,
        workspace(),
    )


@kernel
def limit_command(settings: Any, memory: Any, raw_torque: Any, torque: Any) -> bool:
    """Write the torque (4, N m) of a law in plain Python within its limits."""
    return limit_torque(settings[0], memory[0]['commanded'], raw_torque, torque)
