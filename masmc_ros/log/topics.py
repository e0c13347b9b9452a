# SPDX-License-Identifier: Apache-2.0
"""The topics of a run, by their names relative to the robot."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.log.names import (
    COMMAND_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    TELEMETRY,
    telemetry_topic,
)

FLOAT_ARRAY = 'std_msgs/msg/Float64MultiArray'
PARAMETER_NODES = ('plant', 'trajectory', 'controller')


class Topic(NamedTuple):
    """A topic, its message type and what it carries."""

    name: str
    type_name: str
    direction: str
    content: str
    is_latched: bool = True
    """Whether late subscribers are given what was sent before."""


def parameters_topic(node: str) -> str:
    """Return the topic on which a node tells its parameters in force."""
    return f'{node}/parameters'


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
        'four torques in N·m; the label `effort@SEC.NANOSEC` names the state answered',
    ),
    Topic(
        REFERENCE_TOPIC,
        FLOAT_ARRAY,
        'trajectory → controller',
        'windows of samples × (position, velocity, acceleration) × task axis, sent ahead; '
        '4, 8 or 12 bare numbers are a set-point',
    ),
    Topic('odom', 'nav_msgs/msg/Odometry', 'plant →', 'pose and twist of `base_link` in `odom`'),
    Topic('base_twist', 'geometry_msgs/msg/Twist', 'plant →', "the platform's measured motion"),
    *(
        Topic(
            telemetry_topic(label),
            FLOAT_ARRAY,
            'controller →',
            {
                'tracking_error': 'e (4) in m, after [sec, nanosec]',
                'sliding_surface': 's (4) in m/s, after [sec, nanosec]',
                'parameter_estimate': 'θ̂ (7) used in the torque, after [sec, nanosec]',
            }[label],
        )
        for label in TELEMETRY
    ),
    *(
        Topic(
            parameters_topic(node),
            'std_msgs/msg/String',
            f'{node} →',
            'parameters in force as JSON, and every change with its first tick',
        )
        for node in PARAMETER_NODES
    ),
    Topic(
        'controller/state',
        'std_msgs/msg/String',
        'controller → trajectory',
        '`active`, `inactive: REASON` or `fault: REASON`, whenever it changes',
    ),
    Topic('/clock', 'rosgraph_msgs/msg/Clock', 'plant →', 'simulated time, decimated'),
    Topic(
        '/diagnostics',
        'diagnostic_msgs/msg/DiagnosticArray',
        'plant, controller →',
        'health and figures of each node, once a second',
    ),
)
"""What the nodes of this package publish."""

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
"""What every ROS 2 node publishes; recorded too."""
