# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc demo`: the paper's experiment on real nodes, logged and reported."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import json
from pathlib import Path
import time

from masmc_ros.cli.arguments import add_json, add_output, print_choices
from masmc_ros.cli.commands.report import report
from masmc_ros.cli.node_processes import node_processes, NodeProcesses, private_domain
from masmc_ros.errors import require_rclpy, UserError
from masmc_ros.files import make_folder, scenario_file, scenarios, write_file
from masmc_ros.law.reaching.implicit import IMPLICIT
from masmc_ros.law.registry import SWITCHING_TERM
from masmc_ros.loop.timing import DURATION
from masmc_ros.params.declaration import MutableValues
from masmc_ros.report.measure.table import distance_text
from masmc_ros.robot.mechanisms import DEFAULT, mechanism_from
from masmc_ros.scenario.scenario import load_scenario, source_of
from tqdm import tqdm

RUNS: dict[str, MutableValues] = {
    'smc': {'law': 'smc'},
    'rasmc': {'law': 'rasmc'},
    'implicit': {'law': 'rasmc', 'switching': IMPLICIT.name, 'observer_gain': 0.5},
}
"""Controller parameters of the runs: the paper's laws, and the implicit one with an estimate."""

NODES = ('recorder', 'trajectory', 'controller', 'plant')

_START = 60.0
"""Time in s for the nodes to compile and to discover each other."""

_FIRST_START = 900.0
"""The same if the code of a robot may have to be compiled first, in s."""

_SLOWEST = 20.0
"""Longest time in s that a simulated second may take."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Run the paper's experiment: four ROS 2 nodes in lock-step on a private domain of this"
        ' machine, with smc, rasmc, and rasmc with the implicit switching term and a disturbance'
        ' estimate; log the runs and report them. --robot runs another experiment.'
    )
    add_output(parser, 'demo')
    parser.add_argument(
        '--robot',
        default='paper',
        metavar='NAME',
        help='experiment: an installed parameter file (masmc simulate --list), such as tiago, or '
        'the path of a parameter file or URDF (%(default)s)',
    )
    parser.add_argument('--composed', action='store_true', help='run all nodes in one process')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Run an experiment on real nodes with three laws, report it, and print what was shown.

    If the switching term of the parameter file is implicit, there is no third run.
    """
    require_rclpy()
    folder = Path(options.output)
    make_folder(folder)
    # An installed file first: a folder of the same name is not a parameter file.
    parameters = scenarios().get(options.robot) or Path(scenario_file(options.robot))
    source = source_of(str(parameters), folder=str(folder))
    if source.defaults is not None:
        print_choices(source)
        parameters = folder / f'{parameters.stem}.yaml'
        write_file(parameters, source.text)
    simulated = options.robot if source.defaults is None else parameters
    scenario = load_scenario(str(parameters))
    values, switching = scenario.plant, SWITCHING_TERM.of(scenario.controller)
    duration = DURATION.of(values)
    start = _START if mechanism_from(values).name == DEFAULT.name else _FIRST_START
    logs = []
    for name, controller in RUNS.items():
        if switching == controller.get('switching'):
            continue
        log = folder / f'{name}.mcap'
        with private_domain() as domain:
            patience = start + _SLOWEST * duration
            _run(name, parameters, log, domain, duration, patience, composed=options.composed)
        logs.append(str(log))
    metrics = report(logs, str(folder / 'report'), is_json=options.json)
    if options.json:
        return 0
    print(f'\nShown: {parameters.name} on ROS 2 nodes, {duration:g} s with each of these laws:')
    for label, reached in metrics.items():
        print(f'  {label}: {distance_text(reached)}')
    print(f'Report, in a browser: {folder / "report" / "report.html"}')
    print(f'Logs: {", ".join(logs)}')
    print(f'View a log in Foxglove: masmc view {logs[-1]}')
    print(f'Compute the run without ROS: masmc simulate {simulated}')
    return 0


def _run(
    name: str,
    parameters: Path,
    log: Path,
    domain: Mapping[str, str],
    duration: float,
    patience: float,
    *,
    composed: bool,
) -> None:
    """Run all nodes in lock-step with the controller of a run, and record into `log`."""
    arguments = ['--ros-args', '--params-file', str(parameters)]
    for setting in (
        *(f'controller:{parameter}:={value}' for parameter, value in RUNS[name].items()),
        f'plant:wait_for:=[{", ".join(n for n in NODES if n != "plant")}]',
        # Also if the file sets real time: a slow machine then loses no tick.
        *(f'{node}:pacing:=lockstep' for node in NODES),
        # Quoted: YAML reads '#' as a comment, and ': ' as a mapping.
        f'recorder:output:={json.dumps(str(log), ensure_ascii=False)}',
        'recorder:overwrite:=true',
    ):
        arguments += ['-p', setting]
    commands = (
        {'composed': ['--record', *arguments]} if composed else dict.fromkeys(NODES, arguments)
    )
    with node_processes(domain, log.parent) as nodes:
        for node, words in commands.items():
            nodes.start(node, words)
        _watch(name, nodes, domain, duration, patience)


def _watch(
    name: str,
    nodes: NodeProcesses,
    domain: Mapping[str, str],
    duration: float,
    patience: float,
) -> None:
    """Show progress until all nodes have ended or one has failed; UserError after `patience`."""
    # Imported here: without rclpy, `demo` ends with one line.
    from masmc_ros.cli.run_progress import run_progress

    limit = time.monotonic() + patience
    form = '{l_bar}{bar}| {n:.1f}/{total:.0f} s simulated [{elapsed}<{remaining}]'
    with (
        run_progress(int(domain['ROS_DOMAIN_ID'])) as progress,
        tqdm(total=duration, desc=name.rjust(8), bar_format=form, disable=None) as bar,
    ):
        while nodes.is_any_running():
            if nodes.has_any_failed():
                return
            if time.monotonic() > limit:
                raise UserError(f'{name}: no end after {patience:.0f} s')
            bar.update(min(progress(), duration) - bar.n)
        bar.update(duration - bar.n)
