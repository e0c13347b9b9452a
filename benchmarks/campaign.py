# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Benchmark of campaigns: processor time per run of `masmc monte-carlo`, start-up included.

The scenario is that of the paper with the implicit law, a disturbance estimate and measurement
noise; every run has another robot. The same runs on the workers of a Dask cluster and in threads
show the cost of the cluster; runs of TIAGo one by one and in lanes that of lanes without vectors.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from benchmarks.kernel import compared_with_c
from benchmarks.measure import compared, Measure
from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.engine import carry_out, part_size
from masmc_ros.campaign.runs import evaluated, LANES, rows, rows_of_text
from masmc_ros.campaign.variable import draw
from masmc_ros.files import scenario_file


class Sizes(NamedTuple):
    """
    Numbers of runs.

    Attributes
    ----------
    runs
        Runs of a command. Start-up takes as long as 1000 of them.
    many
        Runs of 20 ms whose rows have to fit into memory.
    of_tree
        Runs of TIAGo of 1 s.
    short_parts
        Parts of 16 runs of 2 ms.
    varied
        Runs by the kind of the drawn parameter.

    """

    runs: int
    many: int
    of_tree: int
    short_parts: int
    varied: int


FULL, QUICK = Sizes(10_000, 200_000, 200, 400, 320), Sizes(320, 2000, 32, 40, 64)

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

VARIED = {
    'plant': 'plant.robot.link_2_mass=uniform:0.642:1.498',
    'controller': 'controller.robot.link_2_mass=uniform:0.642:1.498',
    'shared mass': 'robot.link_2_mass=uniform:0.642:1.498',
    'shared length': 'robot.link_2_length=uniform:0.84:0.9',
    'gain': 'controller.k_s1=uniform:80:120',
    'path': 'trajectory.line_sine.phase[0]=uniform:0:0.1',
    'period': 'control_period=uniform:0.001:0.00101',
}
"""Draws of one parameter by its kind."""

WORKERS = (1, 2, 4)
"""Numbers of Dask workers with one thread each."""


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


def measures(sizes: Sizes = FULL) -> Iterator[Measure]:
    """Yield the times."""
    costs: list[Cost] = []
    # Compiled code is present.
    command_cost(64, 1)

    def seconds(settings: tuple[str, ...] = SETTINGS) -> float:
        costs.append(command_cost(sizes.runs, 2, settings))
        return costs[-1].processor / sizes.runs

    def cost_of_run(name: str, *settings: str) -> Iterator[Measure]:
        time_of_run = partial(seconds, (*SETTINGS, *settings))
        processor = compared_with_c(name, time_of_run, is_processor_time=True)
        yield processor
        wall = costs[-1].wall / costs[-1].processor
        ratio = None if processor.ratio is None else wall * processor.ratio
        yield Measure(
            'its wall time, two threads', wall * processor.value, 'ms', processor.reference, ratio
        )

    yield from cost_of_run(f'a run of {sizes.runs} of monte-carlo, processor time')
    two = costs[-1]
    yield Measure('its memory', two.memory, 'MB')
    for name, setting in OTHERS.items():
        yield from cost_of_run(f'the same, {name}', setting)
    many = command_cost(sizes.many, 2, (*SETTINGS, 'duration=0.02'))
    yield Measure(f'memory of {sizes.many} runs of 20 ms', many.memory, 'MB')
    one = Measure('monte-carlo, one thread', command_cost(sizes.runs, 1).wall, 's')
    yield one
    yield compared('the same, two threads', two.wall, 's', one)
    yield from _of_kinds(sizes.varied)
    if find_spec('distributed') is not None:
        yield from _of_clusters(sizes)
    if find_spec('pinocchio') is not None:
        yield from _of_trees(sizes.of_tree)


