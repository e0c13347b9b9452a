# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The paper's robot as a mechanism: planar platform on two wheels, arm of two links.

Positions are x, y and yaw of the axle's middle, then the angles of right and left wheel and of
both arm joints; `motion` are the quasi-velocities (u, w, A, B) of this folder's docstring.
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.formula_types import HasGeometry
from masmc_ros.robot.forward_dynamics import joint_accelerations
from masmc_ros.robot.gradient_step import preserves_consistency, theta_step
from masmc_ros.robot.square_task import (
    motion_error,
    reference_motion,
    task_error,
    task_inertia,
    tracking,
)
from masmc_ros.robot.two_link import consistency, dynamics, geometry, kinematics
from masmc_ros.robot.two_link.constants import (
    comfortable_reach,
    constants,
    out_of_reach,
    payload_factors,
    start,
    tip_on_link,
)
from masmc_ros.robot.two_link.description import description
from masmc_ros.robot.two_link.drawing import outline
from masmc_ros.robot.two_link.dynamics import BaseParameters, Inertia, Quad, Regressor
from masmc_ros.robot.two_link.frames import frame_origins, frame_transforms
from masmc_ros.robot.two_link.geometry import Geometry, Posture
from masmc_ros.robot.two_link.platform_motion import base_motion
from masmc_ros.robot.two_link.polar_approach import approach_sample, approach_start, unfolded

__all__ = [
    'approach_sample',
    'approach_start',
    'base_motion',
    'comfortable_reach',
    'constants',
    'description',
    'frame_origins',
    'frame_transforms',
    'joint_accelerations',
    'motion_error',
    'out_of_reach',
    'outline',
    'payload_factors',
    'preserves_consistency',
    'reference_motion',
    'start',
    'task_error',
    'task_inertia',
    'theta_step',
    'tip_on_link',
    'tracking',
    'unfolded',
]

Pose = tuple[float, float, float]
Positions = tuple[float, float, float, float, float, float, float]
Theta = tuple[float, float, float, float, float, float, float]

MODEL = Geometry


@formula
def model_of(record: HasGeometry) -> Geometry:
    """Return the lengths that a record holds."""
    lengths = record.geometry
    return Geometry(lengths[0], lengths[1], lengths[2], lengths[3], lengths[4])


@formula
def _base_parameters(theta: Theta) -> BaseParameters:
    return BaseParameters(
        theta[0], theta[1], theta[2], theta[3], theta[4], theta[5], theta[6]
    )


@formula
def posture(model: Geometry, position: Positions) -> Posture:
    """Return sines and cosines of yaw and arm."""
    return geometry.posture(position[2], position[5], position[6])


@formula
def posture_of_joints(model: Geometry, angles: Quad) -> Posture:
    """Return sines and cosines of the arm, the platform looking along x."""
    return geometry.posture(0.0, angles[2], angles[3])


@formula
def motion(model: Geometry, rates: Quad) -> Quad:
    """Return (u, w, A, B) from the joints' rates."""
    return geometry.quasi_velocity(model, rates[0], rates[1], rates[2], rates[3])


@formula
def joint_rates(model: Geometry, motion: Quad) -> Quad:
    """Return the joints' rates from (u, w, A, B)."""
    return geometry.reduced_velocity(model, motion[0], motion[1], motion[2], motion[3])


@formula
def joint_torques(model: Geometry, forces: Quad) -> Quad:
    """Return the joints' torques from quasi-forces."""
    return geometry.joint_torque(model, forces[0], forces[1], forces[2], forces[3])


@formula
def forces(model: Geometry, torques: Quad) -> Quad:
    """Return the quasi-forces of joints' torques."""
    return geometry.quasi_force(model, torques[0], torques[1], torques[2], torques[3])


@formula
def position_rates(model: Geometry, posture: Posture, rates: Quad) -> Positions:
    """Return the derivative of the positions; pure rolling, (8)."""
    u, w, _, _ = geometry.quasi_velocity(model, rates[0], rates[1], rates[2], rates[3])
    return u * posture.c0, u * posture.s0, w, rates[0], rates[1], rates[2], rates[3]


@formula
def task_position(model: Geometry, posture: Posture, position: Positions) -> Quad:
    """Return (x_E, y_E, x_F, y_F)."""
    return kinematics.task_position(model, posture, position[0], position[1])


@formula
def task_velocity(model: Geometry, posture: Posture, motion: Quad) -> Quad:
    """Return J v."""
    return kinematics.task_velocity(model, posture, motion[0], motion[1], motion[2], motion[3])


