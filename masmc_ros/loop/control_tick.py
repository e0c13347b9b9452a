# SPDX-License-Identifier: Apache-2.0
"""One tick of the sampled control law: state and reference in, torque out."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.command_interface import VELOCITY
from masmc_ros.control.implicit import disturbance_estimate, implicit_reaching
from masmc_ros.control.reaching import explicit_reaching, IMPLICIT
from masmc_ros.control.velocity_estimator import ESTIMATED
from masmc_ros.loop.adaptation_tick import adapt
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.task_terms import surface_and_reference, task_inertia, torque_and_gradient
from masmc_ros.loop.torque_limits import correct_prediction, limit_torque
from masmc_ros.loop.velocity_tick import estimate_rates, note_disturbance
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.dynamics import (
    Quad,
    regressor,
)
from masmc_ros.robot.geometry import (
    Geometry,
    Posture,
    posture,
    quasi_velocity,
)
from masmc_ros.robot.kinematics import (
    is_singular,
)


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
def command_rates(settings: Any, v_r: Quad, a_r: Quad, rates: Any) -> None:
    """Write the command of the kinematic law, v_r + T a_r / 2, as a base and an arm take it.

    Drives that follow v_r let the error decay as on the sliding surface, edot = -sigma e. The
    command is held for a period, whose middle the second term looks ahead to. `rates` (4):
    forward speed in m/s, yaw rate and both arm joints' rates in rad/s.
    """
    ahead = 0.5 * settings['period']
    turn = v_r[1] + ahead * a_r[1]
    link_1 = v_r[2] + ahead * a_r[2]
    rates[0] = v_r[0] + ahead * a_r[0]
    rates[1] = turn
    rates[2] = link_1 - turn
    rates[3] = v_r[3] + ahead * a_r[3] - link_1


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
    if settings['command_interface'] == VELOCITY:
        command_rates(settings, v_r, a_r, memory['velocity_command'])
        for i in range(AXES):
            raw_torque[i] = 0.0
            torque[i] = 0.0
        return is_singular(bend)
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
    Out: the law's torque (4, N m) and that within the limits, e (4, m) and s (4, m/s). With
    commanded rates both torques are zero, nothing is learned, and the rates are in MEMORY.
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
