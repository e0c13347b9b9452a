# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Reduced dynamics (6)-(12) in quasi-velocities and base inertial parameters.

H vdot + V v = tau + tau_d with H = S'HS and V = S'HSdot + S'CS, C from Christoffel symbols;
motion is planar, so the gravity term is zero. In the linear parameterisation (12),
H a_r + V v_r = Y theta for any reference velocity v_r and acceleration a_r.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.jit.compiled import formula
from masmc_ros.robot.two_link.geometry import Geometry, Posture, Quad

Theta = tuple[float, float, float, float, float, float, float]


class BaseParameters(NamedTuple):
    """The seven combinations of masses, lengths and inertias that motion depends on."""

    mass: float  # M, kg
    yaw_inertia: float  # J, kg·m², about the axle's middle
    offset: float  # c, kg·m, first moment ahead of the axle
    moment_1: float  # p_1, kg·m, first moment of link 1 with link 2 at its end
    moment_2: float  # p_2, kg·m
    inertia_1: float  # i_1, kg·m², about the arm's base
    inertia_2: float  # i_2, kg·m², about joint 2


class Inertia(NamedTuple):
    """The entries of H in quasi-velocities; (u, w) is zero."""

    uu: float
    ww: float
    ua: float
    ub: float
    wa: float
    wb: float
    aa: float
    bb: float
    ab: float


class Regressor(NamedTuple):
    """
    The entries of Y in quasi-forces (rows f) and base parameters (columns) not always zero.

    Rows: u has mass, offset, moment_1, moment_2; w has yaw_inertia, offset, moment_1,
    moment_2; A has moment_1, moment_2, inertia_1; B has moment_2, inertia_2.
    """

    u_mass: float
    u_offset: float
    u_moment_1: float
    u_moment_2: float
    w_yaw_inertia: float
    w_offset: float
    w_moment_1: float
    w_moment_2: float
    a_moment_1: float
    a_moment_2: float
    a_inertia_1: float
    b_moment_2: float
    b_inertia_2: float


@formula
def inertia(model: Geometry, posture: Posture, theta: Theta) -> Inertia:
    """Return H of (10) in quasi-velocities."""
    mass, yaw_inertia, _, moment_1, moment_2, inertia_1, inertia_2 = theta
    return Inertia(
        uu=mass,
        ww=yaw_inertia,
        ua=-moment_1 * posture.s1,
        ub=-moment_2 * posture.s12,
        wa=model.arm_base * moment_1 * posture.c1,
        wb=model.arm_base * moment_2 * posture.c12,
        aa=inertia_1,
        bb=inertia_2,
        ab=model.link_1 * moment_2 * posture.c2,
    )


@formula
def inertia_times(model: Geometry, h: Inertia, acceleration: Quad) -> Quad:
    """Return H times a quasi-acceleration: quasi-forces."""
    u, w, a, b = acceleration
    return (
        h.uu * u + h.ua * a + h.ub * b,
        h.ww * w + h.wa * a + h.wb * b,
        h.ua * u + h.wa * w + h.aa * a + h.ab * b,
        h.ub * u + h.wb * w + h.ab * a + h.bb * b,
    )


@formula
def inertia_solve(model: Geometry, h: Inertia, forces: Quad) -> Quad:
    """Return H^-1 f, the quasi-acceleration: the 2x2 Schur complement of the arm."""
    f_u, f_w, f_a, f_b = forces
    per_mass = 1.0 / h.uu
    per_yaw = 1.0 / h.ww
    aa = h.aa - h.ua * h.ua * per_mass - h.wa * h.wa * per_yaw
    ab = h.ab - h.ua * h.ub * per_mass - h.wa * h.wb * per_yaw
    bb = h.bb - h.ub * h.ub * per_mass - h.wb * h.wb * per_yaw
    rest_a = f_a - h.ua * f_u * per_mass - h.wa * f_w * per_yaw
    rest_b = f_b - h.ub * f_u * per_mass - h.wb * f_w * per_yaw
    per_determinant = 1.0 / (aa * bb - ab * ab)
    a = (bb * rest_a - ab * rest_b) * per_determinant
    b = (aa * rest_b - ab * rest_a) * per_determinant
    u = (f_u - h.ua * a - h.ub * b) * per_mass
    w = (f_w - h.wa * a - h.wb * b) * per_yaw
    return u, w, a, b


