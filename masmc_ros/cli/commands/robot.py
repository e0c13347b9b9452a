# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc robot`: the robot of a parameter file or URDF, before it moves."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from textwrap import fill
from typing import Any

from masmc_ros.cli import arguments
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, scenario_file, write_file
from masmc_ros.law.parts.joint_limits import TORQUE_LIMIT
from masmc_ros.log.bag import check_apart
from masmc_ros.loop.plant_parameters import INITIAL_JOINTS, INITIAL_POSE
from masmc_ros.loop.scenario import Scenario
from masmc_ros.result_text import aligned, json_text, WIDTH
from masmc_ros.scenario.scenario import lowest_limits, source_of
import numpy as np


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Print joints, limits, gravity torques, masses and task of the robot of a parameter file'
        ' or URDF, and its position at the start. For a URDF, print the choices for all that it'
        ' does not contain.'
    )
    arguments.add_file(parser, ', or a URDF')
    arguments.add_settings(parser)
    parser.add_argument(
        '--write', metavar='FILE.yaml', help='write the parameter file for the robot of a URDF'
    )
    arguments.add_overwrite(parser)
    arguments.add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print joints, their limits and torques, the task, and its position at the start."""
    file = scenario_file(options.file)
    source = source_of(file, options.set)
    robot = _robot(source.scenario())
    if options.write is not None:
        _write(Path(options.write), file, options)
    robot['choices'] = arguments.choices_of(source.defaults)
    robot['warnings'] += source.defaults.notes if source.defaults else ()
    robot['written'] = options.write
    print(json_text(robot) if options.json else _text(robot))
    return 0


def _write(path: Path, file: str, options: argparse.Namespace) -> None:
    """Write the parameter file of a URDF; InputError for a file that is none."""
    source = source_of(file, options.set, str(path.parent))
    if source.defaults is None:
        raise InputError(f'--write {path}: {file} is a parameter file already; expected a URDF')
    check_apart([path], [file])
    check_absent(path, overwrite=options.overwrite)
    write_file(path, source.text)


def _robot(scenario: Scenario) -> dict[str, Any]:
    plant, control = scenario.plant, scenario.controller
    mechanism, made = scenario.mechanism, scenario.robot
    position = np.array(made.start(INITIAL_POSE.of(plant), INITIAL_JOINTS.of(plant)))
    task = made.task_positions(position[None])[0]
    limits = mechanism.joint_limits
    effort = TORQUE_LIMIT.of(control)
    start = position[-len(mechanism.joints):]
    at_end = mechanism.at_range_ends(start[None])[0]
    details = dict(mechanism.details(start))
    gravity = [details.pop(name, None) for name in ('gravity', 'largest_gravity')]
    joints = [
        {
            'name': joint.name,
            'unit': joint.unit,
            'start': float(start[i]),
            'at_end': bool(at_end[i]),
            **{name: _finite(values[i]) for name, values in limits.items()},
            'torque_limit': float(effort[i]) or None,
            'torque_unit': joint.effort_unit,
            **{
                name: values[i]
                for name, values in zip(('gravity', 'largest_gravity'), gravity, strict=True)
                if values is not None
            },
        }
        for i, joint in enumerate(mechanism.joints)
    ]
    return {
        'kind': mechanism.name,
        'joints': joints,
        'task': [
            {'name': axis.name, 'unit': axis.unit, 'start': float(at)}
            for axis, at in zip(mechanism.axes, task, strict=True)
        ],
        'parameters': len(mechanism.theta),
        'masses': {
            quantity.name: float(value)
            for quantity, value in zip(mechanism.theta, made.theta, strict=True)
            if quantity.unit == 'kg'
        },
        **details,
        'notes': mechanism.notes,
        'warnings': [
            *mechanism.start_warnings(start, lowest_limits(scenario)), *_weak(joints)
        ],
    }


def _weak(joints: list[dict[str, Any]]) -> list[str]:
    """Return a warning of torque limits below the largest gravity torques, or none."""
    weak = [
        f'{joint["name"]} up to {joint["largest_gravity"]:.3g} {joint["torque_unit"]}, limit'
        f' {joint["torque_limit"]:g} {joint["torque_unit"]}'
        for joint in joints
        if joint['torque_limit'] and (joint.get('largest_gravity') or 0.0) > joint['torque_limit']
    ]
    return [f'limit below gravity in a part of the range: {"; ".join(weak)}'] if weak else []


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _text(robot: dict[str, Any]) -> str:
    names = [name for name in ('lower', 'upper', 'speed') if name in robot['joints'][0]]
    torques = [name for name in ('gravity', 'largest_gravity') if name in robot['joints'][0]]
    heads = {'gravity': 'gravity at the start', 'largest_gravity': 'largest gravity'}
    rows = [
        ['joint', 'start', *names, 'controller.torque_limit', *(heads[name] for name in torques)]
    ]
    for joint in robot['joints']:
        unit = joint['unit']
        units = {'lower': unit, 'upper': unit, 'speed': f'{unit}/s'}
        rows.append([
            joint['name'],
            f'{joint["start"]:g} {unit}',
            *(_known(joint[name], units[name]) for name in names),
            _known(joint['torque_limit'], joint['torque_unit']),
            *(_torque(joint[name], joint['torque_unit']) for name in torques),
        ])
    table = aligned(rows, range(len(rows[0])), width=WIDTH)
    task = ', '.join(f'{axis["name"]} ({axis["unit"]})' for axis in robot['task'])
    start = ', '.join(f'{axis["start"]:.8g}' for axis in robot['task'])
    outside = {joint['name'] for joint in robot['joints'] if _is_outside(joint)}
    ends = [j['name'] for j in robot['joints'] if j['at_end'] and j['name'] not in outside]
    masses = ', '.join(f'{name} {value:.4g}' for name, value in robot['masses'].items())
    lines = [
        f'task: {task}',
        f'at the start, where a path should start: [{start}]',
        *([f'masses in kg: {masses}'] if masses else []),
        *_details(robot),
        *([f'at the end of its range at the start: {", ".join(ends)}'] if ends else []),
        *(f'warning: {note}' for note in (*robot['notes'], *robot['warnings'])),
    ]
    return '\n'.join([
        f'robot: {robot["kind"]}, {robot["parameters"]} base inertial parameters',
        '',
        *table,
        '',
        *(fill(line, WIDTH, subsequent_indent='  ', break_on_hyphens=False) for line in lines),
        *arguments.choice_lines(robot['choices']),
        *([f'written: {robot["written"]}'] if robot['written'] else []),
    ])


def _details(robot: dict[str, Any]) -> list[str]:
    """Return lines about the robot of a URDF."""
    if 'tip' not in robot:
        return []
    held = {
        kind: [
            f'{joint["name"]} {joint["position"]:g} {joint["unit"]}'
            for joint in robot['held']
            if joint['is_free'] == is_free
        ]
        for kind, is_free in (('held', False), ('free on the robot, held in the model', True))
    }
    mimic = [
        f'{j["name"]} = {j["multiplier"]:g} {j["mimics"]} + {j["offset"]:g}'
        for j in robot['mimic']
    ]
    return [
        f'tip: {robot["tip"]}; reach from the first joint on the way to it:'
        f' {robot["reach"]:.4g} m',
        f'total mass: {robot["total_mass"]:.4g} kg',
        f'friction: {robot["friction"]} (robot.friction)',
        *(f'{kind}: {", ".join(joints)}' for kind, joints in held.items() if joints),
        *([f'mimic: {", ".join(mimic)}'] if mimic else []),
    ]


def _is_outside(joint: dict[str, Any]) -> bool:
    lower, upper = joint.get('lower'), joint.get('upper')
    at = joint['start']
    return (lower is not None and at < lower) or (upper is not None and at > upper)


def _torque(value: float | None, unit: str) -> str:
    # Rounding errors of a torque that is 0 are none.
    return '-' if value is None else f'{round(value, 9) + 0.0:.3g} {unit}'


def _known(value: float | None, unit: str) -> str:
    return 'none' if value is None else f'{value:g} {unit}'
