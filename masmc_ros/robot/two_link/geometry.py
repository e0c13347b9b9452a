# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lengths and posture as the formulas read them, and the maps between joints and (u, w, A, B)."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.portable_math import sines_and_cosines
from masmc_ros.robot.formula_types import HasGeometry

Quad = tuple[float, float, float, float]
Positions = tuple[float, float, float, float, float, float, float]


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
def model_of(record: HasGeometry) -> Geometry:
    """Return the lengths that a record holds."""
    lengths = record.geometry
    return Geometry(lengths[0], lengths[1], lengths[2], lengths[3], lengths[4])


@formula
def posture_at(yaw: float, theta_1: float, theta_2: float) -> Posture:
    """Return the sines and cosines of the platform's yaw and of the arm's joint angles (rad)."""
    (s0, c0), (s1, c1), (s2, c2) = sines_and_cosines((yaw, theta_1, theta_2))
    return Posture(c0, s0, c1, s1, c2, s2, c1 * c2 - s1 * s2, s1 * c2 + c1 * s2)


@formula
def posture(model: Geometry, position: Positions) -> Posture:
    """Return the sines and cosines of yaw and arm."""
    return posture_at(position[2], position[5], position[6])


@formula
def posture_of_joints(model: Geometry, angles: Quad) -> Posture:
    """Return the sines and cosines of the arm; the platform looks along x."""
    return posture_at(0.0, angles[2], angles[3])


@formula
def motion(model: Geometry, rates: Quad) -> Quad:
    """
    Return (u, w, A, B) in m/s and rad/s from the reduced velocity v of (8) in rad/s.

    The right wheel forward turns the platform to the left: w = r / (2 b) (right - left).
    """
    right, left, arm_1, arm_2 = rates
    u = 0.5 * model.wheel_radius * (right + left)
    w = 0.5 * model.wheel_radius / model.half_track * (right - left)
    a = w + arm_1
    return u, w, a, a + arm_2


@formula
def joint_rates(model: Geometry, motion: Quad) -> Quad:
    """Return v (or its derivative) from quasi-velocities (or theirs): the inverse map."""
    u, w, a, b = motion
    right, left = wheel_rates(model, u, w)
    return right, left, a - w, b - a


@formula
def wheel_rates(model: Geometry, forward: float, turn: float) -> tuple[float, float]:
    """Return the rates of right and left wheel (rad/s) of a platform's motion (m/s, rad/s)."""
    sideways = model.half_track * turn
    right = (forward + sideways) / model.wheel_radius
    left = (forward - sideways) / model.wheel_radius
    return right, left


@formula
def joint_torques(model: Geometry, forces: Quad) -> Quad:
    """Return the torques (N·m) in the order of v with the power of the quasi-forces f."""
    f_u, f_w, f_a, f_b = forces
    forward = 0.5 * model.wheel_radius * f_u
    turn = 0.5 * model.wheel_radius / model.half_track * (f_w + f_a + f_b)
    return forward + turn, forward - turn, f_a + f_b, f_b


@formula
def forces(model: Geometry, torques: Quad) -> Quad:
    """Return the quasi-forces (N, N·m) of torques in the order of v: the inverse map."""
    right, left, arm_1, arm_2 = torques
    f_u = (right + left) / model.wheel_radius
    f_w = model.half_track * (right - left) / model.wheel_radius - arm_1
    return f_u, f_w, arm_1 - arm_2, arm_2
