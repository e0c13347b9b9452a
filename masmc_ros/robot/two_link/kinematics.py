# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Task-space kinematics (1)-(5): x = (x_E, y_E, x_F, y_F) in the world frame, metres.

All maps are written in quasi-velocities (see the folder's docstring) and in the platform's
frame, into which world vectors are turned first. The paper's Jacobian is J = R J_a of (4);
multiplying by it, by its derivative, its inverse and its transpose are the functions below,
each in closed form.
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.robot.two_link.geometry import Geometry, Posture

SINGULAR_SINE = 0.02
"""Largest |sin(theta_2)| of a singular arm."""


@formula
def rotate(c: float, s: float, x: float, y: float) -> tuple[float, float]:
    """Turn a vector of the platform's frame into the world's."""
    return c * x - s * y, s * x + c * y


@formula
def rotate_back(c: float, s: float, x: float, y: float) -> tuple[float, float]:
    """Turn a vector of the world's frame into the platform's."""
    return c * x + s * y, c * y - s * x


@formula
def task_position(
    geometry: Geometry, posture: Posture, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return (x_E, y_E, x_F, y_F) in m, (x, y) being the axle's middle O in the world."""
    reach_x = geometry.arm_base + geometry.link_1 * posture.c1 + geometry.link_2 * posture.c12
    reach_y = geometry.link_1 * posture.s1 + geometry.link_2 * posture.s12
    ex, ey = rotate(posture.c0, posture.s0, reach_x, reach_y)
    fx = posture.c0 * geometry.arm_base
    fy = posture.s0 * geometry.arm_base
    return x + ex, y + ey, x + fx, y + fy


@formula
def task_velocity(
    geometry: Geometry, posture: Posture, u: float, w: float, a: float, b: float
) -> tuple[float, float, float, float]:
    """Return J v, (1)-(4), in m/s."""
    fx = u
    fy = geometry.arm_base * w
    ex = fx - geometry.link_1 * posture.s1 * a - geometry.link_2 * posture.s12 * b
    ey = fy + geometry.link_1 * posture.c1 * a + geometry.link_2 * posture.c12 * b
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy


@formula
def task_drift(
    geometry: Geometry,
    posture: Posture,
    velocity: tuple[float, float, float, float],
    reference: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Return Jdot(v) v_r of (5) in m/s2: velocity v and reference velocity v_r, both quasi."""
    _, w, a, b = velocity
    u_r, w_r, a_r, b_r = reference
    fx = -w * (geometry.arm_base * w_r)
    fy = w * u_r
    pull_1 = geometry.link_1 * a * a_r
    pull_2 = geometry.link_2 * b * b_r
    ex = fx - pull_1 * posture.c1 - pull_2 * posture.c12
    ey = fy - pull_1 * posture.s1 - pull_2 * posture.s12
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy


@formula
def is_singular(posture: Posture) -> bool:
    """Return True if the arm is too straight or too folded to invert J undamped."""
    return abs(posture.s2) < SINGULAR_SINE


@formula
def _inverse_sine(posture: Posture) -> float:
    """
    Return 1 / sin(theta_2); inside the singular band the damped sin / 0.02**2.

    Both agree at the edge of the band. The damped function is zero at the singularity, so motion
    along the lost direction stops there instead of growing without bound.
    """
    damped = posture.s2 / (SINGULAR_SINE * SINGULAR_SINE)
    return damped if is_singular(posture) else 1.0 / posture.s2


@formula
def quasi_from_task(
    geometry: Geometry, posture: Posture, ex: float, ey: float, fx: float, fy: float
) -> tuple[float, float, float, float]:
    """
    Return J^-1 xdot as quasi-velocities, (ex, ey, fx, fy) in the world frame, m/s.

    Exact for |sin(theta_2)| >= 0.02; finite everywhere.
    """
    ex, ey = rotate_back(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate_back(posture.c0, posture.s0, fx, fy)
    dx = ex - fx
    dy = ey - fy
    inverse = _inverse_sine(posture)
    a = (posture.c12 * dx + posture.s12 * dy) * inverse / geometry.link_1
    b = -(posture.c1 * dx + posture.s1 * dy) * inverse / geometry.link_2
    return fx, fy / geometry.arm_base, a, b


@formula
def quasi_force_from_task(
    geometry: Geometry, posture: Posture, ex: float, ey: float, fx: float, fy: float
) -> tuple[float, float, float, float]:
    """Return the quasi-forces of J' F, F a world force (N) on E and on F."""
    ex, ey = rotate_back(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate_back(posture.c0, posture.s0, fx, fy)
    f_a = geometry.link_1 * (posture.c1 * ey - posture.s1 * ex)
    f_b = geometry.link_2 * (posture.c12 * ey - posture.s12 * ex)
    return ex + fx, geometry.arm_base * (ey + fy), f_a, f_b


@formula
def task_force_from_quasi(
    geometry: Geometry, posture: Posture, f_u: float, f_w: float, f_a: float, f_b: float
) -> tuple[float, float, float, float]:
    """Return J^-T of the quasi-forces f: the world forces (N) on E and on F."""
    inverse = _inverse_sine(posture)
    pull_a = f_a * inverse / geometry.link_1
    pull_b = f_b * inverse / geometry.link_2
    ex = posture.c12 * pull_a - posture.c1 * pull_b
    ey = posture.s12 * pull_a - posture.s1 * pull_b
    fx = f_u - ex
    fy = f_w / geometry.arm_base - ey
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy
