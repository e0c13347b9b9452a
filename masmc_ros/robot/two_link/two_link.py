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
from masmc_ros.robot.shared_formulas import (
    joint_accelerations,
    motion_error,
    preserves_consistency,
    reference_motion,
    task_error,
    task_inertia,
    theta_step,
    tracking,
)
from masmc_ros.robot.two_link.consistency import consistency_normal, weakest_motion
from masmc_ros.robot.two_link.constants import (
    comfortable_reach,
    constants,
    out_of_reach,
    payload_factors,
    start,
    tip_on_link,
)
from masmc_ros.robot.two_link.description import description, outline
from masmc_ros.robot.two_link.dynamics import (
    coriolis,
    inertia,
    inertia_solve,
    inertia_times,
    regressor,
    regressor_times,
    regressor_transpose_times,
)
from masmc_ros.robot.two_link.frames import frame_origins, frame_transforms
from masmc_ros.robot.two_link.geometry import (
    forces,
    Geometry,
    joint_rates,
    joint_torques,
    model_of,
    motion,
    Positions,
    Posture,
    posture,
    posture_of_joints,
    Quad,
    wheel_rates,
)
from masmc_ros.robot.two_link.kinematics import (
    base_motion,
    forces_from_task,
    is_singular,
    motion_from_task,
    task_drift,
    task_from_forces,
    task_position,
    task_velocity,
)
from masmc_ros.robot.two_link.polar_approach import approach_sample, approach_start, unfolded

__all__ = [
    'approach_sample',
    'approach_start',
    'base_motion',
    'comfortable_reach',
    'consistency_normal',
    'constants',
    'coriolis',
    'description',
    'forces',
    'forces_from_task',
    'frame_origins',
    'frame_transforms',
    'inertia',
    'inertia_solve',
    'inertia_times',
    'is_singular',
    'joint_accelerations',
    'joint_rates',
    'joint_torques',
    'model_of',
    'motion',
    'motion_error',
    'motion_from_task',
    'out_of_reach',
    'outline',
    'payload_factors',
    'posture',
    'posture_of_joints',
    'preserves_consistency',
    'reference_motion',
    'regressor',
    'regressor_times',
    'regressor_transpose_times',
    'start',
    'task_drift',
    'task_error',
    'task_from_forces',
    'task_inertia',
    'task_position',
    'task_velocity',
    'theta_step',
    'tip_on_link',
    'tracking',
    'unfolded',
    'weakest_motion',
]

Pose = tuple[float, float, float]

MODEL = Geometry


@formula
def position_rates(model: Geometry, posture: Posture, rates: Quad) -> Positions:
    """Return the derivative of the positions; pure rolling, (8)."""
    u, w, _, _ = motion(model, rates)
    return u * posture.c0, u * posture.s0, w, rates[0], rates[1], rates[2], rates[3]


@formula
def rate_command(model: Geometry, motion: Quad) -> Quad:
    """Return the platform's forward speed and yaw rate, then the arm joints' rates."""
    return motion[0], motion[1], motion[2] - motion[1], motion[3] - motion[2]


@formula
def commanded_joint_rates(model: Geometry, command: Quad) -> Quad:
    """Return the rates of the wheels and of the arm's joints that a command comes to."""
    right, left = wheel_rates(model, command[0], command[1])
    return right, left, command[2], command[3]


@formula
def dead_reckoned(model: Geometry, pose: Pose, turned: Quad) -> Pose:
    """
    Return the platform's pose after its wheels have turned.

    The platform moves along the mean of the headings at both ends. For an arc, this is exact to
    second order in the angle.
    """
    along, turn, _, _ = motion(model, turned)
    s, c = sin_cos(pose[2] + 0.5 * turn)
    return pose[0] + along * c, pose[1] + along * s, pose[2] + turn


@formula
def counts_turns(model: Geometry, resolution: Quad) -> bool:
    """Return True if the wheels' encoders have a finite resolution."""
    return (resolution[0] > 0.0) | (resolution[1] > 0.0)
