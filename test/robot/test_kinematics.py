# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Kinematics (1)-(5): Jacobian, its derivative, inverse and transpose, singular arm."""

from __future__ import annotations

import math

from helpers.robots import (
    all_angles,
    Angles,
    assert_agree,
    columns,
    DEFAULT,
    Machine,
    machines,
    PROPERTY,
    Quad,
    quads,
    regular_angles,
    STEP,
    trigonometry,
)
from hypothesis import example, given
from masmc_ros.robot.two_link.geometry import (
    Geometry,
    joint_torque,
    posture,
    quasi_force,
    quasi_velocity,
    reduced_velocity,
)
from masmc_ros.robot.two_link.kinematics import (
    is_singular,
    quasi_force_from_task,
    quasi_from_task,
    SINGULAR_SINE,
    task_drift,
    task_force_from_quasi,
    task_position,
    task_velocity,
)
import numpy as np
import pytest

ROBOT = Machine(DEFAULT)


@PROPERTY
@given(all_angles())
def test_posture_holds_the_sines_and_cosines(angles: Angles) -> None:
    found = posture(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(found, trigonometry(angles.yaw, angles.arm_1, angles.arm_2), 1e-15, scale=1.0)


@PROPERTY
@given(machines(), all_angles(), quads())
def test_task_position_moves_with_task_velocity(
    robot: Machine, angles: Angles, velocity: Quad
) -> None:
    geometry, u = robot.geometry, velocity[0]
    moving = angles.moving(velocity)
    # The axle's middle rolls along the heading.
    x = 0.3 + 1j * STEP * u * math.cos(angles.yaw)
    y = -0.7 + 1j * STEP * u * math.sin(angles.yaw)
    rate = np.imag(task_position(geometry, moving, x, y)) / STEP
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(task_velocity(geometry, bend, *velocity), rate, 1e-14, scale=10.0)


@PROPERTY
@given(machines(), all_angles(), quads(), quads())
def test_task_drift_is_the_jacobians_derivative(
    robot: Machine, angles: Angles, velocity: Quad, reference: Quad
) -> None:
    geometry = robot.geometry
    rate = np.imag(task_velocity(geometry, angles.moving(velocity), *reference)) / STEP
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(task_drift(geometry, bend, velocity, reference), rate, 1e-14, scale=50.0)


@PROPERTY
@given(machines(), regular_angles())
@example(ROBOT, Angles(0.4, -0.3, 0.020002))
def test_the_inverse_jacobian_inverts(robot: Machine, angles: Angles) -> None:
    geometry = robot.geometry
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    assert not is_singular(bend)
    jacobian = columns(lambda *v: task_velocity(geometry, bend, *v))
    inverse = columns(lambda *x: quasi_from_task(geometry, bend, *x))
    size = np.abs(jacobian).max() * np.abs(inverse).max()
    assert_agree(jacobian @ inverse, np.eye(4), 4e-15, scale=size)
    assert_agree(inverse @ jacobian, np.eye(4), 4e-15, scale=size)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(), quads())
def test_forces_do_the_work_of_the_motion_they_move(
    robot: Machine, angles: Angles, velocity: Quad, task: Quad, force: Quad
) -> None:
    """The force maps are the transposes of the velocity maps, damped ones included."""
    geometry = robot.geometry
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    pairs = (
        (task_velocity(geometry, bend, *velocity), quasi_force_from_task(geometry, bend, *force)),
        (quasi_velocity(geometry, *velocity), joint_torque(geometry, *force)),
        (reduced_velocity(geometry, *velocity), quasi_force(geometry, *force)),
    )
    for motion, moved in pairs:
        size = np.abs(motion).max() * 3.0 + np.abs(moved).max() * 3.0
        assert_agree(np.dot(force, motion), np.dot(moved, velocity), 1e-14, scale=size)
    motion = quasi_from_task(geometry, bend, *task)
    pushed = task_force_from_quasi(geometry, bend, *force)
    size = np.abs(motion).max() * 3.0 + np.abs(pushed).max() * 3.0
    assert_agree(np.dot(force, motion), np.dot(pushed, task), 1e-14, scale=size)


@PROPERTY
@given(machines(), quads())
def test_reduced_and_quasi_velocities_are_one_to_one(robot: Machine, velocity: Quad) -> None:
    geometry = robot.geometry
    back = reduced_velocity(geometry, *quasi_velocity(geometry, *velocity))
    assert_agree(back, velocity, 1e-13, scale=3.0)
    back = quasi_force(geometry, *joint_torque(geometry, *velocity))
    assert_agree(back, velocity, 1e-13, scale=3.0)


