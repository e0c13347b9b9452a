# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Controller, trajectory and recorder for a robot or for another simulator, without a plant.

A node that fails does not end the others: without the recorder the controller still holds the arm.
"""

from __future__ import annotations

import json

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = 'masmc_ros'
SWITCH = ['true', 'false']

TOPICS = {
    'joint_states': ('/joint_states', 'Topic of the joint states.'),
    'odom': ('/odom', 'Topic of the odometry.'),
    'cmd_vel': ('/diff_drive_controller/cmd_vel', 'Topic of the base velocities.'),
    'arm_commands': ('/arm_effort/commands', 'Topic of the torques or velocities of the arm.'),
}
"""Launch arguments for topics: default and description."""

TEXTS = {
    'command_interface': ('', 'effort, velocity, or hybrid: base by velocity, arm by torque.'),
    'pose_source': ('', 'Source of the base pose: odom, or joint_states.'),
    'pose_frame': ('', 'Frame of the path, such as map.'),
}
"""Launch arguments for texts among the parameters of the controller: default and description."""

SETTINGS = {
    'control_period': ('', 'Period of joint_states in s.'),
    'enable_stamped_cmd_vel': ('true', 'true for TwistStamped on cmd_vel, false for Twist.'),
    'base_lag': ('', 'Time constant in s with which the base follows cmd_vel.'),
    'latency': ('', 'Time in s from the measurement of a state to the effect of its torque.'),
    'motor_lag': ('', 'Time constant of the motors in s.'),
    'torque_limit': ('', 'Limits of the torques in N·m, such as [3.0, 3.0].'),
    'torque_rate_limit': ('', 'Limits of the rates of the torques in N·m/s.'),
    'active_on_start': ('false', 'false: `ros2 lifecycle set /controller activate` starts it.'),
}
"""Launch arguments for its other parameters, as YAML: default and description."""


def generate_launch_description() -> LaunchDescription:
    own = 'empty: as in params_file.'
    arguments = [
        DeclareLaunchArgument(
            'params_file',
            default_value='',
            description='Parameter file of robot, path and gains; commas separate several files.',
        ),
        *(
            DeclareLaunchArgument(name, default_value=default, description=description)
            for name, (default, description) in TOPICS.items()
        ),
        *(
            DeclareLaunchArgument(name, default_value=default, description=f'{text} {own}')
            for name, (default, text) in (TEXTS | SETTINGS).items()
        ),
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of nodes.'),
        DeclareLaunchArgument(
            'record', default_value='true', choices=SWITCH, description='Record the run (MCAP).'
        ),
        DeclareLaunchArgument(
            'output',
            default_value='.',
            description='File to record into (*.mcap), or folder for a file named by the time.',
        ),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='false',
            choices=SWITCH,
            description='Use the clock of a simulator.',
        ),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[object]:
    def argument(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    files = [file for file in argument('params_file').split(',') if file]
    if not files:
        raise RuntimeError('params_file: expected a parameter file, as in params_file:=robot.yaml')
    arm = argument('arm_commands')
    remappings = [
        *((name, argument(name)) for name in ('joint_states', 'odom', 'cmd_vel')),
        ('effort_commands', arm),
        ('arm_velocity_commands', arm),
    ]
    # rcl reads some texts without quotes as other types: 20251126, 1e3, yes.
    controller = {name: _quoted(argument(name)) for name in TEXTS if argument(name)}
    controller |= {name: argument(name) for name in SETTINGS if argument(name)}
    # The path starts with the activation, and does not end as that of a simulation.
    trajectory = {'start_time': '-1.0'}
    if 'control_period' in controller:
        trajectory['control_period'] = controller['control_period']
    settings = {
        'controller': {'pacing': 'realtime', **controller},
        'trajectory': trajectory,
        'recorder': {'output': _quoted(argument('output'))},
    }
    names = [name for name in settings if name != 'recorder' or argument('record') == 'true']
    shared = {'duration': '0.0', 'use_sim_time': argument('use_sim_time')}
    return [
        Node(
            package=PACKAGE,
            executable=name,
            name=name,
            namespace=argument('namespace'),
            arguments=_parameters(files, name, {**shared, **settings[name]}),
            remappings=remappings,
            output='screen',
        )
        for name in names
    ]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _parameters(files: list[str], node: str, settings: dict[str, str]) -> list[str]:
    arguments = ['--ros-args']
    for file in files:
        arguments += ['--params-file', file]
    for name, value in settings.items():
        arguments += ['-p', f'{node}:{name}:={value}']
    return arguments