@formula
def coriolis(model: Geometry, posture: Posture, theta: Theta, motion: Quad) -> Quad:
    """Return V(v) v, quasi-forces."""
    return coriolis_times(model, posture, theta, motion, motion)


@formula
def coriolis_times(
    model: Geometry, posture: Posture, theta: Theta, motion: Quad, reference: Quad
) -> Quad:
    """Return V(v) v_r of (10), quasi-forces, for which Hdot - 2 V is skew-symmetric."""
    _, _, offset, moment_1, moment_2, _, _ = theta
    _, w, a, b = motion
    u_r, w_r, a_r, b_r = reference
    swing_1 = moment_1 * a * a_r
    swing_2 = moment_2 * b * b_r
    pull = model.arm_base * w * w_r
    slide = w * u_r
    return (
        -offset * w * w_r - swing_1 * posture.c1 - swing_2 * posture.c12,
        offset * slide
        - model.arm_base * (swing_1 * posture.s1 + swing_2 * posture.s12),
        moment_1 * (posture.s1 * pull + posture.c1 * slide)
        - model.link_1 * posture.s2 * swing_2,
        moment_2
        * (
            posture.s12 * pull
            + posture.c12 * slide
            + model.link_1 * posture.s2 * a * a_r
        ),
    )


@formula
def regressor(
    model: Geometry, posture: Posture, motion: Quad, reference: Quad, acceleration: Quad
) -> Regressor:
    """Return Y(q, v, v_r, a_r) of (12): H a_r + V v_r = Y theta, all quasi-velocities."""
    _, w, a, b = motion
    u_r, w_r, a_r, b_r = reference
    u_dot, w_dot, a_dot, b_dot = acceleration
    l = model.arm_base  # noqa: E741 - the paper's symbol
    # Acceleration of the arm's base, platform frame.
    fx = u_dot - l * w * w_r
    fy = l * w_dot + w * u_r
    # Acceleration of a unit length along each link, relative to the joint it turns about.
    x_1 = -posture.s1 * a_dot - posture.c1 * a * a_r
    y_1 = posture.c1 * a_dot - posture.s1 * a * a_r
    x_2 = -posture.s12 * b_dot - posture.c12 * b * b_r
    y_2 = posture.c12 * b_dot - posture.s12 * b * b_r
    return Regressor(
        u_mass=u_dot,
        u_offset=-w * w_r,
        u_moment_1=x_1,
        u_moment_2=x_2,
        w_yaw_inertia=w_dot,
        w_offset=w * u_r,
        w_moment_1=l * y_1,
        w_moment_2=l * y_2,
        a_moment_1=posture.c1 * fy - posture.s1 * fx,
        a_moment_2=model.link_1 * (posture.c2 * b_dot - posture.s2 * b * b_r),
        a_inertia_1=a_dot,
        b_moment_2=posture.c12 * fy
        - posture.s12 * fx
        + model.link_1 * (posture.c2 * a_dot + posture.s2 * a * a_r),
        b_inertia_2=b_dot,
    )


@formula
def regressor_times(model: Geometry, y: Regressor, theta: Theta) -> Quad:
    """Return Y theta: quasi-forces."""
    mass, yaw_inertia, offset, moment_1, moment_2, inertia_1, inertia_2 = theta
    return (
        y.u_mass * mass
        + y.u_offset * offset
        + y.u_moment_1 * moment_1
        + y.u_moment_2 * moment_2,
        y.w_yaw_inertia * yaw_inertia
        + y.w_offset * offset
        + y.w_moment_1 * moment_1
        + y.w_moment_2 * moment_2,
        y.a_moment_1 * moment_1 + y.a_moment_2 * moment_2 + y.a_inertia_1 * inertia_1,
        y.b_moment_2 * moment_2 + y.b_inertia_2 * inertia_2,
    )


@formula
def regressor_transpose_times(
    model: Geometry, y: Regressor, motion: Quad, template: Theta
) -> Theta:
    """Return Y' times a quasi-velocity, in the order of the base parameters."""
    u, w, a, b = motion
    return (
        y.u_mass * u,
        y.w_yaw_inertia * w,
        y.u_offset * u + y.w_offset * w,
        y.u_moment_1 * u + y.w_moment_1 * w + y.a_moment_1 * a,
        y.u_moment_2 * u + y.w_moment_2 * w + y.a_moment_2 * a + y.b_moment_2 * b,
        y.a_inertia_1 * a,
        y.b_inertia_2 * b,
    )