def _of_kinds(count: int) -> Iterator[Measure]:
    """Yield the processor time of a run by the kind of its drawn parameter, without start-up."""
    reference = None
    for kind, text in VARIED.items():
        file = scenario_file('paper')
        campaign = campaign_of(file, SETTINGS, draws=[draw(text)], repeats=count)
        runs = list(campaign.runs(0, count))
        evaluated(runs[:LANES], LANES)
        start = time.process_time()
        evaluated(runs, campaign.lanes)
        value = 1e3 * (time.process_time() - start) / count
        measure = compared(f'a run, drawn: {kind}', value, 'ms', reference)
        reference = reference or measure
        yield measure


def campaign_of_robots(runs: int, *settings: str, file: str = 'paper') -> Campaign:
    """Return the campaign of the commands, or one of another robot, with further settings."""
    is_paper = file == 'paper'
    draws = DRAWS if is_paper else ('controller.k_s1=uniform:80:120',)
    return campaign_of(
        scenario_file(file),
        (*(SETTINGS if is_paper else ()), *settings),
        draws=[draw(text) for text in draws],
        repeats=runs,
    )


def _throughput(campaign: Campaign, **where: Any) -> tuple[float, float]:
    """Return runs per second with the dataset, without start-up, and this process's time in s."""
    with tempfile.TemporaryDirectory() as folder:
        start, processor = time.perf_counter(), time.process_time()
        carry_out(campaign, Path(folder), **where)
        rate = campaign.total / (time.perf_counter() - start)
        return rate, time.process_time() - processor


def _of_clusters(sizes: Sizes) -> Iterator[Measure]:
    """Yield the throughput of threads and of Dask workers, and the cost of a part."""
    from distributed import LocalCluster

    campaign = campaign_of_robots(sizes.runs)
    rows(campaign, 0, LANES)
    threads = Measure('runs/s in one thread', _throughput(campaign, threads=1)[0], '/s')
    yield threads
    yield compared('the same, two threads', _throughput(campaign, threads=2)[0], '/s', threads)
    for count in WORKERS:
        with LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=':0', silence_logs='CRITICAL'
        ) as cluster, cluster.get_client() as client:
            # All processes have imported and compiled before the measurement.
            client.run(rows_of_text, Campaign, campaign.text, 0, LANES)
            _throughput(campaign_of_robots(LANES), scheduler=cluster.scheduler_address)
            rate, own = _throughput(campaign, scheduler=cluster.scheduler_address)
            workers = 'Dask worker' if count == 1 else 'Dask workers'
            yield compared(f'the same, {count} {workers}', rate, '/s', threads)
            if count == 1:
                size = part_size(campaign, count)
                name = f'scheduler, client, dataset: a part of {size} runs'
                yield Measure(name, 1e3 * own * size / campaign.total, 'ms')
                yield _short_parts(sizes.short_parts, cluster.scheduler_address)


def _short_parts(count: int, scheduler: str) -> Measure:
    """Return the time of a part on one worker in addition to that of its runs."""
    from masmc_ros.campaign.dask import Cluster

    campaign = campaign_of_robots(count * LANES, 'duration=0.002')
    parts = list(campaign.parts(LANES))
    start = time.perf_counter()
    for part in parts:
        rows(campaign, *part)
    middle = time.perf_counter()
    with Cluster(scheduler) as cluster:
        for _ in cluster.computed(campaign, parts):
            pass
    added = time.perf_counter() - middle - (middle - start)
    return Measure('Dask, a part in addition to its runs', 1e3 * added / count, 'ms')


def _of_trees(count: int) -> Iterator[Measure]:
    """Yield the time of runs of TIAGo one by one and in lanes."""
    campaign = campaign_of_robots(count, 'duration=1.0', file='tiago')
    runs = list(campaign.runs(0, count))
    reference = None
    for lanes in (1, LANES):
        evaluated(runs[:lanes], lanes)
        start = time.perf_counter()
        evaluated(runs, lanes)
        name = f'{count} runs of 1 s of TIAGo, {f"{lanes} lanes" if reference else "one by one"}'
        measure = compared(name, time.perf_counter() - start, 's', reference)
        reference = reference or measure
        yield measure
