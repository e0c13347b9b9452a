# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The joints, topics and labels that the messages of a run carry."""

from __future__ import annotations

from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.robot.joint_names import all_joints
from masmc_ros.robot.registry import DEFAULT

JOINTS = all_joints(DEFAULT)
"""Default joint names of a joint state."""
DRIVEN_JOINTS = JOINTS[len(DEFAULT.base):]
RATED_JOINTS = DRIVEN_JOINTS[len(DEFAULT.twist):]
"""Those that are commanded rates of their own where rates are."""

TASK_AXES = len(DEFAULT.axes)
"""Default axes of a reference."""

DERIVATIVES = 3
"""Position (m), velocity (m/s) and acceleration (m/s^2) of a reference."""

STATE_TOPIC = 'joint_states'
COMMAND_TOPIC = 'effort_commands'
CMD_VEL_TOPIC = 'cmd_vel'
ARM_VELOCITY_TOPIC = 'arm_velocity_commands'
CONTACT_TOPIC = 'plant/contact'
CONTACT_LABEL = 'contact'
REFERENCE_TOPIC = 'reference'
DESCRIPTION_TOPIC = 'robot_description'
DESIRED_PATH_TOPIC = 'path/desired'
ACTUAL_PATH_TOPIC = 'path/actual'
CLOCK_TOPIC = 'clock'

TELEMETRY = {signal.label: signal.count(DEFAULT.sizes) for signal in PUBLISHED}
"""Label of each telemetry message and its default number of values."""


def telemetry_topic(label: str) -> str:
    """Return the name, relative to the robot, under which `label` is published."""
    return f'controller/{label}'
