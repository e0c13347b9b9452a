# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of all contenders in all trials, on all processors.

A process takes a law with all its runs, whose kernel it loads once. Many runs of a trial are
computed side by side in lanes, a few one after the other: they have the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import multiprocessing
import os
import signal
from typing import Any

from masmc_ros.compare.contenders import Contender
from masmc_ros.compare.trials import drawn, Trial
from masmc_ros.loop.side_by_side import SideBySide
from masmc_ros.params.scenario import load_scenario
from masmc_ros.report.measure.metrics import measure, Metrics, second_half
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.registry import chosen
import numpy as np
from numpy.typing import NDArray

LANES = 16
"""Runs side by side, as many as fill the widest vectors twice."""

_WORTH_LANES = 4 * LANES
"""Runs of a trial from which on it pays to compile for lanes."""


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
    """Yield the outcomes of each task, in the order in which they are done."""
    workers = min(os.cpu_count() or 1, len(tasks))
    if workers == 1:
        yield from map(compute, tasks)
        return
    # Not forked: the caller may have started threads.
    context = multiprocessing.get_context('spawn')
    with context.Pool(workers, _leave_interrupts_to_parent) as pool:
        yield from pool.imap_unordered(compute, tasks)


def _leave_interrupts_to_parent() -> None:
    """Ignore Ctrl-C: the process that hands the work out ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def compute(task: Task) -> tuple[Outcome, ...]:
    """Compute all runs of a contender; InputError where there are none."""
    settings = (*task.settings, *task.contender.settings)
    mechanism = chosen(load_scenario(task.file, settings)['plant'])
    found = []
    for trial in task.trials:
        scenario = load_scenario(task.file, (*settings, *trial.settings_for(mechanism)))
        runs = [drawn(scenario, mechanism, seed) for seed in range(task.seeds)]
        together = LANES if task.seeds >= _WORTH_LANES else 1
        reached: list[Metrics | None] = []
        for first in range(0, len(runs), together):
            some = runs[first:first + together]
            # The last few fill their lanes with one of them again: one kernel serves all.
            padded = [*some, *[some[-1]] * (together - len(some))]
            reached += _reached(padded, mechanism)[:len(some)]
        found.append(Outcome(task.contender, trial.name, tuple(reached)))
    return tuple(found)


def _reached(runs: Sequence[Any], mechanism: Mechanism) -> list[Metrics | None]:
    """Return the metrics of runs that are computed together."""
    loop = SideBySide(runs)
    errors, torques = [], []
    for signals in loop.run():
        errors.append(signals['error'].copy())
        torques.append(signals['torque'].copy())
    error, torque = np.concatenate(errors), np.concatenate(torques)
    times = np.arange(len(error)) * loop.timing.period
    return [
        _metrics(times, error[:, :, lane], torque[:, :, lane], mechanism)
        for lane in range(len(runs))
    ]


def _metrics(
    times: NDArray[Any],
    error: NDArray[Any],
    torque: NDArray[Any],
    mechanism: Mechanism,
) -> Metrics | None:
    if not (np.isfinite(error).all() and np.isfinite(torque).all()):
        return None
    window = second_half(times)
    return measure(times, error, times, torque, None, window, points=mechanism.points)
