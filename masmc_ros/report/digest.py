# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Digests of runs: all that a report of several runs needs of each of them, without its samples.

A report reads one run after the other, so its memory is that of some runs. Further processes
digest a share of many logs: this module is their program. They end with their input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
import math
import pickle
import signal
import subprocess
import sys
from threading import Lock, Thread
from typing import NamedTuple, overload

from masmc_ros.child_process import module_command, processors
from masmc_ros.errors import UserError
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.measure.adaptation import Adaptation, adaptation
from masmc_ros.report.measure.findings import unread
from masmc_ros.report.measure.metrics import Metrics, metrics
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


_SHARE = 4
"""Number of logs for each further process, whose start takes as long as two of them."""


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

    @property
    def logs(self) -> Sequence[str]:
        """Return the paths of the logs."""
        return self._logs

    def read_elsewhere(self, place: int) -> None:
        """Account for a log that another process has read."""
        self._known.add(self._logs[place])
        self._report()

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

    The first runs are read last: they are still in memory when their figures are drawn. Of logs
    that were not read yet, further processes read a share, one for each further core.
    """
    count, waiting = len(runs), _Waiting(len(runs))
    digests: dict[int, Digest] = {}
    with _helpers(runs, waiting, digests):
        while (place := waiting.take()) is not None:
            digests[place] = digest(runs[place], place + 1, count)
    # What helpers could not read raises its error here.
    return [digests.get(i) or digest(runs[i], i + 1, count) for i in range(count)]


class _Waiting:
    """Places of logs that no process digests yet."""

    def __init__(self, count: int) -> None:
        """Initialise all places."""
        self._places, self._lock = list(range(count)), Lock()

    def take(self, left: int = 0) -> int | None:
        """Return the last place and remove it; None if there are not more than `left`."""
        with self._lock:
            return self._places.pop() if len(self._places) > left else None


@contextmanager
def _helpers(
    runs: Sequence[Run], waiting: _Waiting, digests: dict[int, Digest]
) -> Iterator[None]:
    """Let further processes digest logs that wait; at the end, wait for their last ones."""
    number = 0
    if isinstance(runs, LogRuns):
        number = min(processors() - 1, len(runs) // _SHARE)
    processes, threads = list[subprocess.Popen[bytes]](), list[Thread]()
    try:
        for _ in range(number):
            processes.append(subprocess.Popen(
                module_command(__name__), stdin=subprocess.PIPE, stdout=subprocess.PIPE
            ))
            arguments = (processes[-1], runs, waiting, digests)
            threads.append(Thread(target=_delegate, args=arguments, daemon=True))
            threads[-1].start()
        yield
        for thread in threads:
            thread.join()
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _delegate(
    process: subprocess.Popen[bytes], runs: LogRuns, waiting: _Waiting,
    digests: dict[int, Digest],
) -> None:
    """Let a process digest logs while some wait; those it cannot read are left out."""
    assert process.stdin is not None
    assert process.stdout is not None
    # The first run is read by the process that draws its figures.
    while (place := waiting.take(left=1)) is not None:
        try:
            pickle.dump((runs.logs[place], place + 1, len(runs)), process.stdin)
            process.stdin.flush()
            found = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            return
        if found is not None:
            digests[place] = found
            runs.read_elsewhere(place)


def serve() -> None:
    """Digest the logs that the input names, and write the digests; None for an error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    out, sys.stdout = sys.stdout.buffer, sys.stderr
    while True:
        try:
            log, place, count = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        found = None
        with suppress(UserError), np.errstate(over='ignore', invalid='ignore'):
            found = digest(read_run(log), place, count)
        pickle.dump(found, out)
        out.flush()


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


if __name__ == '__main__':
    # The classes of its answers are those of the module, not of `__main__`.
    import_module('masmc_ros.report.digest').serve()
