# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Equations of the paper that contradict the mechanism, and their corrections.

docs/theory/model.md discusses each of them; (15)-(23) are in test_lyapunov.py.
"""

from __future__ import annotations

from helpers.lagrangian import matrices
from helpers.robots import (
    all_angles,
    Angles,
    Array,
    assert_agree,
    columns,
    DEFAULT,
    Machine,
    machines,
    PROPERTY,
)
from hypothesis import given
from masmc_ros.robot.two_link.geometry import motion, posture_at
from masmc_ros.robot.two_link.kinematics import task_velocity
import numpy as np

SWAP = [1, 0, 2, 3]
"""Index that exchanges the columns of the right and of the left wheel."""


def printed_1(robot: Machine, yaw: float) -> Array:
    """Return (1) as printed: velocity of F from the velocities of right and left wheel."""
    r, b, l, _, _ = robot.geometry  # noqa: E741 - the paper's d + L_a
    c, s = np.cos(yaw), np.sin(yaw)
    rows = [[b * c + l * s, b * c - l * s], [b * s - l * c, b * s + l * c]]
    return r / (2.0 * b) * np.array(rows)


def printed_3(robot: Machine, angles: Angles) -> Array:
    """Return (3) as printed: R J_a."""
    r, b, l, length_1, length_2 = robot.geometry  # noqa: E741
    c, s = np.cos(angles.yaw), np.sin(angles.yaw)
    c1, s1 = np.cos(angles.arm_1), np.sin(angles.arm_1)
    c12, s12 = np.cos(angles.arm_1 + angles.arm_2), np.sin(angles.arm_1 + angles.arm_2)
    j11, j12 = -length_1 * s1 - length_2 * s12, -length_2 * s12
    j21, j22 = length_1 * c1 + length_2 * c12, length_2 * c12
    k = r / (2.0 * b)
    j_a = np.array(
        [
            [r / 2 - k * j11, r / 2 + k * j11, j11, j12],
            [-k * (l + j21), k * (l + j21), j21, j22],
            [r / 2, r / 2, 0.0, 0.0],
            [-l * k, l * k, 0.0, 0.0],
        ]
    )
    turn = np.array([[c, -s], [s, c]])
    zero = np.zeros((2, 2))
    return np.block([[turn, zero], [zero, turn]]) @ j_a


def printed_9(robot: Machine, yaw: float) -> Array:
    """Return (9) as printed: five rows, without those of theta_R and theta_L."""
    r, b, d = (robot.physical[n] for n in ('wheel_radius', 'half_track', 'com_offset'))
    c, s = np.cos(yaw), np.sin(yaw)
    k = r / (2.0 * b)
    return np.array(
        [
            [k * (b * c + d * s), k * (b * c - d * s), 0.0, 0.0],
            [k * (b * s - d * c), k * (b * s + d * c), 0.0, 0.0],
            [k, -k, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def sideways(yaw: float, velocity: Array) -> Array:
    """Return the component to the left of the heading of world velocities (2, n)."""
    return np.array([-np.sin(yaw), np.cos(yaw)]) @ velocity


@PROPERTY
@given(machines(), all_angles())
def test_equation_9_rows_contradict_each_other(robot: Machine, angles: Angles) -> None:
    """C lies d ahead of the axle and moves sideways at d phidot; rows 1-2 give -d phidot."""
    d, printed = robot.physical['com_offset'], printed_9(robot, angles.yaw)
    yaw_rate = printed[2]
    assert_agree(sideways(angles.yaw, printed[:2]), -d * yaw_rate, 1e-12, scale=1.0)
    swapped = printed[:2, SWAP]
    assert_agree(sideways(angles.yaw, swapped), d * yaw_rate, 1e-12, scale=1.0)


@PROPERTY
@given(machines(), all_angles())
def test_equations_1_and_3_contradict_row_3_of_9(robot: Machine, angles: Angles) -> None:
    """F lies l ahead of the axle and moves sideways at l phidot; (1) and (3) give -l phidot."""
    turning = robot.geometry.arm_base * printed_9(robot, angles.yaw)[2]
    one = printed_1(robot, angles.yaw)
    three = printed_3(robot, angles)[2:]
    assert_agree(sideways(angles.yaw, one), -turning[:2], 1e-12, scale=1.0)
    assert_agree(sideways(angles.yaw, three), -turning, 1e-12, scale=1.0)


@PROPERTY
@given(machines(), all_angles())
def test_equation_3_wheels_exchanged_equals_kinematics(robot: Machine, angles: Angles) -> None:
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    jacobian = columns(
        lambda *v: task_velocity(geometry, kinematics, motion(geometry, v))
    )
    assert_agree(jacobian, printed_3(robot, angles)[:, SWAP], 1e-12)
    assert_agree(jacobian[2:, :2], printed_1(robot, angles.yaw)[:, [1, 0]], 1e-12)


@PROPERTY
@given(machines(), all_angles())
def test_equation_9_corrected_equals_null_space(
    robot: Machine, angles: Angles
) -> None:
    q = np.array([0.0, 0.0, angles.yaw, 0.0, 0.0, angles.arm_1, angles.arm_2])
    m = matrices(robot.physical, q, np.zeros(4))
    printed = printed_9(robot, angles.yaw)
    corrected = np.vstack([printed[:2, SWAP], printed[2], np.eye(4)])
    assert corrected.shape == (7, 4)
    assert_agree(corrected, m.null_space, 1e-12)
    # With the printed rows the wheels slip.
    as_printed = np.vstack([printed[:3], np.eye(4)])
    slip = np.abs(m.constraints @ as_printed).max()
    r, b, d = (robot.physical[n] for n in ('wheel_radius', 'half_track', 'com_offset'))
    assert slip >= 0.99 * abs(d) * r / b / np.sqrt(2.0) - 1e-12


@PROPERTY
@given(machines(), all_angles())
def test_equation_3_straight_motion_hides_sign_error(robot: Machine, angles: Angles) -> None:
    """Both signs agree for equal wheel velocities, which hides the error."""
    straight = np.array([1.0, 1.0, 0.0, 0.0])
    assert_agree(
        printed_3(robot, angles) @ straight, printed_3(robot, angles)[:, SWAP] @ straight, 1e-12
    )


STATES = [np.random.default_rng(seed).uniform(-2.0, 2.0, 11) for seed in range(20)]


def reduced_inertia_rate(parameters: dict[str, float], q: Array, v: Array) -> Array:
    """Return the derivative of S'HS along the motion, by differences."""
    h = 1e-5
    q_dot = matrices(parameters, q, v).null_space @ v
    later, earlier = (matrices(parameters, q + e * q_dot, v).reduced_inertia for e in (h, -h))
    return (later - earlier) / (2.0 * h)


