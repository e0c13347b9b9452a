# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of a run, relative to the robot, and the names of joints and labels in messages."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.loop.signals import CONTACT, PUBLISHED, Signal
from masmc_ros.robot.mechanisms import all_joints, DEFAULT

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


FLOAT_ARRAY = 'std_msgs/msg/Float64MultiArray'
ODOMETRY = 'nav_msgs/msg/Odometry'
PATH = 'nav_msgs/msg/Path'
STRING = 'std_msgs/msg/String'
INERTIA_STAMPED = 'geometry_msgs/msg/InertiaStamped'
TWIST = 'geometry_msgs/msg/Twist'
TWIST_STAMPED = 'geometry_msgs/msg/TwistStamped'
PARAMETER_NODES = ('plant', 'trajectory', 'controller')


class Topic(NamedTuple):
    """
    A topic with its message type, direction and content.

    Attributes
    ----------
    name, type_name
        Name and message type.
    direction, content
        Text for the documentation.
    is_latched
        True if late-joining subscriptions get past messages.
    holds
        True if a message is valid until the next one, for any time.
    turns_up
        True if only some runs have the topic; its publisher determines the type.

    """

    name: str
    type_name: str
    direction: str
    content: str
    is_latched: bool = True
    holds: bool = False
    turns_up: bool = False


def _in_unit(signal: Signal) -> str:
    """Return ' in UNIT', or '' if the components have different units."""
    component_units = {
        'axes': [axis.unit for axis in DEFAULT.axes],
        'joints': [joint.unit for joint in DEFAULT.joints],
        'parameters': [parameter.unit for parameter in DEFAULT.theta],
    }
    units = set(map(signal.unit_of, component_units.get(str(signal.size), ())))
    return f' in {units.pop()}' if len(units) == 1 else ''


def parameters_topic(node: str) -> str:
    """Return the topic of a node's current parameters."""
    return f'{node}/parameters'


TRANSFORMS = Topic(
    '/tf',
    'tf2_msgs/msg/TFMessage',
    'plant →',
    'all frames of the robot from `odom` on, in one message per tick; in a namespace without '
    'a `frame_prefix`, `tf` there',
)


def transforms_topic(namespace: str, frame_prefix: str) -> str:
    """
    Return the topic of a robot's transforms.

    Robots share /tf if prefixes distinguish their frames. If only namespaces do, each robot has a
    separate topic.
    """
    is_shared = frame_prefix or namespace == '/'
    return TRANSFORMS.name if is_shared else TRANSFORMS.name.lstrip('/')


_CONTACTS = tuple(f'{signal.description} in {signal.unit}' for signal in CONTACT)

TOPICS = (
    Topic(
        STATE_TOPIC,
        'sensor_msgs/msg/JointState',
        'plant → controller',
        'state at every tick, stamp t_k; effort is the torque of the interval just ended',
    ),
    Topic(
        COMMAND_TOPIC,
        FLOAT_ARRAY,
        'controller → plant',
        'four torques in N·m, with `command_interface` hybrid those of the arm; the label '
        '`effort@SEC.NANOSEC` has the stamp of the answered state; a `data_offset` of their '
        'number marks a void command',
    ),
    Topic(
        SHARED_TOPIC,
        FLOAT_ARRAY,
        'controller →',
        'with more wheels than velocities of the base and `command_interface` effort: the torques '
        'of all wheels in N·m, in the order of `robot.wheels`; label and void commands as on '
        'effort_commands',
        turns_up=True,
    ),
    Topic(
        CMD_VEL_TOPIC,
        TWIST,
        'controller → plant',
        'with `command_interface` velocity or hybrid: forward speed in m/s and yaw rate in rad/s; '
        'a TwistStamped in `base_link` with `enable_stamped_cmd_vel`',
        turns_up=True,
    ),
    Topic(
        ARM_VELOCITY_TOPIC,
        FLOAT_ARRAY,
        'controller → plant',
        'with `command_interface` velocity: velocities of the arm joints in rad/s; the label '
        '`velocity@SEC.NANOSEC` has the stamp of the answered state',
        turns_up=True,
    ),
    Topic(
        REFERENCE_TOPIC,
        FLOAT_ARRAY,
        'trajectory → controller',
        'windows of samples × (position, velocity, acceleration) × task axis, sent ahead; '
        '4, 8 or 12 bare numbers are a set-point, accepted while no trajectory runs',
    ),
    Topic('odom', ODOMETRY, 'plant →', 'pose and twist of `base_link` in `odom`'),
    Topic(
        CONTACT_TOPIC,
        FLOAT_ARRAY,
        'plant →',
        'with `physics` mujoco, of each wheel '
        f'{", ".join(_CONTACTS[:-1])} and {_CONTACTS[-1]}, after [sec, nanosec]',
        turns_up=True,
    ),
    Topic('base_twist', TWIST, 'plant →', 'measured velocity of the platform'),
    *(
        Topic(
            telemetry_topic(signal.label),
            FLOAT_ARRAY,
            'controller →',
            f'{signal.description} ({TELEMETRY[signal.label]})'
            f'{_in_unit(signal)}, after [sec, nanosec]',
            is_latched=False,
        )
        for signal in PUBLISHED
    ),
    Topic(
        PAYLOAD_TOPIC,
        INERTIA_STAMPED,
        'controller →',
        'with `payload.estimation_time`: mass and centre of mass of a significant payload, once a '
        'second; NaN for undetermined coordinates and for the moments of inertia',
        is_latched=False,
        turns_up=True,
    ),
    *(
        Topic(
            parameters_topic(node),
            STRING,
            f'{node} →',
            'current parameters as JSON, at the start and at every change with its first tick'
            + ('; resets and activations too' if node == 'controller' else ''),
            holds=True,
        )
        for node in PARAMETER_NODES
    ),
    Topic(
        CONTROLLER_STATE_TOPIC,
        STRING,
        'controller → trajectory',
        '`active`, `inactive: REASON` or `fault: REASON`, at every change',
        holds=True,
    ),
    Topic(
        CLOCK_TOPIC,
        'rosgraph_msgs/msg/Clock',
        'plant →',
        'simulated time, decimated: `/clock`, or that of the namespace',
        is_latched=False,
    ),
    Topic(
        '/diagnostics',
        'diagnostic_msgs/msg/DiagnosticArray',
        'plant, trajectory, controller, recorder →',
        'health and figures of each node, once a second',
    ),
    Topic(
        DESCRIPTION_TOPIC,
        STRING,
        'plant →',
        'the robot as URDF',
        holds=True,
    ),
    Topic(
        DESIRED_PATH_TOPIC,
        PATH,
        'trajectory →',
        'where the end effector is to go, in `odom`; of an endless trajectory the latest piece',
        holds=True,
    ),
    Topic(
        ACTUAL_PATH_TOPIC,
        PATH,
        'plant →',
        'where the end effector has been, in `odom`; its last 1000 poses, every 0.5 s',
        holds=True,
    ),
    TRANSFORMS,
)
"""Topics that the nodes of this package publish."""

SYSTEM_TOPICS = (
    Topic('/rosout', 'rcl_interfaces/msg/Log', 'all →', 'log messages'),
    Topic(
        '/parameter_events',
        'rcl_interfaces/msg/ParameterEvent',
        'all →',
        'changes of parameters',
        is_latched=False,
    ),
)
"""Topics that every ROS 2 node publishes; they are recorded too."""
