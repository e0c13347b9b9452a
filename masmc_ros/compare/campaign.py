# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of all contenders in all trials, on all processors.

A process computes all runs of a law, whose kernel it loads once. Many runs of a trial are
computed side by side in lanes, a few one after the other; both are bitwise identical.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import multiprocessing
import os
import signal

from masmc_ros.compare.contenders import Contender
from masmc_ros.compare.trials import drawn, Trial
from masmc_ros.errors import InputError
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulated_robot import RIGID
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.declaration import Values
from masmc_ros.params.scenario import load_scenario
from masmc_ros.report.measure.metrics import Metrics, Samples
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
import numpy as np

LANES = 16
"""Number of runs side by side, which fills the widest vectors twice."""

_WORTH_LANES = 4 * LANES
"""Number of runs of a trial from which compilation for lanes is faster."""


@dataclass(frozen=True)
class Outcome:
    """Metrics of a contender in a trial by seed; None for a run that diverged."""

    contender: Contender
    trial: str
    reached: tuple[Metrics | None, ...]


@dataclass(frozen=True)
class Task:
    """All runs of a contender."""

    file: str
    settings: tuple[str, ...]
    contender: Contender
    trials: tuple[Trial, ...]
    seeds: int


def outcomes(tasks: Sequence[Task]) -> Iterator[Sequence[Outcome]]:
    """Yield the outcomes of each task, in the order of completion."""
    workers = min(os.cpu_count() or 1, len(tasks))
    if workers == 1:
        yield from map(compute, tasks)
        return
    # Spawned processes, as the caller may have started threads.
    context = multiprocessing.get_context('spawn')
    with context.Pool(workers, _leave_interrupts_to_parent) as pool:
        yield from pool.imap_unordered(compute, tasks)


def _leave_interrupts_to_parent() -> None:
    """Ignore Ctrl-C: the parent process ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def compute(task: Task) -> tuple[Outcome, ...]:
    """Compute all runs of a contender; InputError for invalid settings."""
    settings = (*task.settings, *task.contender.settings)
    values = load_scenario(task.file, settings)
    mechanism, limits = mechanism_from(values['plant']), values['controller']['torque_limit']
    computed = []
    for trial in task.trials:
        scenario = load_scenario(task.file, (*settings, *trial.settings_for(mechanism, limits)))
        runs = [drawn(scenario, mechanism, seed) for seed in range(task.seeds)]
        computed.append(Outcome(task.contender, trial.name, _all_reached(runs, mechanism)))
    return tuple(computed)


def _all_reached(
    runs: Sequence[Mapping[str, Values]], mechanism: Mechanism
) -> tuple[Metrics | None, ...]:
    """Return the metrics of the runs of a trial."""
    if runs[0]['plant']['physics'] != RIGID:
        return tuple(_reached_alone(run, mechanism) for run in runs)
    together = LANES if len(runs) >= _WORTH_LANES else 1
    reached: list[Metrics | None] = []
    for first in range(0, len(runs), together):
        block = runs[first:first + together]
        # The last run is repeated in the remaining lanes: one kernel for all blocks.
        padded = [*block, *[block[-1]] * (together - len(block))]
        reached += _reached(padded, mechanism)[:len(block)]
    return tuple(reached)


def _reached_alone(run: Mapping[str, Values], mechanism: Mechanism) -> Metrics | None:
    """Return the metrics of a run whose plant is not compiled; None if it diverged or fell."""
    simulation = Simulation(run)
    try:
        blocks = [(block.error, block.torque) for block in simulation.run()]
    except InputError:
        return None
    errors, torques = zip(*blocks, strict=True)
    period, points = simulation.timing.period, mechanism.points
    return Samples.of_ticks(
        np.concatenate(errors), np.concatenate(torques), period, points
    ).metrics()


def _reached(runs: Sequence[Mapping[str, Values]], mechanism: Mechanism) -> list[Metrics | None]:
    """Return the metrics of runs that are computed together."""
    loop = BatchSimulation(runs)
    errors, torques = [], []
    for signals in loop.run():
        errors.append(signals['error'].copy())
        torques.append(signals['torque'].copy())
    error, torque = np.concatenate(errors), np.concatenate(torques)
    period, points = loop.timing.period, mechanism.points
    samples = (
        Samples.of_ticks(error[:, :, lane], torque[:, :, lane], period, points)
        for lane in range(len(runs))
    )
    return [
        run.metrics() if np.isfinite(run.error).all() and np.isfinite(run.torque).all() else None
        for run in samples
    ]
