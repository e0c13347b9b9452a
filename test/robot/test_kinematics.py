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
    forces,
    Geometry,
    joint_rates,
    joint_torques,
    motion,
    posture,
    posture_at,
)
from masmc_ros.robot.two_link.kinematics import (
    forces_from_task,
    is_singular,
    motion_from_task,
    SINGULAR_SINE,
    task_drift,
    task_from_forces,
    task_position,
    task_velocity,
)
import numpy as np
import pytest

ROBOT = Machine(DEFAULT)


@PROPERTY
@given(all_angles())
def test_posture_any_angles_equals_sines_and_cosines(angles: Angles) -> None:
    actual = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(actual, trigonometry(angles.yaw, angles.arm_1, angles.arm_2), 1e-15, scale=1.0)


@PROPERTY
@given(machines(), all_angles(), quads())
def test_task_velocity_is_derivative_of_task_position(
    robot: Machine, angles: Angles, velocity: Quad
) -> None:
    geometry, u = robot.geometry, velocity[0]
    moving = angles.moving(velocity)
    # The middle of the axle moves along the heading.
    x = 0.3 + 1j * STEP * u * math.cos(angles.yaw)
    y = -0.7 + 1j * STEP * u * math.sin(angles.yaw)
    rate = np.imag(task_position(geometry, moving, (x, y, 0.0, 0.0, 0.0, 0.0, 0.0))) / STEP
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(task_velocity(geometry, kinematics, velocity), rate, 1e-14, scale=10.0)


@PROPERTY
@given(machines(), all_angles(), quads(), quads())
def test_task_drift_is_derivative_of_jacobian(
    robot: Machine, angles: Angles, velocity: Quad, reference: Quad
) -> None:
    geometry = robot.geometry
    rate = np.imag(task_velocity(geometry, angles.moving(velocity), reference)) / STEP
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    assert_agree(task_drift(geometry, kinematics, velocity, reference), rate, 1e-14, scale=50.0)


@PROPERTY
@given(machines(), regular_angles())
@example(ROBOT, Angles(0.4, -0.3, 0.020002))
def test_inverse_jacobian_times_jacobian_is_identity(robot: Machine, angles: Angles) -> None:
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    assert not is_singular(geometry, kinematics)
    jacobian = columns(lambda *v: task_velocity(geometry, kinematics, v))
    inverse = columns(lambda *x: motion_from_task(geometry, kinematics, x, x))
    size = np.abs(jacobian).max() * np.abs(inverse).max()
    assert_agree(jacobian @ inverse, np.eye(4), 4e-15, scale=size)
    assert_agree(inverse @ jacobian, np.eye(4), 4e-15, scale=size)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(), quads())
def test_force_maps_preserve_power(
    robot: Machine, angles: Angles, velocity: Quad, task: Quad, force: Quad
) -> None:
    """The force maps are the transposes of the velocity maps, including damped ones."""
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    pairs = (
        (
            task_velocity(geometry, kinematics, velocity),
            forces_from_task(geometry, kinematics, force, force),
        ),
        (motion(geometry, velocity), joint_torques(geometry, force)),
        (joint_rates(geometry, velocity), forces(geometry, force)),
    )
    for mapped, mapped_force in pairs:
        size = np.abs(mapped).max() * 3.0 + np.abs(mapped_force).max() * 3.0
        assert_agree(np.dot(force, mapped), np.dot(mapped_force, velocity), 1e-14, scale=size)
    mapped = motion_from_task(geometry, kinematics, task, task)
    mapped_task_force = task_from_forces(geometry, kinematics, force)
    size = np.abs(mapped).max() * 3.0 + np.abs(mapped_task_force).max() * 3.0
    assert_agree(np.dot(force, mapped), np.dot(mapped_task_force, task), 1e-14, scale=size)


@PROPERTY
@given(machines(), quads())
def test_reduced_and_quasi_velocities_are_one_to_one(robot: Machine, velocity: Quad) -> None:
    geometry = robot.geometry
    back = joint_rates(geometry, motion(geometry, velocity))
    assert_agree(back, velocity, 1e-13, scale=3.0)
    back = forces(geometry, joint_torques(geometry, velocity))
    assert_agree(back, velocity, 1e-13, scale=3.0)


def test_quasi_velocity_right_wheel_forward_turns_left() -> None:
    u, w, a, b = motion(ROBOT.geometry, (1.0, 0.0, 0.0, 0.0))
    r, half_track = DEFAULT['wheel_radius'], DEFAULT['half_track']
    assert u == pytest.approx(r / 2)
    assert w == a == b == pytest.approx(r / (2 * half_track))


def test_task_position_stretched_arm_points_ahead() -> None:
    geometry = ROBOT.geometry
    place = (1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    position = task_position(geometry, posture(geometry, place), place)
    assert position == pytest.approx((1.0 + 0.116 + 0.514 + 0.362, 2.0, 1.116, 2.0))


def undamped(geometry: Geometry, angles: Angles, x: Quad) -> tuple[Quad, Quad]:
    """Return J^-1 x and J^-T x with an undamped 1 / sin(theta_2), operation for operation."""
    p = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
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
def test_damped_inverse_outside_band_equals_exact_inverse(
    robot: Machine, angles: Angles, x: Quad
) -> None:
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    velocity, force = undamped(geometry, angles, x)
    assert motion_from_task(geometry, kinematics, x, x) == velocity
    assert task_from_forces(geometry, kinematics, x) == force


@PROPERTY
@given(machines(), all_angles(), quads())
@example(ROBOT, Angles(0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0))
@example(ROBOT, Angles(0.0, 0.0, math.pi), (1.0, 1.0, 1.0, 1.0))
def test_damped_inverse_any_posture_is_bounded(
    robot: Machine, angles: Angles, x: Quad
) -> None:
    geometry = robot.geometry
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    shortest = min(geometry.link_1, geometry.link_2, abs(geometry.arm_base), 1.0)
    limit = 4.0 * 12.0 / (SINGULAR_SINE * shortest)
    for result in (
        motion_from_task(geometry, kinematics, x, x),
        task_from_forces(geometry, kinematics, x),
    ):
        assert np.isfinite(result).all()
        assert np.abs(result).max() <= limit


def test_damped_inverse_is_continuous_and_zero_at_singularity() -> None:
    geometry = ROBOT.geometry
    edge = math.asin(SINGULAR_SINE)
    task = (0.3, -0.4, 0.1, 0.2)
    inside = posture_at(0.2, 0.5, edge * (1.0 - 1e-9))
    outside = posture_at(0.2, 0.5, edge * (1.0 + 1e-9))
    assert is_singular(geometry, inside)
    assert not is_singular(geometry, outside)
    assert_agree(
        motion_from_task(geometry, inside, task, task),
        motion_from_task(geometry, outside, task, task),
        1e-8,
    )
    assert motion_from_task(geometry, posture_at(0.2, 0.5, 0.0), task, task)[2:] == (0.0, 0.0)
