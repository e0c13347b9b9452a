# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc warm`: compile the code of a robot and its laws before the first run."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from masmc_ros.cli.arguments import add_settings
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.loop.preparation import code_for
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.declaration import Values
from masmc_ros.params.scenario import load_scenario
from masmc_ros.report.measure.labels import law_label
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.share import scenario_file

_TICKS = 3
"""Ticks of a run that loads or compiles the closed loop."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Compile what a parameter file needs for simulations and nodes, once per machine. Without'
        " a file: the paper's robot and its two laws."
    )
    text = 'ROS 2 parameter file, or the name of an installed one (masmc simulate --list)'
    parser.add_argument('file', nargs='?', default='paper', help=text)
    text = 'laws, separated by commas, or all; by default smc, rasmc and that of the file'
    parser.add_argument('--laws', metavar='LAWS', help=text)
    add_settings(parser)


def run(options: argparse.Namespace) -> int:
    """Compile the code of each law, and print the time that this took."""
    file = scenario_file(options.file)
    values = load_scenario(file, options.set)
    for law in _laws(options.laws, values['controller']['law']):
        duration = _TICKS * values['plant']['control_period']
        chosen = [*options.set, f'controller.law={law}', f'duration={duration}']
        values = load_scenario(file, chosen)
        robot = mechanism_from(values['plant']).name
        label = f'{law_label(values["controller"])} for {robot}'
        with compile_notice(label) as watch:
            _load(values)
        state = f'compiled in {watch.total:.1f} s' if watch.total > 0.0 else 'present'
        print(f'{label}: {state}')
    return 0


def _laws(chosen: str | None, of_file: str) -> tuple[str, ...]:
    if chosen is None:
        return tuple(dict.fromkeys(('smc', 'rasmc', of_file)))
    names = registry.names() if chosen == 'all' else tuple(chosen.split(','))
    for name in names:
        if name not in registry.names():
            hint = suggestion(name, registry.names())
            raise InputError(f"--laws: '{name}' is unknown; {hint}")
    return names


def _load(values: Mapping[str, Values]) -> None:
    """Load all kernels of a simulation, a controller node and a plant node, or compile them."""
    for _ in Simulation(values).run():
        pass
    plant = plant_of(values['plant'], values['plant']['control_period'])
    plant.compile()
    code_for(plant.mechanism, values['controller']).load()
