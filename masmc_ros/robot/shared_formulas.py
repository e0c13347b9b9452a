# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Formulas that mechanisms share: square tasks, independent parameters and forward dynamics.

Mechanisms without more specific formulas import them. A square task has as many axes as joints,
and its errors are differences of coordinates; in addition to the other formulas of the interface
such a mechanism has the first three formulas below.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Columns, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise, from_index, unit
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import LawSettings, Lengths, MechanismInertia, MechanismPosture
from masmc_ros.robot.mechanism import of_model, Tracking


@of_model
def task_drift(
    model: Lengths, posture: MechanismPosture, motion: Joints, reference: Joints
) -> Axes:
    """Return Jdot(v) v_r."""


@of_model
def task_from_forces(model: Lengths, posture: MechanismPosture, forces: Joints) -> Axes:
    """Return J^-T f."""


@of_model
def is_singular(model: Lengths, posture: MechanismPosture) -> bool:
    """Return True if J of a square task cannot be inverted undamped."""


@formula
def task_error(
    model: Lengths, posture: MechanismPosture, position: Numbers, desired: Numbers
) -> Numbers:
    """Return e = x - x_d."""
    return elementwise(minus, mechanism.task_position(model, posture, position), desired)


@formula
def tracking(
    model: Lengths,
    posture: MechanismPosture,
    position: Numbers,
    motion: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tracking:
    """Return e, edot twice, and the unmodified desired velocity and acceleration."""
    error = task_error(model, posture, position, desired[0])
    rate = elementwise(minus, mechanism.task_velocity(model, posture, motion), desired[1])
    return Tracking(error, rate, rate, desired[1], desired[2])


@formula
def reference_motion(
    model: Lengths,
    posture: MechanismPosture,
    position: Numbers,
    motion: Numbers,
    velocity: Numbers,
    acceleration: Numbers,
) -> tuple[Numbers, Numbers, bool]:
    """Return v_r = J^-1 xdot_r, a_r = J^-1 (xddot_r - Jdot v_r), and if J is close to singular."""
    v_r = mechanism.motion_from_task(model, posture, velocity, motion)
    drift = task_drift(model, posture, motion, v_r)
    difference = elementwise(minus, acceleration, drift)
    a_r = mechanism.motion_from_task(model, posture, difference, motion)
    return v_r, a_r, is_singular(model, posture)


@formula
def motion_error(
    model: Lengths,
    posture: MechanismPosture,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
) -> Numbers:
    """Return J^-1 s."""
    return mechanism.motion_from_task(model, posture, surface, motion)


@formula
def _task_inertia_column(
    arguments: tuple[Lengths, MechanismPosture, MechanismInertia, Numbers], j: int
) -> Numbers:
    model, posture, h, template = arguments
    v = mechanism.motion_from_task(model, posture, unit(template, j), template)
    return task_from_forces(model, posture, mechanism.inertia_times(model, h, v))


@formula
def task_inertia(
    model: Lengths, posture: MechanismPosture, theta: Numbers, surface: Numbers
) -> Columns:
    """Return H_x = J^-T H J^-1 of (11) by its columns, kg."""
    h = mechanism.inertia(model, posture, theta)
    return from_index(_task_inertia_column, surface, (model, posture, h, surface))


@formula
def gradient_step(estimate: float, gradient: float, gamma: float, period: float) -> float:
    """Return one parameter after an explicit step of (23); `gamma` its entry of Gamma."""
    return estimate - period * gradient / gamma


@formula
def theta_step(
    model: Lengths, settings: LawSettings, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """Return theta - T Gamma^-1 g."""
    return elementwise(gradient_step, theta, gradient, settings.gamma, period)


@formula
def preserves_consistency(model: Lengths, settings: LawSettings) -> bool:
    """Return False: independent parameters can be physically inconsistent."""
    return False


@formula
def joint_accelerations(
    model: Lengths, posture: MechanismPosture, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """Return the joint accelerations of H^-1 (f - V v - g)."""
    bias = mechanism.coriolis(model, posture, theta, mechanism.motion(model, rates))
    force = elementwise(minus, mechanism.forces(model, torques), bias)
    h = mechanism.inertia(model, posture, theta)
    return mechanism.joint_rates(model, mechanism.inertia_solve(model, h, force))