@formula
def task_drift(model: Geometry, posture: Posture, motion: Quad, reference: Quad) -> Quad:
    """Return Jdot v_r."""
    return kinematics.task_drift(model, posture, motion, reference)


@formula
def motion_from_task(model: Geometry, posture: Posture, rates: Quad, template: Quad) -> Quad:
    """Return J^-1 xdot."""
    return kinematics.quasi_from_task(model, posture, rates[0], rates[1], rates[2], rates[3])


@formula
def forces_from_task(model: Geometry, posture: Posture, force: Quad, template: Quad) -> Quad:
    """Return J' F."""
    return kinematics.quasi_force_from_task(
        model, posture, force[0], force[1], force[2], force[3]
    )


@formula
def task_from_forces(model: Geometry, posture: Posture, forces: Quad) -> Quad:
    """Return J^-T f."""
    return kinematics.task_force_from_quasi(
        model, posture, forces[0], forces[1], forces[2], forces[3]
    )


@formula
def is_singular(model: Geometry, posture: Posture) -> bool:
    """Return True if the arm is too straight or too folded."""
    return kinematics.is_singular(posture)


@formula
def regressor(
    model: Geometry, posture: Posture, motion: Quad, reference: Quad, acceleration: Quad
) -> Regressor:
    """Return the regressor Y."""
    return dynamics.regressor(model, posture, motion, reference, acceleration)


@formula
def regressor_times(model: Geometry, y: Regressor, theta: Theta) -> Quad:
    """Return Y theta."""
    return dynamics.regressor_times(y, _base_parameters(theta))


@formula
def regressor_transpose_times(
    model: Geometry, y: Regressor, motion: Quad, template: Theta
) -> Theta:
    """Return Y' v."""
    return dynamics.regressor_transpose_times(y, motion[0], motion[1], motion[2], motion[3])


@formula
def inertia(model: Geometry, posture: Posture, theta: Theta) -> Inertia:
    """Return the inertia matrix H."""
    return dynamics.inertia(_base_parameters(theta), model, posture)


@formula
def inertia_times(model: Geometry, inertia: Inertia, acceleration: Quad) -> Quad:
    """Return H vdot."""
    return dynamics.inertia_times(
        inertia, acceleration[0], acceleration[1], acceleration[2], acceleration[3]
    )


@formula
def inertia_solve(model: Geometry, inertia: Inertia, forces: Quad) -> Quad:
    """Return H^-1 f."""
    return dynamics.inertia_solve(inertia, forces[0], forces[1], forces[2], forces[3])


@formula
def coriolis(model: Geometry, posture: Posture, theta: Theta, motion: Quad) -> Quad:
    """Return V v."""
    return dynamics.coriolis(_base_parameters(theta), model, posture, motion, motion)


@formula
def weakest_motion(model: Geometry, theta: Theta) -> tuple[float, Quad]:
    """Return the first pivot of Q(theta) that is not positive, and its x."""
    pivot, x_0, x_1, x_2, x_3 = consistency.weakest_motion(_base_parameters(theta), model)
    return pivot, (x_0, x_1, x_2, x_3)


@formula
def consistency_normal(model: Geometry, x: Quad, template: Theta) -> Theta:
    """Return the vector n with n' theta = x' Q(theta) x."""
    return consistency.normal(model, x[0], x[1], x[2], x[3])


@formula
def rate_command(model: Geometry, motion: Quad) -> Quad:
    """Return the platform's forward speed and yaw rate, then the arm joints' rates."""
    return motion[0], motion[1], motion[2] - motion[1], motion[3] - motion[2]


@formula
def commanded_joint_rates(model: Geometry, command: Quad) -> Quad:
    """Return the rates of the wheels and of the arm's joints that a command comes to."""
    right, left = geometry.wheel_rates(model, command[0], command[1])
    return right, left, command[2], command[3]


@formula
def dead_reckoned(model: Geometry, pose: Pose, turned: Quad) -> Pose:
    """
    Return the platform's pose after its wheels have turned.

    The platform moves along the mean of the headings at both ends. For an arc, this is exact to
    second order in the angle.
    """
    along, turn, _, _ = geometry.quasi_velocity(model, turned[0], turned[1], 0.0, 0.0)
    s, c = sin_cos(pose[2] + 0.5 * turn)
    return pose[0] + along * c, pose[1] + along * s, pose[2] + turn


@formula
def counts_turns(model: Geometry, resolution: Quad) -> bool:
    """Return True if the wheels' encoders have a finite resolution."""
    return (resolution[0] > 0.0) | (resolution[1] > 0.0)
