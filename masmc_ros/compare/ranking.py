# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ranking of contenders: medians over the seeds, sorted by error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math

from masmc_ros.campaign.runs import Rows
from masmc_ros.compare.contenders import Contender, summary_of
from masmc_ros.compare.law_comparison import Comparison, compute
from masmc_ros.report.measure.metrics import declared, Metrics
from masmc_ros.robot.declaration import Point, units_of
import numpy as np
from tqdm import tqdm

LOST = 1.0
"""Error in m or rad from which a run is lost although it does not diverge."""

COMPARED = {name: metric for name, metric in declared(Metrics).items() if metric.is_compared}
"""Metrics of whole runs that are compared."""


@dataclass(frozen=True)
class Row:
    """
    Results of a contender in a trial; numbers are medians over the runs that did not diverge.

    Attributes
    ----------
    together
        RMS distance of all points of a unit together, by unit: m or rad, that of the first point
        first; infinite if most runs were lost.
    errors
        RMS distance of each of the robot's points, m or rad, by its key; infinite if most runs
        were lost.
    worst
        largest error of the runs, in the unit of the first point; infinite if one was lost.
    largest
        largest distance during a run of any point with the unit of the first one.
    efforts
        metrics of COMPARED by name.
    runs
        number of runs.
    lost
        number of runs that diverged, or were farther than LOST from the path.

    """

    together: Mapping[str, float]
    errors: Mapping[str, float]
    worst: float
    largest: float
    efforts: Mapping[str, float]
    runs: int
    lost: int

    @property
    def error(self) -> float:
        """Return the error by which laws are ranked: that in the unit of the first point."""
        return next(iter(self.together.values()))

    def numbers(self) -> dict[str, float]:
        """Return all numbers by name."""
        errors = {f'{key}_rms': value for key, value in self.errors.items()}
        extremes = {'worst': self.worst, 'largest': self.largest}
        counts = {'runs': self.runs, 'lost': self.lost}
        return {'error': self.error, **errors, **extremes, **self.efforts, **counts}


@dataclass(frozen=True)
class Ranked:
    """
    A contender with its results.

    Attributes
    ----------
    contender
        Law or controller.
    rows
        Results by the name of the trial; trials that the contender cannot run are absent.
    summary
        Description in one line; empty if there is none.

    """

    contender: Contender
    rows: Mapping[str, Row]
    summary: str = ''


def compared(
    comparison: Comparison, *, threads: int = 0, scheduler: str = ''
) -> list[Ranked]:
    """
    Compute all runs with a progress bar; return the contenders, the smallest error first.

    Parameters and errors are those of `law_comparison.compute`.
    """
    ranked, kinds = [], comparison.by_kind()
    total = sum(kind.total for kind in kinds)
    with tqdm(total=total, unit='run', disable=None) as progress:
        for kind in kinds:
            rows = compute(
                kind, threads=threads, scheduler=scheduler, advance=progress.update
            )
            ranked += ranking(kind, rows)
    return by_error(ranked, comparison.trials[0].name)


def ranking(comparison: Comparison, rows: Rows) -> list[Ranked]:
    """
    Return the contenders by their error in the first trial, the smallest error first.

    `rows` are those of all runs, see `compare.law_comparison.compute`.
    """
    columns = {name: values.tolist() for name, values in rows.items()}
    points = comparison.mechanism.points
    first, results = 0, []
    for contender in comparison.contenders:
        by_trial = {}
        for trial in comparison.trials:
            runs = slice(first, first + comparison.seeds)
            by_trial[trial.name] = _row({n: v[runs] for n, v in columns.items()}, points)
            first = runs.stop
        results.append(Ranked(contender, by_trial, summary_of(contender.law)))
    return by_error(results, comparison.trials[0].name)


def by_error(ranked: Sequence[Ranked], trial: str) -> list[Ranked]:
    """Return contenders by their error in a trial; those without the trial are last."""

    def key(entry: Ranked) -> tuple[float, str]:
        error = entry.rows[trial].error if trial in entry.rows else math.inf
        return error, entry.contender.label

    return sorted(ranked, key=key)


def _row(columns: Mapping[str, Sequence[float]], points: Sequence[Point]) -> Row:
    """Return the results of the runs of a contender in a trial."""
    # A distance and an angle have no common norm.
    keys = {unit: [p.key for p in points if p.unit == unit] for unit in units_of(points)}
    distances = {
        unit: [
            math.sqrt(sum(rms**2 for rms in of_run))
            for of_run in zip(*(columns[f'{key}_rms'] for key in of_unit), strict=True)
        ]
        for unit, of_unit in keys.items()
    }
    ranked, first = distances[points[0].unit], keys[points[0].unit]
    extremes = [columns[f'{key}_max'] for key in first]
    largest = [max(of_run) for of_run in zip(*extremes, strict=True)]
    # The distances of a run that diverged are NaN.
    kept = [k for k in range(len(ranked)) if all(d[k] < LOST for d in distances.values())]
    lost = len(ranked) - len(kept)
    is_lost = 2 * lost > len(ranked)

    def median(values: Sequence[float]) -> float:
        return float(np.median([values[k] for k in kept])) if kept and not is_lost else math.inf

    return Row(
        together={unit: median(values) for unit, values in distances.items()},
        errors={p.key: median(columns[f'{p.key}_rms']) for p in points},
        worst=math.inf if lost else max(ranked),
        largest=median(largest),
        efforts={name: median(columns[metric.name]) for name, metric in COMPARED.items()},
        runs=len(ranked),
        lost=lost,
    )