def test_right_wheel_forward_turns_left() -> None:
    u, w, a, b = quasi_velocity(ROBOT.geometry, 1.0, 0.0, 0.0, 0.0)
    r, half_track = DEFAULT['wheel_radius'], DEFAULT['half_track']
    assert u == pytest.approx(r / 2)
    assert w == a == b == pytest.approx(r / (2 * half_track))


def test_stretched_arm_points_ahead() -> None:
    geometry = ROBOT.geometry
    found = task_position(geometry, posture(0.0, 0.0, 0.0), 1.0, 2.0)
    assert found == pytest.approx((1.0 + 0.116 + 0.514 + 0.362, 2.0, 1.116, 2.0))


def undamped(geometry: Geometry, angles: Angles, x: Quad) -> tuple[Quad, Quad]:
    """Return J^-1 x and J^-T x with 1 / sin(theta_2) as it is, operation for operation."""
    p = posture(angles.yaw, angles.arm_1, angles.arm_2)
    inverse = 1.0 / p.s2
    ex, ey = p.c0 * x[0] + p.s0 * x[1], p.c0 * x[1] - p.s0 * x[0]
    fx, fy = p.c0 * x[2] + p.s0 * x[3], p.c0 * x[3] - p.s0 * x[2]
    dx, dy = ex - fx, ey - fy
    a = (p.c12 * dx + p.s12 * dy) * inverse / geometry.link_1
    b = -(p.c1 * dx + p.s1 * dy) * inverse / geometry.link_2
    pull_a, pull_b = x[2] * inverse / geometry.link_1, x[3] * inverse / geometry.link_2
    gx, gy = p.c12 * pull_a - p.c1 * pull_b, p.s12 * pull_a - p.s1 * pull_b
    hx, hy = x[0] - gx, x[1] / geometry.arm_base - gy
    force = (
        p.c0 * gx - p.s0 * gy,
        p.s0 * gx + p.c0 * gy,
        p.c0 * hx - p.s0 * hy,
        p.s0 * hx + p.c0 * hy,
    )
    return (fx, fy / geometry.arm_base, a, b), force


@PROPERTY
@given(machines(), regular_angles(), quads())
@example(ROBOT, Angles(0.4, -0.3, math.asin(SINGULAR_SINE) + 1e-15), (1.0, 2.0, 3.0, 4.0))
@example(ROBOT, Angles(0.4, -0.3, -math.asin(SINGULAR_SINE) - 1e-15), (1.0, 2.0, 3.0, 4.0))
def test_the_damping_leaves_every_bit_alone_outside_its_band(
    robot: Machine, angles: Angles, x: Quad
) -> None:
    geometry = robot.geometry
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    velocity, force = undamped(geometry, angles, x)
    assert quasi_from_task(geometry, bend, *x) == velocity
    assert task_force_from_quasi(geometry, bend, *x) == force


@PROPERTY
@given(machines(), all_angles(), quads())
@example(ROBOT, Angles(0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0))
@example(ROBOT, Angles(0.0, 0.0, math.pi), (1.0, 1.0, 1.0, 1.0))
def test_the_inverse_is_finite_and_bounded_everywhere(
    robot: Machine, angles: Angles, x: Quad
) -> None:
    geometry = robot.geometry
    bend = posture(angles.yaw, angles.arm_1, angles.arm_2)
    shortest = min(geometry.link_1, geometry.link_2, abs(geometry.arm_base), 1.0)
    limit = 4.0 * 12.0 / (SINGULAR_SINE * shortest)
    for found in (
        quasi_from_task(geometry, bend, *x),
        task_force_from_quasi(geometry, bend, *x),
    ):
        assert np.isfinite(found).all()
        assert np.abs(found).max() <= limit


def test_the_damped_inverse_is_continuous_and_vanishes_at_the_singularity() -> None:
    geometry = ROBOT.geometry
    edge = math.asin(SINGULAR_SINE)
    task = (0.3, -0.4, 0.1, 0.2)
    inside = posture(0.2, 0.5, edge * (1.0 - 1e-9))
    outside = posture(0.2, 0.5, edge * (1.0 + 1e-9))
    assert is_singular(inside)
    assert not is_singular(outside)
    assert_agree(
        quasi_from_task(geometry, inside, *task), quasi_from_task(geometry, outside, *task), 1e-8
    )
    assert quasi_from_task(geometry, posture(0.2, 0.5, 0.0), *task)[2:] == (0.0, 0.0)
