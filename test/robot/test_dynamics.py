# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Dynamics (10)-(12): properties 1 to 3 of the paper, inverse inertia, power and energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
from typing import Any

from helpers.plant_state import derivative, PlantState
from helpers.robots import (
    all_angles,
    Angles,
    Array,
    assert_agree,
    AXES,
    BASE_PARAMETERS,
    between,
    columns,
    DEFAULT,
    Machine,
    machines,
    PROPERTY,
    Quad,
    quads,
    quasi_map,
    regular_angles,
    STEP,
)
from helpers.scenario import law_records, Scenario
from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.jit.record import fill
from masmc_ros.loop import records
from masmc_ros.loop.dense import tick_input
from masmc_ros.robot.two_link.dynamics import (
    BaseParameters,
    coriolis_times,
    Inertia,
    inertia,
    inertia_solve,
    inertia_times,
    regressor,
    regressor_times,
    regressor_transpose_times,
)
from masmc_ros.robot.two_link.geometry import motion, Posture, posture_at
from masmc_ros.robot.two_link.kinematics import motion_from_task, task_drift, task_from_forces
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

ROBOT = Machine(DEFAULT)


def kinematics_at_rest(angles: Angles) -> Posture:
    """Return the kinematics of angles at rest."""
    return posture_at(angles.yaw, angles.arm_1, angles.arm_2)


def inertia_matrix(robot: Machine, kinematics: Posture) -> Any:
    """Return H in quasi-velocities (4 x 4)."""
    h = inertia(robot.geometry, kinematics, robot.theta)
    return columns(lambda *v: inertia_times(robot.geometry, h, v))


def coriolis_matrix(robot: Machine, kinematics: Posture, velocity: Quad) -> Array:
    """Return V(v) in quasi-velocities (4 x 4)."""
    return columns(lambda *v: coriolis_times(robot.geometry, kinematics, robot.theta, velocity, v))


def task_matrix(robot: Machine, kinematics: Posture, force: Callable[[Quad], Quad]) -> Any:
    """Return J^-T (force of J^-1 x), column by column (4 x 4)."""
    geometry = robot.geometry
    return columns(
        lambda *x: task_from_forces(
            geometry, kinematics, force(motion_from_task(geometry, kinematics, x, x))
        )
    )


def inertia_x(robot: Machine, kinematics: Posture) -> Any:
    """Return H_x = J^-T H J^-1 of (11)."""
    h = inertia(robot.geometry, kinematics, robot.theta)
    return task_matrix(robot, kinematics, lambda v: inertia_times(robot.geometry, h, v))


def test_base_parameters_default_robot_equal_known_values() -> None:
    expected = (21.35300031, 0.36151294, 0.42108, 1.1951, 0.26001, 0.59325996, 0.08598243)
    assert ROBOT.theta == pytest.approx(expected, abs=5e-9)


@PROPERTY
@given(machines(), all_angles())
def test_reduced_inertia_is_symmetric_positive_definite(
    robot: Machine, angles: Angles
) -> None:
    h = inertia_matrix(robot, kinematics_at_rest(angles))
    assert (h == h.T).all()
    np.linalg.cholesky(h)
    q = quasi_map(robot.geometry)
    np.linalg.cholesky(q.T @ h @ q)


@PROPERTY
@given(machines(), regular_angles())
def test_task_inertia_is_symmetric_positive_definite(
    robot: Machine, angles: Angles
) -> None:
    h_x = inertia_x(robot, kinematics_at_rest(angles))
    assert_agree(h_x, h_x.T, 1e-13)
    np.linalg.cholesky(0.5 * (h_x + h_x.T))


@PROPERTY
@given(machines(), all_angles())
@example(ROBOT, Angles(0.0, 0.3, 0.0))
def test_control_tick_task_inertia_equals_definition(robot: Machine, angles: Angles) -> None:
    settings, _ = law_records(Scenario('smc', 'implicit', robot=robot, model_scale=1.0))
    signals = records.signals(TWO_LINK)
    fill(signals, 'position', [0.0, 0.0, angles.yaw, 0.0, 0.0, angles.arm_1, angles.arm_2])
    gains = {'sigma': np.full(AXES, 2.0)}
    tick = tick_input(settings, signals, gains, np.zeros(BASE_PARAMETERS), np.zeros(AXES))
    assert_agree(tick.task_inertia, inertia_x(robot, kinematics_at_rest(angles)), 1e-14)


