# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled model against equations derived from the Lagrangian of the same robot."""

from __future__ import annotations

from helpers.lagrangian import Matrices, matrices
from helpers.plant_state import derivative, PlantState
from helpers.robots import (
    all_angles,
    Angles,
    Array,
    assert_agree,
    columns,
    Machine,
    machines,
    PROPERTY,
    Quad,
    quads,
    quasi_map,
    regular_angles,
)
from hypothesis import given
from masmc_ros.robot.two_link.dynamics import (
    coriolis_times,
    inertia,
    inertia_times,
    regressor,
    regressor_times,
)
from masmc_ros.robot.two_link.geometry import joint_torques, motion, posture_at
from masmc_ros.robot.two_link.kinematics import (
    forces_from_task,
    motion_from_task,
    task_drift,
    task_velocity,
)
import numpy as np

TOLERANCE = 1e-11


def derived(robot: Machine, angles: Angles, rates: Quad) -> Matrices:
    """Return the derived matrices at a state of the robot."""
    q = np.array([0.3, -0.7, angles.yaw, 0.2, 0.9, angles.arm_1, angles.arm_2])
    return matrices(robot.physical, q, np.array(rates))


@PROPERTY
@given(machines(), all_angles(), quads())
def test_lagrangian_null_space_fulfils_constraints(
    robot: Machine, angles: Angles, rates: Quad
) -> None:
    """A S = 0 with S of shape 7 x 4 and full rank; A of rank 3 leaves no other motion."""
    m = derived(robot, angles, rates)
    assert_agree(m.constraints @ m.null_space, np.zeros((4, 4)), 1e-14, scale=1.0)
    assert m.null_space.shape == (7, 4)
    assert np.linalg.matrix_rank(m.null_space) == 4
    assert np.linalg.matrix_rank(m.constraints) == 3


@PROPERTY
@given(machines(), all_angles())
def test_reduced_inertia_equals_lagrangian(robot: Machine, angles: Angles) -> None:
    h = inertia(robot.geometry, posture_at(angles.yaw, angles.arm_1, angles.arm_2), robot.theta)
    q = quasi_map(robot.geometry)
    actual = q.T @ columns(lambda *v: inertia_times(robot.geometry, h, v)) @ q
    expected = derived(robot, angles, (0.0, 0.0, 0.0, 0.0)).reduced_inertia
    assert_agree(actual, expected, TOLERANCE)


def reduced_coriolis(robot: Machine, kinematics: Array, rates: Quad) -> Array:
    """Return V(v) of the kernel in reduced velocities (4 x 4)."""
    geometry = robot.geometry
    velocity = motion(geometry, rates)
    return columns(
        lambda *v_r: joint_torques(
            geometry,
            coriolis_times(geometry, kinematics, robot.theta, velocity, motion(geometry, v_r)),
        )
    )


@PROPERTY
@given(machines(), all_angles(), quads())
def test_coriolis_matrix_equals_lagrangian(robot: Machine, angles: Angles, rates: Quad) -> None:
    actual = reduced_coriolis(robot, posture_at(angles.yaw, angles.arm_1, angles.arm_2), rates)
    m = derived(robot, angles, rates)
    size = np.abs(m.printed_coriolis).max() + np.abs(m.reduced_inertia).max() * 1e-3
    assert_agree(actual, m.reduced_coriolis, TOLERANCE, scale=size)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(), quads(5.0))
def test_regressor_equals_lagrangian(
    robot: Machine, angles: Angles, rates: Quad, reference: Quad, acceleration: Quad
) -> None:
    geometry = robot.geometry
    y = regressor(
        geometry,
        posture_at(angles.yaw, angles.arm_1, angles.arm_2),
        motion(geometry, rates),
        motion(geometry, reference),
        motion(geometry, acceleration),
    )
    actual = joint_torques(geometry, regressor_times(robot.geometry, y, robot.theta))
    m = derived(robot, angles, rates)
    inertial = m.reduced_inertia @ np.array(acceleration)
    expected = inertial + m.reduced_coriolis @ np.array(reference)
    assert_agree(actual, expected, TOLERANCE, scale=np.abs(inertial).max() + 1e-9)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(10.0))
def test_plant_acceleration_equals_lagrange_multipliers(
    robot: Machine, angles: Angles, rates: Quad, torque: Quad
) -> None:
    """The plant's acceleration equals that of (6) and (7), solved with their multipliers."""
    m = derived(robot, angles, rates)
    v = np.array(rates)
    q_dot = m.null_space @ v
    # Three of the four rows of A are independent; only their span matters.
    rows = np.linalg.svd(m.constraints)[2][:3]
    a_dot_q_dot = -rows @ m.null_space_rate @ v
    effort = np.concatenate([np.zeros(3), torque])
    matrix = np.block([[m.inertia, rows.T], [rows, np.zeros((3, 3))]])
    known = np.concatenate([effort - m.christoffel @ q_dot, -a_dot_q_dot])
    expected = np.linalg.solve(matrix, known)[3:7]
    state = PlantState(0.0, 0.0, angles.yaw, 0.0, 0.0, angles.arm_1, angles.arm_2, *rates)
    actual = derivative(robot.theta, robot.geometry, state, torque)[7:]
    assert_agree(actual, expected, 1e-9, scale=1.0)


@PROPERTY
@given(machines(), regular_angles(), quads(), quads())
def test_task_jacobian_inverse_and_drift_equal_lagrangian(
    robot: Machine, angles: Angles, rates: Quad, reference: Quad
) -> None:
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    m = derived(robot, angles, rates)
    jacobian = m.jacobian
    actual = columns(lambda *v: task_velocity(geometry, kinematics, motion(geometry, v)))
    assert_agree(actual, jacobian, TOLERANCE)
    q = quasi_map(geometry)
    back = columns(lambda *x: motion_from_task(geometry, kinematics, x, x))
    assert_agree(q @ np.linalg.inv(jacobian), back, 1e-10)
    transposed = columns(
        lambda *f: joint_torques(geometry, forces_from_task(geometry, kinematics, f, f))
    )
    assert_agree(transposed, jacobian.T, TOLERANCE)
    drift = task_drift(
        geometry,
        kinematics,
        motion(geometry, rates),
        motion(geometry, reference),
    )
    assert_agree(drift, m.jacobian_rate @ np.array(reference), TOLERANCE, scale=10.0)
