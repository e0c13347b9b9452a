# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Physical consistency of base parameters: Q(theta), masses of bodies and H(q)."""

from __future__ import annotations

from helpers.robots import (
    all_angles,
    Angles,
    Array,
    assert_agree,
    between,
    columns,
    Machine,
    machines,
    PROPERTY,
)
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.robot.two_link.consistency import consistency_normal, is_consistent, weakest_motion
from masmc_ros.robot.two_link.constants import base_parameters
from masmc_ros.robot.two_link.dynamics import BaseParameters, inertia, inertia_times
from masmc_ros.robot.two_link.geometry import Geometry, posture_at
import numpy as np

SEEDS = st.integers(0, 2**32 - 1)


def stretched(theta: BaseParameters, geometry: Geometry) -> Array:
    """Return Q(theta) (4, 4) as documented."""
    m, j, c, p_1, p_2, i_1, i_2 = theta
    l, link = geometry.arm_base, geometry.link_1  # noqa: E741 - the paper's symbol
    return np.array(
        [
            [m, c, p_1, p_2],
            [c, j, l * p_1, l * p_2],
            [p_1, l * p_1, i_1, link * p_2],
            [p_2, l * p_2, link * p_2, i_2],
        ]
    )


def entries_of(matrix: Array) -> BaseParameters:
    """Return theta from the entries of Q that are parameters."""
    m, j, i_1, i_2 = np.diag(matrix).tolist()
    c, p_1, p_2 = matrix[0, 1:].tolist()
    return BaseParameters(m, j, c, p_1, p_2, i_1, i_2)


def reduced_inertia(theta: BaseParameters, geometry: Geometry, angles: Angles) -> Array:
    """Return H(q) (4, 4) in quasi-velocities."""
    h = inertia(geometry, posture_at(angles.yaw, angles.arm_1, angles.arm_2), theta)
    return columns(lambda *v: inertia_times(geometry, h, v))


@st.composite
def any_parameters(draw: st.DrawFn) -> tuple[BaseParameters, Geometry]:
    """Draw lengths and seven parameters; bodies exist for about half of the draws."""
    robot = draw(machines())
    rng = np.random.default_rng(draw(SEEDS))
    size = draw(between(0.1, 0.9))
    m, j, i_1, i_2 = 10.0 ** rng.uniform(-1.5, 1.0, 4)
    l, link = robot.geometry.arm_base, robot.geometry.link_1  # noqa: E741
    c = rng.uniform(-1, 1) * size * np.sqrt(m * j)
    p_1 = rng.uniform(-1, 1) * size * min(np.sqrt(m * i_1), np.sqrt(j * i_1) / abs(l))
    p_2 = rng.uniform(-1, 1) * size * min(
        np.sqrt(m * i_2), np.sqrt(j * i_2) / abs(l), np.sqrt(i_1 * i_2) / link
    )
    return BaseParameters(*map(float, (m, j, c, p_1, p_2, i_1, i_2))), robot.geometry


@PROPERTY
@given(machines())
def test_consistency_parameters_of_bodies_is_true(robot: Machine) -> None:
    assert is_consistent(robot.geometry, robot.theta)
    assert np.linalg.eigvalsh(stretched(robot.theta, robot.geometry))[0] > 0.0


@PROPERTY
@given(any_parameters())
def test_consistency_is_true_if_q_is_positive_definite(
    drawn: tuple[BaseParameters, Geometry],
) -> None:
    theta, geometry = drawn
    matrix = stretched(theta, geometry)
    scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    least = np.linalg.eigvalsh(scaled)[0]
    if abs(least) > 1e-12:
        assert is_consistent(geometry, theta) == (least > 0.0)


@PROPERTY
@given(any_parameters())
def test_weakest_motion_pivot_equals_its_quadratic_form(
    drawn: tuple[BaseParameters, Geometry]
) -> None:
    theta, geometry = drawn
    pivot, motion = weakest_motion(geometry, theta)
    x, matrix = np.array(motion), stretched(theta, geometry)
    size = float(np.abs(x) @ np.abs(matrix) @ np.abs(x))
    assert_agree(x @ matrix @ x, pivot, 1e-12, scale=size)
    normal = np.array(consistency_normal(geometry, motion, theta))
    assert_agree(normal @ np.array(theta), pivot, 1e-12, scale=size)


@PROPERTY
@given(any_parameters(), all_angles())
def test_consistent_parameters_inertia_is_positive_definite(
    drawn: tuple[BaseParameters, Geometry], angles: Angles
) -> None:
    theta, geometry = drawn
    matrix = reduced_inertia(theta, geometry, angles)
    scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if is_consistent(geometry, theta):
        assert np.linalg.eigvalsh(scaled)[0] > -1e-13


def bodies(theta: BaseParameters, geometry: Geometry) -> dict[str, float]:
    """Return masses, inertias and centres of mass that have these base parameters."""
    m, j, c, p_1, p_2, i_1, i_2 = theta
    l, link = geometry.arm_base, geometry.link_1  # noqa: E741
    # The arm's mass lies between the minimum of the arm and the maximum that leaves a platform.
    moments = np.array([p_1, p_2])
    least = moments @ np.linalg.solve([[i_1, link * p_2], [link * p_2, i_2]], moments)
    most = (m * j - c * c) / (j + m * l * l - 2.0 * c * l)
    arm = 0.5 * (least + most)
    most_2 = (arm * i_1 - p_1 * p_1) / (i_1 + arm * link * link - 2.0 * p_1 * link)
    m_2 = 0.5 * (p_2 * p_2 / i_2 + most_2)
    m_1, m_c = arm - m_2, m - arm
    com_1, com_2, d = (p_1 - m_2 * link) / m_1, p_2 / m_2, (c - arm * l) / m_c
    return {
        'wheel_radius': geometry.wheel_radius,
        'half_track': geometry.half_track,
        'com_offset': d,
        'arm_offset': l - d,
        'link_1_length': link,
        'link_2_length': geometry.link_2,
        'link_1_com': com_1,
        'link_2_com': com_2,
        'platform_mass': m_c,
        'wheel_mass': 0.0,
        'link_1_mass': m_1,
        'link_2_mass': m_2,
        'platform_inertia': j - m_c * d * d - arm * l * l,
        'wheel_spin_inertia': 0.0,
        'wheel_yaw_inertia': 0.0,
        'link_1_inertia': i_1 - m_2 * link * link - m_1 * com_1 * com_1,
        'link_2_inertia': i_2 - m_2 * com_2 * com_2,
    }


@PROPERTY
@given(any_parameters())
def test_consistent_parameters_bodies_exist(
    drawn: tuple[BaseParameters, Geometry],
) -> None:
    theta, geometry = drawn
    matrix = stretched(theta, geometry)
    scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if np.linalg.eigvalsh(scaled)[0] < 1e-6:
        return
    physical = bodies(theta, geometry)
    for name, value in physical.items():
        if name.endswith(('_mass', '_inertia')) and not name.startswith('wheel'):
            assert value > 0.0, name
    assert_agree(base_parameters(**physical), theta, 1e-9)
