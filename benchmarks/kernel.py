# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks of the compiled kernel: whole runs, and single ticks called from Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.util import find_spec
import multiprocessing
from pathlib import Path
import platform
import shutil
import subprocess
import tempfile
import time

from benchmarks.measure import compared, Measure
from masmc_ros.jit.compiled import bound
from masmc_ros.jit.record import take_over
from masmc_ros.law.registry import LAWS
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import closed_loop, plant_start
from masmc_ros.loop.simulated_robot import delay_line
from masmc_ros.loop.simulation import Simulation
from masmc_ros.native.library import write_library
from masmc_ros.native.targets import TARGETS
from masmc_ros.scenario.scenario import load_scenario
from masmc_ros.share import shared_file
import numpy as np

LANES, BLOCK = 16, 100
"""Number of parallel runs, and number of ticks per block."""

IN_C = '20 s at 1 kHz: rasmc, tanh in C, -O3'

CASES = {
    'smc, sign': ('controller.law=smc', 'controller.switching=sign'),
    'rasmc, tanh': (),
    'smc, implicit, observer 0.5': (
        'controller.law=smc',
        'controller.switching=implicit',
        'controller.observer_gain=0.5',
    ),
}

CLAIMS = dict(zip(CASES, ((0.74, 0.12), (0.8, 0.13), (0.81, 0.32)), strict=True))
"""Documented ratios to the run in C, single and in parallel (docs/development/benchmarks.md)."""

WITH_LATENCY = (
    'controller.law=smc',
    'controller.switching=implicit',
    'controller.latency=0.01',
    'plant.measurement_delay=0.01',
)
"""Settings of a run with compensated latency."""

LIBRARY_CLAIM = 0.14
"""Documented ratio of a tick of a library from C to the call from Python."""

OWN_CLAIM, TREE_CLAIM, PROCESSES_CLAIM = 0.16, 22.5, 2.0
"""Documented ratios in parallel with separate disturbances, of TIAGo, and of two processes."""


_TICKS_IN_C = """#include "paper.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
int main(int argc, char **argv) {
    paper_settings settings = paper_settings_initial;
    paper_memory memory = paper_memory_initial;
    paper_signals signals = paper_signals_initial;
    paper_plant_settings robot = paper_plant_settings_initial;
    paper_plant_memory state = paper_plant_memory_initial;
    static double line[PAPER_DELAY_LINE], reference[PAPER_REFERENCE];
    double position[PAPER_POSITION], velocity[PAPER_VELOCITY];
    FILE *path = fopen("reference.bin", "rb");
    if (argc < 2 || !path || fread(reference, sizeof reference, 1, path) != 1) return 1;
    paper_plant_start(&robot, &state, line, &signals);
    for (int i = 0; i < PAPER_POSITION; i++) position[i] = signals.position[i];
    for (int i = 0; i < PAPER_VELOCITY; i++) velocity[i] = signals.velocity[i];
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (long i = atol(argv[1]); i > 0; i--)
        paper_control_tick(&settings, &memory, &signals, position, velocity, reference);
    clock_gettime(CLOCK_MONOTONIC, &end);
    printf("%.9f", end.tv_sec - start.tv_sec + 1e-9 * (end.tv_nsec - start.tv_nsec));
    return 0;
}
"""


def run_seconds(
    settings: tuple[str, ...], repeats: int = 10, config: str = 'paper.yaml'
) -> float:
    """Return the best time of a 20 s run at 1 kHz, all signals kept, in s."""
    simulation = Simulation(load_scenario(str(shared_file('config', config)), settings))
    best = float('inf')
    for _ in range(repeats + 1):
        start = time.perf_counter()
        for _ in simulation.run(block=30_000):
            pass
        best = min(best, time.perf_counter() - start)
    return best


def tick_seconds(
    repeats: int = 100_000, settings: tuple[str, ...] = ()
) -> tuple[float, float]:
    """Return the time of one control tick and of one plant tick from Python, in s."""
    simulation = Simulation(load_scenario(str(shared_file('config', 'paper.yaml')), settings))
    plant, controller = simulation.plant, simulation.controller
    reference = simulation.trajectory.sample(0, 1)[0]
    controller.tick(plant.position, plant.velocity, reference)
    plant.advance(controller.torque)
    plant.reset()
    start = time.perf_counter()
    for _ in range(repeats):
        controller.tick(plant.position, plant.velocity, reference)
    middle = time.perf_counter()
    controller.torque[:] = 0.0
    for _ in range(repeats):
        plant.advance(controller.torque)
    end = time.perf_counter()
    return (middle - start) / repeats, (end - middle) / repeats


def library_seconds(repeats: int = 1_000_000) -> float | None:
    """Return the time of one control tick of a library from C, in s; None without a compiler."""
    compiler, target = shutil.which('cc'), f'{platform.machine()}-linux-gnu'
    if compiler is None or target not in TARGETS:
        return None
    values = load_scenario(str(shared_file('config', 'paper.yaml')), ())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        chosen = {target: TARGETS[target]}
        write_library(folder, 'paper', values, chosen, overwrite=False)
        (folder / 'tick.c').write_text(_TICKS_IN_C, encoding='utf-8')
        library = f'{target}/libpaper.a'
        command = [compiler, '-O2', '-o', 'tick', 'tick.c', library, '-lm']
        subprocess.run(command, cwd=folder, check=True)
        output = subprocess.run(
            ['./tick', str(repeats)], cwd=folder, check=True, capture_output=True, text=True
        ).stdout
    return float(output) / repeats


