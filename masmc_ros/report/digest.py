# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Digests of runs: all that a report of several runs needs of each of them, without its samples.

A report reads one run after the other, so its memory is that of some runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
import math
from typing import NamedTuple, overload

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.measure.adaptation import Adaptation, adaptation
from masmc_ros.report.measure.metrics import Metrics, metrics
from masmc_ros.report.measure.missing import unread
from masmc_ros.report.measure.tracking import Compared, tracking
from masmc_ros.report.page.packed_samples import ranges_per_line
from masmc_ros.report.page.section import run_section, Section
from masmc_ros.report.panels import distance_panels, Panel
import numpy as np

COMPARED = 20
"""Maximum number of runs in the plots of all runs."""

_COARSE = 200
"""Maximum number of ranges of a line in the plots of more runs."""

_KEPT = 6
"""Number of runs that stay in memory."""


class Digest(NamedTuple):
    """
    Digest of a run.

    Attributes
    ----------
    run
        Run without samples; its times are those of the first and the last state.
    states
        Number of states.
    metrics
        Metrics.
    distances
        Panels of the comparison with a line each.
    adapted
        Adaptation; None without estimates.
    section
        Section of the page.
    unread
        Sentences about renamed topics.

    """

    run: Run
    metrics: Metrics
    distances: list[Panel]
    adapted: Adaptation | None
    section: Section
    unread: list[str]


class LogRuns(Sequence[Run]):
    """Runs of logs, which are read when they are used; the latest ones stay in memory."""

    def __init__(self, logs: Sequence[str], report: Callable[[], object]) -> None:
        """Initialise the runs with the paths of their logs; `report` is called for each log."""
        self._logs, self._report = logs, report
        self._known: set[str] = set()
        self._read: Callable[[str], Run] = lru_cache(maxsize=_KEPT)(read_run)

    def __len__(self) -> int:
        """Return the number of logs."""
        return len(self._logs)

    @overload
    def __getitem__(self, place: int) -> Run: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[Run]: ...

    def __getitem__(self, place: int | slice) -> Run | Sequence[Run]:
        """Return the run of a log, or the runs of some logs."""
        logs = self._logs[place]
        if not isinstance(logs, str):
            return LogRuns(logs, self._report)
        run = self._read(logs)
        if logs not in self._known:
            self._known.add(logs)
            self._report()
        return run


def digest(run: Run, place: int, count: int) -> Digest:
    """
    Return the digest of a run.

    Parameters
    ----------
    run
        Run.
    place
        Place of its log, from 1.
    count
        Number of runs of the report.

    """
    tracked = tracking(run)
    row = metrics(run, tracked=tracked)
    ranges = ranges_per_line(count)
    adapted = adaptation(run)
    section = run_section(place, Compared('', run, tracked), row, count=count,
                          has_estimates=adapted is None)  # fmt: skip
    kept = ranges if count <= COMPARED else _COARSE
    return Digest(
        _without_samples(run),
        row,
        distance_panels(Compared('', run, tracked), kept),
        adapted and adapted.thinned(2 * kept),
        section,
        unread(run),
    )


def digests_of(runs: Sequence[Run]) -> list[Digest]:
    """
    Return the digest of each run.

    The first runs are read last: they are still in memory when their figures are drawn.
    """
    count = len(runs)
    return [digest(runs[i], i + 1, count) for i in reversed(range(count))][::-1]


def compared_runs(digests: Sequence[Digest]) -> list[int]:
    """
    Return the indices of the runs in the plots of all runs, in their order.

    Of many runs these are the best, the worst and, evenly by their ranks, some between; the rank
    is that of the RMS error of the first point.
    """
    ranked = sorted(range(len(digests)), key=lambda i: _rms(digests[i].metrics))
    places = np.linspace(0, len(ranked) - 1, min(COMPARED, len(ranked))).round().astype(int)
    return sorted(ranked[place] for place in places)


def _rms(row: Metrics) -> float:
    """Return the RMS error of the first point; infinity without one."""
    reached = next(iter(row.points.values()), None)
    rms = None if reached is None else reached.rms
    return math.inf if rms is None or math.isnan(rms) else rms


def _without_samples(run: Run) -> Run:
    """Return a run with the times of its first and last state, and no other samples."""
    def empty(series: Series) -> Series:
        return Series(np.zeros(0, np.int64), np.zeros((0, series.values.shape[1])))

    return replace(
        run,
        times=run.times[[0, -1]],
        position=run.position[:0].copy(),
        velocity=run.velocity[:0].copy(),
        applied_effort=run.applied_effort[:0].copy(),
        torque=empty(run.torque),
        cmd_vel=empty(run.cmd_vel),
        arm_rates=empty(run.arm_rates),
        reference=None,
        telemetry={},
        contact=None,
        attachments=dict.fromkeys(run.attachments, b''),
    )