@PROPERTY
@given(machines(), all_angles(), quads())
def test_reduced_inertia_rate_minus_2_coriolis_is_skew_symmetric(
    robot: Machine, angles: Angles, velocity: Quad
) -> None:
    rate = np.imag(inertia_matrix(robot, angles.moving(velocity))) / STEP
    v = coriolis_matrix(robot, kinematics_at_rest(angles), velocity)
    skew = rate - 2.0 * v
    assert_agree(skew + skew.T, np.zeros((4, 4)), 1e-14, scale=np.abs(v).max() + 1e-9)


@PROPERTY
@given(machines(), regular_angles(), quads())
def test_task_inertia_rate_minus_2_coriolis_is_skew_symmetric(
    robot: Machine, angles: Angles, velocity: Quad
) -> None:
    kinematics, geometry = kinematics_at_rest(angles), robot.geometry
    h = inertia(geometry, kinematics, robot.theta)

    def force(v_r: Quad) -> Quad:
        """Return (V - H J^-1 Jdot) v_r of (11)."""
        drift = task_drift(geometry, kinematics, velocity, v_r)
        along = motion_from_task(geometry, kinematics, drift, drift)
        turning = inertia_times(geometry, h, along)
        own = coriolis_times(geometry, kinematics, robot.theta, velocity, v_r)
        return (
            own[0] - turning[0],
            own[1] - turning[1],
            own[2] - turning[2],
            own[3] - turning[3],
        )

    v_x = task_matrix(robot, kinematics, force)
    rate = np.imag(inertia_x(robot, angles.moving(velocity))) / STEP
    skew = rate - 2.0 * v_x
    # J^-1 of an almost straight arm loses digits.
    limit = 1e-12 / abs(math.sin(angles.arm_2))
    assert_agree(skew + skew.T, np.zeros((4, 4)), limit, scale=np.abs(v_x).max() + 1e-9)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(), quads(5.0))
def test_dynamics_are_linear_in_base_parameters(
    robot: Machine, angles: Angles, velocity: Quad, reference: Quad, acceleration: Quad
) -> None:
    kinematics, geometry, theta = kinematics_at_rest(angles), robot.geometry, robot.theta
    y = regressor(geometry, kinematics, velocity, reference, acceleration)
    h = inertia(geometry, kinematics, theta)
    inertial = np.array(inertia_times(geometry, h, acceleration))
    forces = inertial + coriolis_times(geometry, kinematics, theta, velocity, reference)
    size = np.abs(inertial).max() + np.abs(forces).max() + 1e-9
    assert_agree(regressor_times(geometry, y, theta), forces, 1e-13, scale=size)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(), quads(5.0), quads(), st.integers(0, 6))
def test_regressor_transpose_equals_transposed_regressor(
    robot: Machine,
    angles: Angles,
    velocity: Quad,
    reference: Quad,
    acceleration: Quad,
    motion: Quad,
    column: int,
) -> None:
    y = regressor(robot.geometry, kinematics_at_rest(angles), velocity, reference, acceleration)
    unit = BaseParameters(*(float(j == column) for j in range(BASE_PARAMETERS)))
    force = regressor_times(robot.geometry, y, unit)
    gradient = regressor_transpose_times(robot.geometry, y, motion, robot.theta)
    size = np.abs(force).max() * 3.0 + 1e-9
    assert_agree(gradient[column], np.dot(force, motion), 1e-14, scale=size)


