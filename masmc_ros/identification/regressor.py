# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Regressor of the equations of motion of a robot, averaged over `averaging_windows`."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array, Integers, Records
from masmc_ros.identification.averaging_windows import Weights
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.tuples import elementwise, unit
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.numerics.scalars import zero
from masmc_ros.robot import mechanism
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.friction import sliding
import numpy as np

_BODY = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('theta', 'parameters', 'Its base inertial parameters'),
    Field('position', 'positions', 'Positions', 'm, rad'),
    Field('rates', 'joints', "The joints' rates", 'rad/s'),
    Field('pose', 'base', 'Pose of the base', 'm, rad'),
)

FRICTIONS = ('viscous', 'coulomb')
"""Kinds of friction, whose coefficients follow the inertial parameters."""

COULOMB_SHARE = 0.1
"""Expected Coulomb friction, as a part of the RMS torque of the joint."""


class Equations(NamedTuple):
    """
    Averaged equations of motion: matrix x = torque - known.

    Attributes
    ----------
    matrix
        (W, n, q + 2 n) Factors of q inertial parameters, and of viscous and Coulomb friction of n
        joints.
    known
        (W, n) Torques that depend on no parameter, those of rotors, in N·m.

    """

    matrix: Array
    known: Array


def record_of(robot: Robot, theta: Array) -> Records:
    """Return an array of one record with a robot and its inertial parameters (q), for kernels."""
    body = new_record(_BODY, robot.mechanism.sizes, 1, {'mechanism': robot.mechanism.tag})
    fill(body, 'geometry', robot.geometry)
    fill(body, 'theta', theta)
    return body


def averaged(robot: Robot, position: Array, rates: Array, weights: Weights) -> Equations:
    """
    Return the equations of motion, averaged over windows.

    Parameters
    ----------
    robot
        Robot without friction; its inertial parameters are not used.
    position
        (N, positions) Positions in m and rad.
    rates
        (N, n) Joint rates in rad/s or m/s.
    weights
        Weights of the N samples in the windows.

    """
    joints, parameters = rates.shape[1], len(robot.theta)
    count = int(weights.window.max()) + 1
    matrix = np.zeros((count, joints, parameters + len(FRICTIONS) * joints))
    known = np.zeros((count, joints))
    body = record_of(robot, np.zeros(parameters))
    position, rates, mean, slope = map(
        np.ascontiguousarray, (position, rates, weights.mean, weights.slope)
    )
    window = np.ascontiguousarray(weights.window)
    _add_samples(body, position, rates, window, mean, slope, matrix, known)
    return Equations(matrix, known)


def instantaneous(robot: Robot, position: Array, rates: Array, acceleration: Array) -> Equations:
    """
    Return the equations of motion at N states, in place of averages over windows.

    Parameters
    ----------
    robot
        Robot without friction; its inertial parameters are not used.
    position
        (N, positions) Positions in m and rad.
    rates, acceleration
        (N, n) Joint rates and accelerations in rad/s and rad/s², or m/s and m/s².

    """
    joints, parameters = rates.shape[1], len(robot.theta)
    matrix = np.zeros((len(position), joints, parameters + len(FRICTIONS) * joints))
    known = np.zeros((len(position), joints))
    position, rates, acceleration = map(np.ascontiguousarray, (position, rates, acceleration))
    body = record_of(robot, np.zeros(parameters))
    _write_states(body, position, rates, acceleration, matrix, known)
    return Equations(matrix, known)


@kernel
def _write_states(
    body: Records, position: Array, rates: Array, acceleration: Array, matrix: Array, known: Array
) -> None:
    """Write the equations of motion at states (N), row by row in joint torques."""
    record = lane_of(body[0], 0)
    theta = record.theta
    place, template = record.position, record.rates
    model = mechanism.model_of(record)
    parameters, joints = len(theta), len(template)
    of_samples = mark(record)
    for k in range(len(position)):
        free(record, of_samples)
        posture = mechanism.posture(model, to_vector(position[k], place))
        v = mechanism.motion(model, to_vector(rates[k], template))
        a = mechanism.motion(model, to_vector(acceleration[k], template))
        y = mechanism.regressor(model, posture, v, v, a)
        rotors = mechanism.joint_torques(model, mechanism.regressor_times(model, y, theta))
        of_joints = mark(record)
        for j in range(joints):
            free(record, of_joints)
            along = mechanism.motion(model, unit(template, j))
            row = mechanism.regressor_transpose_times(model, y, along, theta)
            for i in range(parameters):
                matrix[k, j, i] = row[i]
            matrix[k, j, parameters + j] = rates[k, j]
            matrix[k, j, parameters + joints + j] = sliding(rates[k, j])
            known[k, j] = rotors[j]
    check_workspace(record)


@kernel
def _add_samples(
    body: Records,
    position: Array,
    rates: Array,
    window: Integers,
    mean: Array,
    slope: Array,
    matrix: Array,
    known: Array,
) -> None:
    """
    Add samples (N) to the equations of their windows, row by row in joint torques.

    v_j is the motion of joint j alone. Without gravity, the row of momentum is Y(0, 0, v)' v_j,
    and that of C' v is Y(v, v_j, 0)' v, because Hdot - 2 C is skew-symmetric.
    """
    record = lane_of(body[0], 0)
    theta = record.theta
    place, template = record.position, record.rates
    still = elementwise(zero, template)
    model = mechanism.model_of(record)
    parameters, joints = len(theta), len(template)
    momentum, force = np.empty(parameters), np.empty(parameters)
    of_samples = mark(record)
    for k in range(len(position)):
        if window[k, 0] < 0:
            continue
        free(record, of_samples)
        posture = mechanism.posture(model, to_vector(position[k], place))
        v = mechanism.motion(model, to_vector(rates[k], template))
        at_rest = mechanism.regressor(model, posture, still, still, still)
        moving = mechanism.regressor(model, posture, still, still, v)
        lifting = mechanism.regressor_transpose_times(model, at_rest, v, theta)
        rotors = mechanism.joint_torques(model, mechanism.regressor_times(model, moving, theta))
        of_joints = mark(record)
        for j in range(joints):
            free(record, of_joints)
            along = mechanism.motion(model, unit(template, j))
            gravity = mechanism.regressor_transpose_times(model, at_rest, along, theta)
            impulse = mechanism.regressor_transpose_times(model, moving, along, theta)
            turning = mechanism.regressor(model, posture, v, along, still)
            power = mechanism.regressor_transpose_times(model, turning, v, theta)
            for i in range(parameters):
                momentum[i] = impulse[i] - gravity[i]
                force[i] = gravity[i] - (power[i] - lifting[i])
            rate = rates[k, j]
            for m in range(window.shape[1]):
                w = window[k, m]
                if w < 0:
                    continue
                average, derivative = mean[k, m], slope[k, m]
                for i in range(parameters):
                    matrix[w, j, i] += derivative * momentum[i] + average * force[i]
                matrix[w, j, parameters + j] += average * rate
                matrix[w, j, parameters + joints + j] += average * sliding(rate)
                known[w, j] += derivative * rotors[j]
    check_workspace(record)
