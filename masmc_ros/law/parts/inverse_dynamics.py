# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Torque of a model for a task acceleration or a force, at the measured velocity.

v are the velocities of `robot.mechanism`, (joints) like forces and torques. Task vectors are
(axes). SI units: m and rad, m/s² and rad/s², N and N·m by the kind of an axis or joint.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise, matrix_times
from masmc_ros.law.parts.surface import reference_acceleration
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, plus, zero
from masmc_ros.robot import mechanism

STIFFNESS, DAMPING = 900.0, 60.0
"""
Default gains in 1/s² and 1/s of laws that invert the model: 30 rad/s, critically damped.

This is the largest natural frequency, in steps of 5 rad/s, at which none of 64 random robots loses
the path behind the limits of the drives; docs/reference/laws/comparison.md.
"""


@formula
def task_velocity(tick: Tick) -> Numbers:
    """Return J v (axes), the velocity of the task."""
    return elementwise(plus, tick.error_rate, tick.desired_velocity)


@formula
def rate_error(tick: Tick) -> Numbers:
    """Return the joint rates of v - v_r (joints) in rad/s or m/s."""
    return mechanism.joint_rates(
        tick.model, elementwise(minus, tick.velocity, tick.reference_velocity)
    )


@formula
def motion_acceleration(tick: Tick, acceleration: Numbers) -> Numbers:
    """
    Return dv/dt = J^-1 (xddot - Jdot v) (joints) for a task acceleration xddot (axes).

    It is damped close to a singularity of J. The mechanism determines the motion of a redundant
    robot in the null space, towards its posture.
    """
    return mechanism.reference_motion(
        tick.model, tick.posture, tick.position, tick.velocity, task_velocity(tick), acceleration
    )[1]


@formula
def model_forces(tick: Tick, theta: Numbers, acceleration: Numbers) -> Numbers:
    """
    Return the forces H dv/dt + V v + g (joints) of a model, conjugate to v.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base inertial parameters (parameters) of the model.
    acceleration
        dv/dt (joints).

    """
    y = mechanism.regressor(tick.model, tick.posture, tick.velocity, tick.velocity, acceleration)
    return mechanism.regressor_times(tick.model, y, theta)


@formula
def acceleration_torque(tick: Tick, theta: Numbers, acceleration: Numbers) -> Numbers:
    """
    Return the joint torques (joints) in N·m with which a model has a task acceleration.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base inertial parameters (parameters) of the model.
    acceleration
        Task acceleration xddot (axes).

    """
    f = model_forces(tick, theta, motion_acceleration(tick, acceleration))
    return mechanism.joint_torques(tick.model, f)


@formula
def _spring(desired: float, rate: float, error: float, k_d: float, k_p: float) -> float:
    return desired - k_d * rate - k_p * error


@formula
def spring(tick: Tick, k_d: Numbers, k_p: Numbers) -> Numbers:
    """
    Return the task acceleration (axes) xddot_c = xddot_d - K_d edot - K_p e.

    Parameters
    ----------
    tick
        State and reference.
    k_d, k_p
        Gains (axes) in 1/s and 1/s².

    """
    return elementwise(_spring, tick.desired_acceleration, tick.error_rate, tick.error, k_d, k_p)


@formula
def _with_surface_rate(desired: float, rate: float, sigma: float, nu: float) -> float:
    return reference_acceleration(desired, rate, sigma) + nu


@formula
def surface_torque(tick: Tick, theta: Numbers, sigma: Numbers, nu: Numbers) -> Numbers:
    """
    Return the joint torques (joints) in N·m with which a model has ds/dt = nu.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base inertial parameters (parameters) of the model.
    sigma
        Rates (axes) of the sliding surface in 1/s.
    nu
        ds/dt (axes) in m/s².

    """
    acceleration = elementwise(
        _with_surface_rate, tick.desired_acceleration, tick.error_derivative, sigma, nu
    )
    return acceleration_torque(tick, theta, acceleration)


@formula
def limited_motion(tick: Tick, theta: Numbers, raw: Numbers, torque: Numbers) -> Numbers:
    """
    Return the change of dv/dt (joints) by limits of the torque: H^-1 (torque - raw), mostly 0.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base inertial parameters (parameters) of the model with inertia H.
    raw
        Joint torques that the law requests in N·m.
    torque
        Joint torques that are commanded in N·m.

    """
    if torque == raw:
        return elementwise(zero, tick.velocity)
    force = mechanism.forces(tick.model, elementwise(minus, torque, raw))
    h = mechanism.inertia(tick.model, tick.posture, theta)
    return mechanism.inertia_solve(tick.model, h, force)


@formula
def limited_acceleration(tick: Tick, theta: Numbers, raw: Numbers, torque: Numbers) -> Numbers:
    """
    Return the change of the task acceleration (axes) by limits of the torque: J `limited_motion`.

    Parameters
    ----------
    tick
        State and reference.
    theta
        Base inertial parameters (parameters) of the model with inertia H.
    raw
        Joint torques that the law requests in N·m.
    torque
        Joint torques that are commanded in N·m.

    """
    if torque == raw:
        return elementwise(zero, tick.surface)
    a = limited_motion(tick, theta, raw, torque)
    return mechanism.task_velocity(tick.model, tick.posture, a)


@formula
def limited_force(tick: Tick, raw: Numbers, torque: Numbers) -> Numbers:
    """
    Return the change of the force on the task axes (axes) by limits of the torque, in N.

    It is the nominal task inertia times `limited_acceleration`.

    Parameters
    ----------
    tick
        State and reference.
    raw
        Joint torques that the law requests in N·m.
    torque
        Joint torques that are commanded in N·m.

    """
    if torque == raw:
        return elementwise(zero, tick.surface)
    h = mechanism.task_inertia(tick.model, tick.posture, tick.nominal, tick.surface)
    return matrix_times(h, limited_acceleration(tick, tick.nominal, raw, torque))


@formula
def gravity_forces(tick: Tick, theta: Numbers) -> Numbers:
    """Return the forces (joints) against gravity of a model with theta, conjugate to v."""
    still = elementwise(zero, tick.velocity)
    y = mechanism.regressor(tick.model, tick.posture, still, still, still)
    return mechanism.regressor_times(tick.model, y, theta)


@formula
def task_force_torque(tick: Tick, u: Numbers) -> Numbers:
    """Return the joint torques (joints) in N·m of J' u, with a force u (axes) on the task in N."""
    f = mechanism.forces_from_task(tick.model, tick.posture, u, tick.velocity)
    return mechanism.joint_torques(tick.model, f)