def test_equation_10_without_christoffel_violates_property_2() -> None:
    """V = S'HSdot alone, as printed in (10), violates Property 2; S'HSdot + S'CS fulfils it."""
    parameters = {**DEFAULT, 'com_offset': 0.1}
    for state in STATES:
        q, v = state[:7], state[7:]
        m = matrices(parameters, q, v)
        rate = reduced_inertia_rate(parameters, q, v)
        right = rate - 2.0 * m.reduced_coriolis
        printed = rate - 2.0 * m.printed_coriolis
        assert_agree(right + right.T, np.zeros((4, 4)), 1e-8, scale=1.0)
        assert np.abs(printed + printed.T).max() > 1e-3


def test_equation_10_gravity_term_is_quadratic_in_velocity() -> None:
    """G = S'V of (10) vanishes at rest and is quadratic in v: it is part of V v."""
    for state in STATES:
        q, v = state[:7], state[7:]

        def velocity_terms(v: Array, q: Array = q) -> Array:
            m = matrices(DEFAULT, q, v)
            return m.null_space.T @ m.christoffel @ m.null_space @ v

        assert not velocity_terms(np.zeros(4)).any()
        assert np.abs(velocity_terms(v)).max() > 1e-4
        assert_agree(velocity_terms(2.0 * v), 4.0 * velocity_terms(v), 1e-12)
        assert_agree(velocity_terms(-v), velocity_terms(v), 1e-12)


def test_equation_10_torque_map_is_identity() -> None:
    """E maps torques to the rows of wheels and arm; therefore S'E = 1 in (10)."""
    e = np.vstack([np.zeros((3, 4)), np.eye(4)])
    for state in STATES:
        m = matrices(DEFAULT, state[:7], state[7:])
        assert_agree(m.null_space.T @ e, np.eye(4), 1e-15)