def c_seconds(*, is_processor_time: bool = False) -> float | None:
    """
    Return the best time of the same run in C, -O3, in s, or the mean processor time of a run.

    None without a compiler.
    """
    compiler = shutil.which('cc')
    if compiler is None:
        return None
    source = Path(__file__).with_name('closed_loop.c')
    with tempfile.TemporaryDirectory() as folder:
        program = str(Path(folder) / 'closed_loop')
        subprocess.run([compiler, '-O3', '-o', program, str(source), '-lm'], check=True)
        output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return 1e-3 * float(output.split()[3 if is_processor_time else 0])


def lanes_seconds(
    settings: tuple[str, ...], lanes: int, repeats: int = 3, apart: float = 0.0
) -> float:
    """
    Return the best time of `lanes` parallel runs, divided by their number, in s.

    The phases of their disturbances differ by `apart` rad from lane to lane.
    """
    simulation = Simulation(load_scenario(str(shared_file('config', 'paper.yaml')), settings))
    simulation.plant.reset()
    plant, controller = simulation.plant, simulation.controller
    values, mechanism = controller.values, controller.mechanism
    law = LAWS[values['law']]
    ticks = 20_001
    reference = simulation.trajectory.sample(0, ticks)
    current_signals = records.signals(mechanism, lanes)
    # Blocks, as in a run that is written: 16 whole runs need 1.5 GB.
    signals = np.empty(BLOCK, current_signals.dtype)
    best = float('inf')
    for _ in range(repeats + 1):
        gains = records.law_settings(mechanism, law, values['switching'], lanes)
        memory = records.law_memory(mechanism, law, lanes)
        robot = records.plant_settings(mechanism, lanes)
        state = records.plant_memory(mechanism, lanes)
        for record, single in (
            (gains, controller.settings),
            (memory, controller.memory),
            (robot, plant.settings),
            (state, plant.memory),
        ):
            take_over(record, single)
        robot['phase'] += apart * np.arange(lanes)
        delay_buffer = delay_line(robot, mechanism)
        plant_start(robot, state, delay_buffer, current_signals)
        arguments = (robot, state, delay_buffer, gains, memory, current_signals)
        # A check of the types at each call would take longer than a tick of a lane.
        run_block = bound(closed_loop, *arguments, 0, False, reference, signals)
        start = time.perf_counter()
        for first in range(0, ticks, BLOCK):
            followed = reference[first:first + BLOCK]
            final = first + len(followed) == ticks
            run_block(*arguments, first, final, followed, signals[: len(followed)])
        best = min(best, time.perf_counter() - start)
    return best / lanes


def runs_per_second(settings: tuple[str, ...], processes: int) -> float:
    """Return the total number of runs per second of several processes with parallel runs."""
    tasks = 4 * processes
    with ProcessPoolExecutor(processes, multiprocessing.get_context('spawn')) as pool:
        # All processes have imported and compiled before the measurement.
        for repeats in (0, 3):
            start = time.perf_counter()
            list(pool.map(lanes_seconds, *zip(*[(settings, LANES, repeats)] * tasks, strict=True)))
        return tasks * LANES * (1 + repeats) / (time.perf_counter() - start)


def compared_with_c(
    name: str,
    seconds: Callable[[], float],
    claim: float | None = None,
    *,
    is_processor_time: bool = False,
) -> Measure:
    """Return a time in ms and the mean of C before and after it, as the clock rate changes."""
    time_of_c = partial(c_seconds, is_processor_time=is_processor_time)
    before, own_seconds, after = time_of_c(), seconds(), time_of_c()
    in_c = None
    if before is not None and after is not None:
        in_c = Measure(IN_C, 500.0 * (before + after), 'ms')
    return compared(name, 1e3 * own_seconds, 'ms', in_c, claim)


def tree_seconds() -> float:
    """Return the best time of the run of `config/tiago.yaml`, 20 s at 1 kHz, in s."""
    return run_seconds((), config='tiago.yaml')


def measures() -> Iterator[Measure]:
    """Yield the times."""
    seconds = c_seconds()
    if seconds is not None:
        yield Measure(IN_C, 1e3 * seconds, 'ms')
    for name, settings in CASES.items():
        alone = partial(run_seconds, settings)
        yield compared_with_c(f'20 s at 1 kHz: {name}', alone, CLAIMS[name][0])
    for name, settings in CASES.items():
        together = f'the same, each of {LANES} side by side: {name}'
        yield compared_with_c(together, partial(lanes_seconds, settings, LANES), CLAIMS[name][1])
    name = f'rasmc, tanh, each of {LANES} with a disturbance of its own'
    yield compared_with_c(name, partial(lanes_seconds, (), LANES, apart=0.01), OWN_CLAIM)
    if find_spec('pinocchio') is not None:
        yield compared_with_c('20 s at 1 kHz: TIAGo, rasmc, implicit', tree_seconds, TREE_CLAIM)
    one, two = (runs_per_second(CASES['rasmc, tanh'], count) for count in (1, 2))
    reference = Measure('runs of rasmc, tanh side by side, one process', one, '/s')
    yield reference
    yield compared('the same, two processes', two, '/s', reference, PROCESSES_CLAIM)
    control, plant = tick_seconds()
    tick = Measure('control tick from Python', 1e6 * control, 'us')
    yield tick
    in_library = library_seconds()
    if in_library is not None:
        name = 'the same of a library, from C'
        yield compared(name, 1e6 * in_library, 'us', tick, LIBRARY_CLAIM)
    with_latency = 1e6 * tick_seconds(settings=WITH_LATENCY)[0]
    yield compared('the same, smc, implicit, latency 10 ms', with_latency, 'us', tick)
    yield Measure('plant tick from Python', 1e6 * plant, 'us')
