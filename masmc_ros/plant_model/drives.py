# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Drives with a velocity loop: a PI controller on each joint, unknown to the controller.

At every integration step

    torque = 2 w H_i e + integral,   d integral / dt = w^2 H_i e,   e = commanded rate - rate,

where w is the bandwidth and H_i the diagonal entry of H for joint i at the start of the run. The
isolated joint then has both poles at -w. The integral stops as long as it would
increase the torque beyond the motor limit.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers, Records
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.tuples import unit
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.numerics.portable_math import exp
from masmc_ros.numerics.scalars import clipped
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismInertia
import numpy as np


@formula
def joint_inertia(model: Lengths, template: Numbers, h: MechanismInertia, joint: int) -> float:
    """
    Return the diagonal entry of a joint in the inertia matrix H of (10), in kg·m².

    Parameters
    ----------
    model
        Lengths of the mechanism.
    template
        Vector (joints).
    h
        Inertia of `mechanism.inertia`.
    joint
        Index of the joint.

    """
    v = mechanism.motion(model, unit(template, joint))
    return mechanism.joint_torques(model, mechanism.inertia_times(model, h, v))[joint]


@kernel
def joint_inertias(plant: Records, geometry: Array, theta: Array, angles: Array) -> Array:
    """
    Return the diagonals (n, joints) of the reduced inertia H of (10) of robots in kg·m².

    Parameters
    ----------
    plant
        Array of one record of one lane with the settings of a plant; its robot is overwritten.
    geometry, theta
        Lengths (n, lengths) and base inertial parameters (n, parameters) of the robots.
    angles
        Joint angles (n, joints) in rad.

    """
    robot, diagonals = lane_of(plant[0], 0), np.empty(angles.shape)
    template, start = robot.limit, mark(robot)
    for k in range(len(angles)):
        free(robot, start)
        robot.geometry = to_vector(geometry[k], robot.geometry)
        robot.theta = to_vector(theta[k], robot.theta)
        model = mechanism.model_of(robot)
        bend = mechanism.posture_of_joints(model, to_vector(angles[k], template))
        h = mechanism.inertia(model, bend, robot.theta)
        place = mark(robot)
        for joint in range(len(template)):
            free(robot, place)
            diagonals[k, joint] = joint_inertia(model, template, h, joint)
    check_workspace(robot)
    return diagonals


@formula
def drive(
    rate_error: float,
    integral: float,
    inertia: float,
    bandwidth: float,
    limit: float,
    h: float,
) -> tuple[float, float]:
    """
    Return the torque of a drive over one step in N·m, and its integral after the step in N·m.

    Parameters
    ----------
    rate_error
        Commanded rate minus rate in rad/s.
    integral
        Integral at the start of the step in N·m.
    inertia
        Inertia for which the drive is tuned in kg·m².
    bandwidth
        Bandwidth w in rad/s.
    limit
        Limit of the torque in N·m; 0: no limit.
    h
        Length of the step in s.

    """
    asked = 2.0 * bandwidth * inertia * rate_error + integral
    torque = clipped(asked, limit)
    step = h * bandwidth * bandwidth * inertia * rate_error
    winds_up = (asked > torque and step > 0.0) or (asked < torque and step < 0.0)
    return torque, integral if winds_up else integral + step


def lag_shares(lag: float, period: float, step: float) -> tuple[float, float]:
    """
    Return the shares of a past torque in that of a motor with a first-order lag.

    Parameters
    ----------
    lag
        Time constant in s; 0: no lag.
    period, step
        Control period and integration step in s.

    Returns
    -------
    decay
        exp(-step / (2 lag)), after half a step.
    mean
        Mean of exp(-t / lag) over a period.

    """
    if lag == 0.0:
        return 0.0, 0.0
    return exp(-0.5 * step / lag), lag / period * (1.0 - exp(-period / lag))


@formula
def lagging(target: float, motor: float, decay: float, halves: int) -> float:
    """
    Return the torque (or velocity) of a first-order lag after half steps towards a target.

    Parameters
    ----------
    target
        Value that the lag approaches.
    motor
        Value at the start of the step.
    decay
        Share of the difference that remains after half a step; 0: no lag.
    halves
        Number of half steps: 0, 1 or 2.

    """
    share = 1.0 if halves == 0 else (decay if halves == 1 else decay * decay)
    return target + share * (motor - target) if decay > 0.0 else target
