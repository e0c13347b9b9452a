# SPDX-License-Identifier: Apache-2.0
"""The joints, frames and labels that the messages of a run carry."""

from __future__ import annotations

BASE_JOINTS = ('base_x_joint', 'base_y_joint', 'base_yaw_joint')
"""Pose of the axle midpoint in the world: m, m, rad; velocities m/s, m/s, rad/s."""

DRIVEN_JOINTS = ('wheel_right_joint', 'wheel_left_joint', 'arm_joint_1', 'arm_joint_2')
"""The joints that take a torque, in the order of the reduced velocity v; rad, rad/s, N m."""

JOINTS = BASE_JOINTS + DRIVEN_JOINTS
"""The joints in the order of a joint state."""

ODOM_FRAME = 'odom'
BASE_FRAME = 'base_link'

TASK_AXES = 4
"""x_E, y_E, x_F, y_F in the world, m."""

DERIVATIVES = 3
"""Position (m), velocity (m/s) and acceleration (m/s^2) of a reference."""

STATE_TOPIC = 'joint_states'
COMMAND_TOPIC = 'effort_commands'
REFERENCE_TOPIC = 'reference'

TELEMETRY = {'tracking_error': 4, 'sliding_surface': 4, 'parameter_estimate': 7}
"""Label of each telemetry message and how many values it carries."""


def telemetry_topic(label: str) -> str:
    """Return the name, relative to the robot, under which `label` is published."""
    return f'controller/{label}'
