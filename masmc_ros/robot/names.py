# SPDX-License-Identifier: Apache-2.0
"""The robot's joints and frames by name."""

from __future__ import annotations

BASE_JOINTS = ('base_x_joint', 'base_y_joint', 'base_yaw_joint')
"""Pose of the axle midpoint in the world: m, m, rad; velocities m/s, m/s, rad/s."""

DRIVEN_JOINTS = ('wheel_right_joint', 'wheel_left_joint', 'arm_joint_1', 'arm_joint_2')
"""The joints that take a torque, in the order of the reduced velocity v; rad, rad/s, N m."""

ARM_JOINTS = DRIVEN_JOINTS[2:]
"""The arm's joints alone."""

JOINTS = BASE_JOINTS + DRIVEN_JOINTS
"""The joints in the order of a joint state."""

ODOM_FRAME = 'odom'
BASE_FRAME = 'base_link'
END_EFFECTOR_FRAME = 'end_effector'

FRAMES = (
    (ODOM_FRAME, BASE_FRAME),
    (BASE_FRAME, 'wheel_right'),
    (BASE_FRAME, 'wheel_left'),
    (BASE_FRAME, 'link_1'),
    ('link_1', 'link_2'),
    ('link_2', END_EFFECTOR_FRAME),
)
"""Parent and child of every transform, parents first."""
