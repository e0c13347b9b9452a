# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lengths and joint angles as the formulas read them."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.portable_math import sines_and_cosines


class Geometry(NamedTuple):
    """Lengths of the robot in metres."""

    wheel_radius: float  # r
    half_track: float  # b
    arm_base: float  # l = d + L_a, from the axle to the arm's base
    link_1: float  # L_1
    link_2: float  # L_2


class Posture(NamedTuple):
    """Sines and cosines of platform and arm."""

    c0: float  # cos(phi)
    s0: float
    c1: float  # cos(theta_1)
    s1: float
    c2: float  # cos(theta_2)
    s2: float
    c12: float  # cos(theta_1 + theta_2)
    s12: float


@formula
def posture(yaw: float, theta_1: float, theta_2: float) -> Posture:
    """Return the sines and cosines of the platform's yaw and of the arm's joint angles (rad)."""
    (s0, c0), (s1, c1), (s2, c2) = sines_and_cosines((yaw, theta_1, theta_2))
    return Posture(c0, s0, c1, s1, c2, s2, c1 * c2 - s1 * s2, s1 * c2 + c1 * s2)


@formula
def quasi_velocity(
    geometry: Geometry, right: float, left: float, arm_1: float, arm_2: float
) -> tuple[float, float, float, float]:
    """
    Return (u, w, A, B) in m/s and rad/s from the reduced velocity v of (8) in rad/s.

    The right wheel forward turns the platform to the left: w = r / (2 b) (right - left).
    """
    u = 0.5 * geometry.wheel_radius * (right + left)
    w = 0.5 * geometry.wheel_radius / geometry.half_track * (right - left)
    a = w + arm_1
    return u, w, a, a + arm_2


@formula
def reduced_velocity(
    geometry: Geometry, u: float, w: float, a: float, b: float
) -> tuple[float, float, float, float]:
    """Return v (or its derivative) from quasi-velocities (or theirs): the inverse map."""
    right, left = wheel_rates(geometry, u, w)
    return right, left, a - w, b - a


@formula
def wheel_rates(geometry: Geometry, forward: float, turn: float) -> tuple[float, float]:
    """Return the rates of right and left wheel (rad/s) of a platform's motion (m/s, rad/s)."""
    sideways = geometry.half_track * turn
    right = (forward + sideways) / geometry.wheel_radius
    left = (forward - sideways) / geometry.wheel_radius
    return right, left


@formula
def joint_torque(
    geometry: Geometry, f_u: float, f_w: float, f_a: float, f_b: float
) -> tuple[float, float, float, float]:
    """Return the torques (N·m) in the order of v with the power of the quasi-forces f."""
    forward = 0.5 * geometry.wheel_radius * f_u
    turn = 0.5 * geometry.wheel_radius / geometry.half_track * (f_w + f_a + f_b)
    return forward + turn, forward - turn, f_a + f_b, f_b


@formula
def quasi_force(
    geometry: Geometry, right: float, left: float, arm_1: float, arm_2: float
) -> tuple[float, float, float, float]:
    """Return the quasi-forces (N, N·m) of torques in the order of v: the inverse map."""
    f_u = (right + left) / geometry.wheel_radius
    f_w = geometry.half_track * (right - left) / geometry.wheel_radius - arm_1
    return f_u, f_w, arm_1 - arm_2, arm_2
