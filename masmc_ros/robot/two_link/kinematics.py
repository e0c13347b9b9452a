# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Task-space kinematics (1)-(5): x = (x_E, y_E, x_F, y_F) in the world frame, metres.

All maps are written in quasi-velocities (see the folder's docstring) and in the platform's
frame, into which world vectors are turned first. The paper's Jacobian is J = R J_a of (4);
multiplying by it, by its derivative, its inverse and its transpose are the functions below,
each in closed form.

`base_motion` is the platform's pose and twist as odometry reports them.
"""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import clear
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.two_link.geometry import Geometry, Positions, Posture, Quad
import numpy as np

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
def task_position(model: Geometry, posture: Posture, position: Positions) -> Quad:
    """Return (x_E, y_E, x_F, y_F) in m; the first positions are x and y of the axle's middle O."""
    x, y = position[0], position[1]
    reach_x = model.arm_base + model.link_1 * posture.c1 + model.link_2 * posture.c12
    reach_y = model.link_1 * posture.s1 + model.link_2 * posture.s12
    ex, ey = rotate(posture.c0, posture.s0, reach_x, reach_y)
    fx = posture.c0 * model.arm_base
    fy = posture.s0 * model.arm_base
    return x + ex, y + ey, x + fx, y + fy


@formula
def task_velocity(model: Geometry, posture: Posture, motion: Quad) -> Quad:
    """Return J v, (1)-(4), in m/s."""
    u, w, a, b = motion
    fx = u
    fy = model.arm_base * w
    ex = fx - model.link_1 * posture.s1 * a - model.link_2 * posture.s12 * b
    ey = fy + model.link_1 * posture.c1 * a + model.link_2 * posture.c12 * b
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy


@formula
def task_drift(model: Geometry, posture: Posture, motion: Quad, reference: Quad) -> Quad:
    """Return Jdot(v) v_r of (5) in m/s2: velocity v and reference velocity v_r, both quasi."""
    _, w, a, b = motion
    u_r, w_r, a_r, b_r = reference
    fx = -w * (model.arm_base * w_r)
    fy = w * u_r
    pull_1 = model.link_1 * a * a_r
    pull_2 = model.link_2 * b * b_r
    ex = fx - pull_1 * posture.c1 - pull_2 * posture.c12
    ey = fy - pull_1 * posture.s1 - pull_2 * posture.s12
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy


@formula
def is_singular(model: Geometry, posture: Posture) -> bool:
    """Return True if the arm is too straight or too folded to invert J undamped."""
    return abs(posture.s2) < SINGULAR_SINE


@formula
def _inverse_sine(model: Geometry, posture: Posture) -> float:
    """
    Return 1 / sin(theta_2); inside the singular band the damped sin / 0.02**2.

    Both agree at the edge of the band. The damped function is zero at the singularity, so motion
    along the lost direction stops there instead of growing without bound.
    """
    damped = posture.s2 / (SINGULAR_SINE * SINGULAR_SINE)
    return damped if is_singular(model, posture) else 1.0 / posture.s2


@formula
def motion_from_task(model: Geometry, posture: Posture, rates: Quad, template: Quad) -> Quad:
    """
    Return J^-1 xdot as quasi-velocities; xdot is in the world frame, m/s.

    Exact for |sin(theta_2)| >= 0.02; finite everywhere.
    """
    ex, ey, fx, fy = rates
    ex, ey = rotate_back(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate_back(posture.c0, posture.s0, fx, fy)
    dx = ex - fx
    dy = ey - fy
    inverse = _inverse_sine(model, posture)
    a = (posture.c12 * dx + posture.s12 * dy) * inverse / model.link_1
    b = -(posture.c1 * dx + posture.s1 * dy) * inverse / model.link_2
    return fx, fy / model.arm_base, a, b


@formula
def forces_from_task(model: Geometry, posture: Posture, force: Quad, template: Quad) -> Quad:
    """Return the quasi-forces of J' F, F a world force (N) on E and on F."""
    ex, ey, fx, fy = force
    ex, ey = rotate_back(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate_back(posture.c0, posture.s0, fx, fy)
    f_a = model.link_1 * (posture.c1 * ey - posture.s1 * ex)
    f_b = model.link_2 * (posture.c12 * ey - posture.s12 * ex)
    return ex + fx, model.arm_base * (ey + fy), f_a, f_b


@formula
def task_from_forces(model: Geometry, posture: Posture, forces: Quad) -> Quad:
    """Return J^-T of the quasi-forces f: the world forces (N) on E and on F."""
    f_u, f_w, f_a, f_b = forces
    inverse = _inverse_sine(model, posture)
    pull_a = f_a * inverse / model.link_1
    pull_b = f_b * inverse / model.link_2
    ex = posture.c12 * pull_a - posture.c1 * pull_b
    ey = posture.s12 * pull_a - posture.s1 * pull_b
    fx = f_u - ex
    fy = f_w / model.arm_base - ey
    ex, ey = rotate(posture.c0, posture.s0, ex, ey)
    fx, fy = rotate(posture.c0, posture.s0, fx, fy)
    return ex, ey, fx, fy


@kernel
def base_motion(
    position: Array, velocity: Array
) -> tuple[Array, Array]:
    """
    Return poses (n, 7) and twists (n, 6) of states, positions and velocities (n, 7).

    Pose: x, y, z of `base_link` in `odom` in m and a quaternion x, y, z, w. Twist in
    `base_link`: linear in m/s, angular in rad/s.
    """
    n = len(position)
    pose, twist = np.empty((n, 7)), np.empty((n, 6))
    clear(pose)
    clear(twist)
    for k in range(n):
        pose[k, 0] = position[k, 0]
        pose[k, 1] = position[k, 1]
        pose[k, 5], pose[k, 6] = sin_cos(0.5 * position[k, 2])
        s, c = sin_cos(position[k, 2])
        twist[k, 0] = velocity[k, 0] * c + velocity[k, 1] * s
        twist[k, 5] = velocity[k, 2]
    return pose, twist
