# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc laws`: list of the control laws, their sources, and the cost of a tick."""

from __future__ import annotations

import argparse
import textwrap
from time import perf_counter

from masmc_ros.cli.arguments import add_json
from masmc_ros.jit.compiled import bound
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.loop.closed_loop import control_ticks
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import CONTROL_PERIOD
from masmc_ros.params.declaration import check_all
from masmc_ros.result_text import json_text, WIDTH
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
import numpy as np
from tqdm import tqdm

_TICKS = 2000
_TIMES = 5

_AWAY = 0.01
"""Distance of the reference from the robot in m."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = 'List the control laws, which are the values of `law`, and their sources.'
    parser.add_argument('--cost', action='store_true', help='measure the time of a tick of each')
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """List the laws; with `--cost` measure a compiled tick of each for the default robot."""
    names = registry.names()
    rows = {name: _row(name) for name in names}
    if options.cost:
        measured = {name: _cost(name) for name in tqdm(names, unit='law', disable=None)}
        for name, row in rows.items():
            row['cost_us'] = 1e6 * measured[name]
            row['cost'] = measured[name] / measured['rasmc']
    if options.json:
        print(json_text(rows.values()))
        return 0
    width = max(len(name) for name in names)
    for row in rows.values():
        cost = f'{row["cost_us"]:6.2f} us {row["cost"]:5.2f}x  ' if options.cost else ''
        source = f' [{row["source"]}]' if row['source'] else ''
        text = f'{row["law"]:{width}}  {cost}{row["summary"]}{source}'
        indent = ' ' * (width + 2)
        print(textwrap.fill(text, WIDTH, subsequent_indent=indent, break_on_hyphens=False))
    if options.cost:
        print('cost: of a compiled tick on this machine, and relative to rasmc')
    return 0


def _row(name: str) -> dict[str, str | float]:
    law = registry.load(name)
    if isinstance(law, Law):
        return {'law': name, 'summary': law.summary, 'source': law.source}
    return {'law': name, 'summary': f'plain Python: {law.__module__}.{law.__qualname__}',
            'source': ''}


def _cost(name: str) -> float:
    """Return the time in s of a tick of a law, compiled, the shortest of some series."""
    values = check_all(declared('controller'), {'law': name})
    robot = robot_of(values)
    controller = Controller(robot, CONTROL_PERIOD.of(values), values)
    plant = SimulatedRobot(robot, CONTROL_PERIOD.of(values), check_all(declared('plant'), {}))
    position, velocity = plant.position, plant.velocity
    task = robot.task_positions(position[None])[0] + _AWAY
    reference = np.concatenate([task, *2 * [np.full(len(task), _AWAY)]])
    controller.tick(position, velocity, reference)
    # A different position at each tick, otherwise the compiler removes the repeated ticks.
    positions = position + np.linspace(0.0, _AWAY, _TICKS)[:, None]
    inputs = controller.settings, controller.memory, controller.signals, positions
    ticks = bound(control_ticks, *inputs)
    times = []
    for _ in range(_TIMES):
        start = perf_counter()
        ticks(*inputs)
        times.append((perf_counter() - start) / _TICKS)
    return min(times)
