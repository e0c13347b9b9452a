# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's experiment: plant, trajectory, controller and, optionally, the recorder."""

from __future__ import annotations

import json
import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = 'masmc_ros'
SWITCH = ['true', 'false', 'True', 'False']


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument(
            'params_file',
            default_value='',
            description='ROS 2 parameter file for all nodes; empty: config/paper.yaml, with '
            'pacing:=realtime config/realtime.yaml after it.',
        ),
        DeclareLaunchArgument(
            'law',
            default_value='',
            description='Control law: a built-in one, listed by masmc laws, or a plugged-in one; '
            'empty: as in params_file.',
        ),
        DeclareLaunchArgument(
            'pacing',
            default_value='',
            choices=['', 'lockstep', 'realtime'],
            description='Pacing of plant and controller; empty: as in params_file.',
        ),
        DeclareLaunchArgument(
            'namespace', default_value='', description='Namespace of all nodes and topics.'
        ),
        DeclareLaunchArgument(
            'frame_prefix',
            default_value='',
            description='Prefix of all frames, such as left/; empty: as in params_file.',
        ),
        DeclareLaunchArgument(
            'clock',
            default_value='',
            description='Topic of the simulated time, such as /clock, for which only one robot '
            'may publish; empty: clock in the namespace, one topic per robot.',
        ),
        DeclareLaunchArgument(
            'record',
            default_value='true',
            choices=SWITCH,
            description='Record the run (MCAP).',
        ),
        DeclareLaunchArgument(
            'output',
            default_value='.',
            description='File to record into (*.mcap), or folder for a file named by the time.',
        ),
        DeclareLaunchArgument(
            'composed',
            default_value='false',
            choices=SWITCH,
            description='Run all nodes in one process.',
        ),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='false',
            choices=SWITCH,
            description='Use the topic of the argument clock as the clock of the nodes.',
        ),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[object]:
    def argument(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def is_on(name: str) -> bool:
        return argument(name).lower() == 'true'

    files = [argument('params_file')]
    if not files[0]:
        files = [_config('paper.yaml')]
        if argument('pacing') == 'realtime':
            files.append(_config('realtime.yaml'))
    record = is_on('record')
    # The nodes publish on `clock`; with use_sim_time they subscribe to `/clock`, as all nodes do.
    namespace = filter(None, argument('namespace').split('/'))
    clock = argument('clock') or '/'.join(['', *namespace, 'clock'])
    remappings = [('clock', clock), ('/clock', clock)]
    names = ['trajectory', 'controller', 'plant'] + (['recorder'] if record else [])
    settings: dict[str, dict[str, object]] = {name: {} for name in names}
    settings['plant']['wait_for'] = [name for name in names if name != 'plant']
    if argument('law'):
        settings['controller']['law'] = argument('law')
    if argument('pacing'):
        for name in ('plant', 'controller'):
            settings[name]['pacing'] = argument('pacing')
    if record:
        settings['recorder']['output'] = argument('output')
    for name in settings:
        if argument('frame_prefix'):
            settings[name]['frame_prefix'] = argument('frame_prefix')
        settings[name]['use_sim_time'] = is_on('use_sim_time')
    # Names of the nodes by executable.
    processes: dict[str, list[str]] = {name: [name] for name in settings}
    if is_on('composed'):
        processes = {'composed': names} | {n: [n] for n in settings if n not in names}
    nodes = [
        Node(
            package=PACKAGE,
            executable=executable,
            name=executable if executable in settings else None,
            namespace=argument('namespace'),
            arguments=[
                *(['--record'] if executable == 'composed' and record else []),
                *_parameters(files, {name: settings[name] for name in started}),
            ],
            remappings=remappings,
            output='screen',
        )
        for executable, started in processes.items()
    ]
    # All nodes end when the run is complete, or when one of them fails.
    return [*nodes, RegisterEventHandler(OnProcessExit(on_exit=_end_on_failure))]


def _config(name: str) -> str:
    return os.path.join(get_package_share_directory(PACKAGE), 'config', name)


def _parameters(files: list[str], settings: dict[str, dict[str, object]]) -> list[str]:
    """
    Return the arguments for parameter files, and for the settings of each node.

    A text has quotes. Without them rcl reads some texts as other types: 20251126, 1e3, yes. The
    parameters of a launch_ros Node have no quotes for some of these texts.
    """
    arguments = ['--ros-args']
    for file in files:
        arguments += ['--params-file', file]
    for node, values in settings.items():
        for name, value in values.items():
            arguments += ['-p', f'{node}:{name}:={json.dumps(value, ensure_ascii=False)}']
    return arguments


def _end_on_failure(event: object, context: LaunchContext) -> list[object] | None:
    if event.returncode != 0:
        return [EmitEvent(event=Shutdown(reason=f'{event.process_name} failed'))]
    return None
