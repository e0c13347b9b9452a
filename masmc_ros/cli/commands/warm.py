# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc warm`: compile the code of a robot and its laws before the first run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from masmc_ros.cli.arguments import add_json, add_settings
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.errors import InputError, suggestion
from masmc_ros.files import scenario_file
from masmc_ros.identification.latency_fit import compile_echo
from masmc_ros.jit.record import AT_RUN_TIME
from masmc_ros.law import registry
from masmc_ros.law.registry import LAW
from masmc_ros.loop.law_code import code_for
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.timing import CONTROL_PERIOD
from masmc_ros.reference.joined import load_code
from masmc_ros.report.measure.labels import law_label
from masmc_ros.result_text import json_text
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario

_TICKS = 3
"""Ticks of a run that loads or compiles the closed loop."""

_FILE = """
/**:
  ros__parameters:
    robot:
      task: joints
      urdf: >
        <robot name="arm"><link name="base_link"/><link name="arm">
        <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
        </inertial></link><joint name="joint" type="continuous"><parent link="base_link"/>
        <child link="arm"/><axis xyz="0 0 1"/></joint></robot>
"""
"""Robot of a URDF: its code is that of all robots of URDFs."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Compile what a parameter file needs for simulations and nodes, once per machine. Without'
        " a file: the paper's robot and its two laws, and without --laws also the default law of"
        ' robots described by a URDF.'
    )
    text = 'ROS 2 parameter file, or the name of an installed one (masmc simulate --list)'
    parser.add_argument('file', nargs='?', help=text)
    text = 'laws, separated by commas, or all; by default smc, rasmc and that of the file'
    parser.add_argument('--laws', metavar='LAWS', help=text)
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Compile the code of each law, and print the time that this took."""
    file = scenario_file(options.file or 'paper')
    scenario = load_scenario(file, options.set)
    def warm(file: str, settings: Sequence[str]) -> None:
        row = _warm(file, settings)
        rows.append(row)
        if not options.json:
            seconds = row['compile_time']
            state = f'compiled in {seconds:.1f} s' if seconds > 0.0 else 'present'
            print(f'{row["law"]} for {row["robot"]}: {state}')

    rows: list[dict[str, Any]] = []
    for law in _laws(options.laws, LAW.of(scenario.controller)):
        warm(file, [*options.set, f'controller.law={law}'])
    if options.file is None and options.laws is None and not options.set:
        with TemporaryDirectory() as folder:
            path = Path(folder) / 'arm.yaml'
            path.write_text(_FILE, encoding='utf-8')
            warm(str(path), [])
    if options.json:
        print(json_text({'code': rows}))
    return 0


def _warm(file: str, settings: Sequence[str]) -> dict[str, Any]:
    """Load or compile the code of a parameter file with settings; return its description."""
    scenario = load_scenario(file, settings)
    duration = _TICKS * CONTROL_PERIOD.of(scenario.plant)
    scenario = load_scenario(file, [*settings, f'duration={duration}'])
    mechanism = scenario.mechanism
    robot = 'robots of URDFs' if AT_RUN_TIME in mechanism.sizes else mechanism.name
    law = law_label(scenario.controller)
    with compile_notice(f'{law} for {robot}') as watch:
        _load(scenario)
    return {'law': law, 'robot': robot, 'compile_time': watch.total}


def _laws(chosen: str | None, of_file: str) -> tuple[str, ...]:
    if chosen is None:
        return tuple(dict.fromkeys(('smc', 'rasmc', of_file)))
    names = registry.names() if chosen == 'all' else tuple(chosen.split(','))
    for name in names:
        if name not in registry.names():
            hint = suggestion(name, registry.names())
            raise InputError(f"--laws: '{name}' is unknown; {hint}")
    return names


def _load(scenario: Scenario) -> None:
    """Load all kernels of a simulation and of the nodes, or compile them."""
    for _ in Simulation(scenario).run():
        pass
    plant = plant_of(scenario.plant, CONTROL_PERIOD.of(scenario.plant))
    plant.compile()
    compile_echo()
    code_for(plant.mechanism, scenario.controller).load()
    load_code(robot_of(scenario.trajectory))
