# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Names of the joints, topics and labels in the messages of a run."""

from __future__ import annotations

from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.robot.joint_names import all_joints
from masmc_ros.robot.mechanisms import DEFAULT

JOINTS = all_joints(DEFAULT)
"""Default joint names of a joint state."""
DRIVEN_JOINTS = JOINTS[len(DEFAULT.base):]
RATED_JOINTS = DRIVEN_JOINTS[len(DEFAULT.twist):]
"""Joints that are commanded individually with commanded velocities; the others have a twist."""

TASK_AXES = len(DEFAULT.axes)
"""Default number of axes of a reference."""

DERIVATIVES = 3
"""Number of derivatives of a reference: position, velocity and acceleration."""

STATE_TOPIC = 'joint_states'
COMMAND_TOPIC = 'effort_commands'
SHARED_TOPIC = 'wheel_commands'
CMD_VEL_TOPIC = 'cmd_vel'
ARM_VELOCITY_TOPIC = 'arm_velocity_commands'
CONTACT_TOPIC = 'plant/contact'
PAYLOAD_TOPIC = 'controller/payload'
CONTROLLER_STATE_TOPIC = 'controller/state'
CONTACT_LABEL = 'contact'
REFERENCE_TOPIC = 'reference'
DESCRIPTION_TOPIC = 'robot_description'
DESIRED_PATH_TOPIC = 'path/desired'
ACTUAL_PATH_TOPIC = 'path/actual'
CLOCK_TOPIC = 'clock'

TELEMETRY = {signal.label: signal.count(DEFAULT.sizes) for signal in PUBLISHED}
"""Label of each telemetry message and its default number of values."""


def telemetry_topic(label: str) -> str:
    """Return the topic of a telemetry label, relative to the robot."""
    return f'controller/{label}'
