# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc layout`: layout for Foxglove with the plots of a robot."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
import json
from pathlib import Path
from typing import Any, NamedTuple

from masmc_ros.cli.arguments import add_file
from masmc_ros.errors import InputError
from masmc_ros.files import scenario_file, shared_file, write_file
from masmc_ros.law.command_interface import is_hybrid
from masmc_ros.log.bag import check_apart
from masmc_ros.log.read.reader import is_log, read_run
from masmc_ros.messages.telemetry import STAMP_NUMBERS
from masmc_ros.messages.topics import COMMAND_TOPIC, STATE_TOPIC, telemetry_topic
from masmc_ros.robot.declaration import MASS, Mechanism, Quantity, shown_parameters
from masmc_ros.robot.mechanisms import DEFAULT, mechanism_from
from masmc_ros.scenario.scenario import load_scenario

_COLOURS = (
    '#1f77b4', '#ff7f0e', '#2ca02c', '#d62728', '#9467bd', '#8c564b', '#17becf', '#e377c2',
    '#7f7f7f', '#bcbd22',
)  # fmt: skip

Lines = list[tuple[str, str]]
"""Names of lines, and their paths in messages."""

_LEGEND = 190
"""Width of legends in pixels, for names of links and joints."""

_CAMERA = {'distance': 4.0, 'targetOffset': [0.8, 0.0, 0.5]}
"""Distance from the robot's start and point ahead of it in m."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Write the layout for Foxglove with the plots of a robot: its task axes, joints and'
        ' parameters.'
    )
    add_file(parser, ', or a logged run')
    text = 'file to write (%(default)s)'
    parser.add_argument('--output', default='layout.json', metavar='FILE', help=text)


def run(options: argparse.Namespace) -> int:
    """Write the layout for the robot of a parameter file or a log."""
    path = Path(options.output)
    check_apart([path], [scenario_file(options.file)])
    write_layout(robot_in(options.file), path)
    print(f'{path}: in Foxglove, Layouts > Import from file')
    return 0


class LoggedRobot(NamedTuple):
    """Mechanism, and whether its base follows velocities and its arm torques."""

    mechanism: Mechanism
    is_hybrid: bool = False


def robot_in(source: str) -> LoggedRobot:
    """
    Return the robot of a parameter file, or of the parameters in a log.

    The log of a robot has no simulated plant: the parameters of its controller describe it.
    """
    if is_log(Path(source)):
        run = read_run(source)
        if run.parameters.keys().isdisjoint(('plant', 'controller')):
            raise InputError(
                f'{source}: no parameters of the plant or the controller, which describe the robot'
            )
        return LoggedRobot(run.mechanism, run.is_hybrid)
    values = load_scenario(scenario_file(source)).plant
    return LoggedRobot(mechanism_from(values), is_hybrid(values))


def write_layout(robot: LoggedRobot, path: Path) -> None:
    """Write the layout for a robot; InputError if that is not possible."""
    write_file(path, json.dumps(layout_for(*robot), indent=2).encode())


def layout_for(mechanism: Mechanism, is_hybrid: bool = False) -> dict[str, Any]:
    """
    Return the layout for a mechanism: that of the paper's robot with other plots.

    The joints except those of the base replace the plot of the plane. With a hybrid interface
    only their torques are commanded.
    """
    panels: dict[str, Any] = json.loads(shared_file('config', 'foxglove.json').read_text('utf-8'))
    plots = _plots(mechanism, is_hybrid)
    if mechanism.name == DEFAULT.name:
        if not is_hybrid:
            return panels
        plots = {'torque': plots['torque']}
    for name, (title, lines) in plots.items():
        panel = panels['configById'][f'Plot!{name}']
        template = panel['paths'][0]
        panel['paths'] = [
            {**template, 'value': value, 'label': line, 'color': _COLOURS[i % len(_COLOURS)]}
            for i, (line, value) in enumerate(lines)
        ]
        panel['foxglovePanelTitle'] = panel['lichtblickPanelTitle'] = title
        # Limits of the paper's torques, and of the plane.
        for setting in ('minYValue', 'maxYValue', 'xAxisPath'):
            panel.pop(setting, None)
        panel.update({'xAxisVal': 'timestamp', 'isSynced': True, 'sidebarDimension': _LEGEND})
    if mechanism.name == DEFAULT.name:
        return panels
    del panels['userNodes']['paths']
    panels['configById']['3D!scene']['cameraState'].update(_CAMERA)
    return panels


def _plots(mechanism: Mechanism, is_hybrid: bool) -> dict[str, tuple[str, Lines]]:
    """Return title and lines of the plots that depend on the mechanism, by their names."""
    axes, joints, theta = mechanism.axes, mechanism.joints, mechanism.theta
    driven = mechanism.own_rates if is_hybrid else joints
    limb = joints[mechanism.groups[-1].joints] if mechanism.groups else joints
    places = {place.name: i for i, place in enumerate(mechanism.positions)}
    estimates, title = _telemetry('parameter_estimate', theta), 'Parameter estimate θ̂'
    shown = shown_parameters(theta)
    if len(shown) < len(theta):
        title = 'Masses as estimated (kg)'
        estimates = [(estimates[i][0].removesuffix(MASS), estimates[i][1]) for i in shown]
    # The first axis of each unit.
    first = sorted({axis.unit: i for i, axis in reversed(list(enumerate(axes)))}.values())
    gains = (('K_s1', 'k_s1'), ('K_s2', 'k_s2'), ('σ', 'sigma'))
    return {
        'paths': (
            f'Joints ({_units(joint.unit for joint in limb)})',
            [(joint.short, f'/{STATE_TOPIC}.position[{places[joint.name]}]') for joint in limb],
        ),
        'error': (
            f'Tracking error e ({_units(axis.unit for axis in axes)})',
            _telemetry('tracking_error', axes),
        ),
        'surface': (
            f'Sliding surface s ({_units(f"{axis.unit}/s" for axis in axes)})',
            _telemetry('sliding_surface', axes),
        ),
        'estimate': (title, estimates),
        'torque': (
            f'Torque or force τ ({_units(joint.effort_unit for joint in driven)})',
            [(joint.short, f'/{COMMAND_TOPIC}.data[{i}]') for i, joint in enumerate(driven)],
        ),
        'gains': (
            'Gain changes',
            [
                (f'{symbol}, {axes[i].name}', f'/masmc/controller.{gain}[{i}]')
                for symbol, gain in gains
                for i in first
            ],
        ),
    }


def _units(units: Iterable[str]) -> str:
    """Return units, each once."""
    return ', '.join(dict.fromkeys(units))


def _telemetry(label: str, entries: Iterable[Quantity]) -> Lines:
    """Return names and paths of the entries of a topic of telemetry."""
    topic = telemetry_topic(label)
    return [
        (entry.name, f'/{topic}.data[{STAMP_NUMBERS + i}]') for i, entry in enumerate(entries)
    ]