@PROPERTY
@given(machines(), st.integers(0, 2**32 - 1))
def test_base_parameters_are_a_minimal_set(robot: Machine, seed: int) -> None:
    """The seven parameters are a minimal set: some motions distinguish each of them."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(12):
        kinematics = posture_at(*rng.uniform(-3.0, 3.0, 3).tolist())
        v, v_r, a_r = (tuple(rng.uniform(-2.0, 2.0, 4).tolist()) for _ in range(3))
        y = regressor(robot.geometry, kinematics, v, v_r, a_r)
        units = np.eye(BASE_PARAMETERS).tolist()
        rows.append(np.array([regressor_times(robot.geometry, y, unit) for unit in units]).T)
    assert np.linalg.matrix_rank(np.vstack(rows), tol=1e-6) == BASE_PARAMETERS


@PROPERTY
@given(machines(), all_angles(), quads(50.0))
def test_inertia_solve_inverts_inertia_times(robot: Machine, angles: Angles, force: Quad) -> None:
    h: Inertia = inertia(robot.geometry, kinematics_at_rest(angles), robot.theta)
    solved = inertia_solve(robot.geometry, h, force)
    size = np.abs(np.array(h)).max() * np.abs(solved).max() + 1e-9
    assert_agree(inertia_times(robot.geometry, h, solved), force, 1e-13, scale=size)


def plant_state(angles: Angles, rates: Quad) -> PlantState:
    """Return a state at the origin of the world."""
    return PlantState(0.0, 0.0, angles.yaw, 0.1, -0.2, angles.arm_1, angles.arm_2, *rates)


def kinetic_energy(robot: Machine, state: PlantState) -> Any:
    """Return the kinetic energy in J."""
    v = np.array(motion(robot.geometry, state[7:]))
    kinematics = posture_at(state.yaw, state.arm_1, state.arm_2)
    return 0.5 * v @ inertia_matrix(robot, kinematics) @ v


@PROPERTY
@given(machines(), all_angles(), quads(), quads(10.0))
def test_plant_power_equals_power_of_torques(
    robot: Machine, angles: Angles, rates: Quad, torque: Quad
) -> None:
    state = plant_state(angles, rates)
    rate = derivative(robot.theta, robot.geometry, state, torque)
    v = np.array(motion(robot.geometry, rates))
    v_dot = np.array(motion(robot.geometry, rate[7:]))
    h = inertia_matrix(robot, kinematics_at_rest(angles))
    h_dot = np.imag(inertia_matrix(robot, angles.moving(tuple(v.tolist())))) / STEP
    power = v @ h @ v_dot + 0.5 * v @ h_dot @ v
    size = np.abs(h).max() * np.abs(v).max() * np.abs(v_dot).max() + np.abs(torque).max() * 3.0
    assert_agree(power, np.dot(torque, rates), 1e-12, scale=size + 1e-9)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(10.0))
def test_plant_wheels_roll_without_slip(
    robot: Machine, angles: Angles, rates: Quad, torque: Quad
) -> None:
    rate = derivative(robot.theta, robot.geometry, plant_state(angles, rates), torque)
    r, b = robot.physical['wheel_radius'], robot.physical['half_track']
    c, s = np.cos(angles.yaw), np.sin(angles.yaw)
    forward, sideways = c * rate.x + s * rate.y, c * rate.y - s * rate.x
    assert_agree(sideways, 0.0, 1e-15, scale=1.0)
    assert_agree(forward + b * rate.yaw, r * rates[0], 1e-14, scale=1.0)
    assert_agree(forward - b * rate.yaw, r * rates[1], 1e-14, scale=1.0)
    assert rate[3:7] == rates


@PROPERTY
@given(machines(), all_angles(), quads(), quads(10.0), between(0.1, 10.0))
def test_plant_masses_and_torques_scaled_keep_motion(
    robot: Machine, angles: Angles, rates: Quad, torque: Quad, factor: float
) -> None:
    """Scaled inertial parameters and scaled torques leave the motion unchanged."""
    heavier = replace(robot, physical=dict(robot.physical))
    inertial = [n for n in DEFAULT if n.endswith(('_mass', '_inertia'))]
    heavier.physical.update({name: factor * robot.physical[name] for name in inertial})
    scaled_torque = tuple(factor * value for value in torque)
    state = plant_state(angles, rates)
    one = derivative(robot.theta, robot.geometry, state, torque)
    two = derivative(heavier.theta, heavier.geometry, state, scaled_torque)
    assert_agree(two, one, 1e-10, scale=1e-3)
