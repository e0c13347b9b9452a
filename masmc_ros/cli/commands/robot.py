# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc robot`: the robot of a parameter file, before it moves."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import json
import math
from textwrap import fill
from typing import Any

from masmc_ros.cli.arguments import add_file, add_json, add_settings
from masmc_ros.params.declaration import Values
from masmc_ros.params.scenario import load_scenario
from masmc_ros.report.aligned import aligned, WIDTH
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.share import scenario_file
import numpy as np


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Print joints, limits, masses and task of the robot of a parameter file, and its position'
        ' at the start.'
    )
    add_file(parser)
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print joints, their limits and torques, the task, and its position at the start."""
    robot = _robot(load_scenario(scenario_file(options.file), options.set))
    print(json.dumps(robot, indent=1) if options.json else _text(robot))
    return 0


def _robot(values: Mapping[str, Values]) -> dict[str, Any]:
    plant, control = values['plant'], values['controller']
    mechanism, made = mechanism_from(plant), robot_of(plant)
    position = np.array(made.start(plant['initial_pose'], plant['initial_joints']))
    task = made.task_positions(position[None])[0]
    limits = mechanism.joint_limits
    effort = control['torque_limit']
    start = position[-len(mechanism.joints):]
    return {
        'kind': mechanism.name,
        'joints': [
            {
                'name': joint.name,
                'unit': joint.unit,
                'start': float(start[i]),
                **{name: _finite(values[i]) for name, values in limits.items()},
                'torque_limit': float(effort[i]) or None,
                'torque_unit': joint.effort_unit,
            }
            for i, joint in enumerate(mechanism.joints)
        ],
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
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _text(robot: dict[str, Any]) -> str:
    names = [name for name in ('lower', 'upper', 'speed') if name in robot['joints'][0]]
    rows = [['joint', 'start', *names, 'controller.torque_limit']]
    for joint in robot['joints']:
        unit = joint['unit']
        units = {'lower': unit, 'upper': unit, 'speed': f'{unit}/s'}
        rows.append([
            joint['name'],
            f'{joint["start"]:g} {unit}',
            *(_known(joint[name], units[name]) for name in names),
            _known(joint['torque_limit'], joint['torque_unit']),
        ])
    table = aligned(rows, range(len(rows[0])), width=WIDTH)
    task = ', '.join(f'{axis["name"]} ({axis["unit"]})' for axis in robot['task'])
    start = ', '.join(f'{axis["start"]:.8g}' for axis in robot['task'])
    wrong = [joint['name'] for joint in robot['joints'] if _is_outside(joint)]
    masses = ', '.join(f'{name} {value:.4g}' for name, value in robot['masses'].items())
    lines = [
        f'task: {task}',
        f'at the start, where a path should start: [{start}]',
        *([f'masses in kg: {masses}'] if masses else []),
        *([f'outside of its limits at the start: {", ".join(wrong)}'] if wrong else []),
    ]
    return '\n'.join([
        f'robot: {robot["kind"]}, {robot["parameters"]} base inertial parameters',
        '',
        *table,
        '',
        *(fill(line, WIDTH, subsequent_indent='  ', break_on_hyphens=False) for line in lines),
    ])


def _is_outside(joint: dict[str, Any]) -> bool:
    lower, upper = joint.get('lower'), joint.get('upper')
    at = joint['start']
    return (lower is not None and at < lower) or (upper is not None and at > upper)


def _known(value: float | None, unit: str) -> str:
    return 'none' if value is None else f'{value:g} {unit}'
