# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Benchmark of campaigns: processor time per run of `masmc monte-carlo`, start-up included.

The scenario is that of the paper with the implicit law, a disturbance estimate and measurement
noise; every run has another robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

from benchmarks.kernel import compared_with_c
from benchmarks.measure import compared, Measure

RUNS = 10_000
"""Number of runs: start-up takes as long as 1000 of them."""

SETTINGS = (
    'controller.switching=implicit',
    'controller.observer_gain=0.5',
    'plant.velocity_noise=0.02',
    'plant.encoder_resolution=0.0001',
)

DRAWS = (
    'plant.robot.platform_mass=uniform:10.35:24.15',
    'plant.robot.link_1_mass=uniform:1.536:3.584',
    'plant.robot.link_2_mass=uniform:0.642:1.498',
    'plant.robot.platform_inertia=uniform:0.178:0.416',
    'plant.robot.link_1_inertia=uniform:0.0888:0.207',
    'plant.robot.link_2_inertia=uniform:0.0137:0.0319',
)

OTHERS = {
    'estimated velocities': 'controller.velocity_source=estimated',
    'k_s2 5': 'controller.k_s2=5.0',
}
"""Settings of campaigns that take longer."""

MANY = 200_000
"""Number of runs whose rows have to fit into memory."""


class Cost(NamedTuple):
    """Wall time and processor time in s, and largest memory in MB, of a command."""

    wall: float
    processor: float
    memory: float


def command_cost(runs: int, threads: int, settings: tuple[str, ...] = SETTINGS) -> Cost:
    """Return the cost of `masmc monte-carlo`."""
    options = [word for text in settings for word in ('--set', text)]
    options += [word for text in DRAWS for word in ('--draw', text)]
    with tempfile.TemporaryDirectory() as folder:
        output = str(Path(folder) / 'out')
        start = time.perf_counter()
        process = subprocess.Popen(
            [
                *(sys.executable, '-m', 'masmc_ros.cli.main', 'monte-carlo', 'paper'),
                *('--runs', str(runs), '--threads', str(threads), '--output', output, *options),
            ],
            stdout=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, 'masmc monte-carlo')
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000.0)


def measures() -> Iterator[Measure]:
    """Yield the times."""
    costs: list[Cost] = []
    # Compiled code is present.
    command_cost(64, 1)

    def seconds(settings: tuple[str, ...] = SETTINGS) -> float:
        costs.append(command_cost(RUNS, 2, settings))
        return costs[-1].processor / RUNS

    with_processor_time = partial(compared_with_c, is_processor_time=True)
    yield with_processor_time(f'a run of {RUNS} of monte-carlo, processor time', seconds)
    yield Measure('its memory', costs[-1].memory, 'MB')
    for name, setting in OTHERS.items():
        yield with_processor_time(f'the same, {name}', partial(seconds, (*SETTINGS, setting)))
    many = command_cost(MANY, 2, (*SETTINGS, 'duration=0.02'))
    yield Measure(f'memory of {MANY} runs of 20 ms', many.memory, 'MB')
    one = Measure('monte-carlo, one thread', command_cost(RUNS, 1).wall, 's')
    yield one
    yield compared('the same, two threads', command_cost(RUNS, 2).wall, 's', one)
