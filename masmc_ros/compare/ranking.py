# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ranking of contenders: medians over the seeds, sorted by error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math

from masmc_ros.campaign.part import Rows
from masmc_ros.compare.contenders import Contender
from masmc_ros.compare.law_comparison import Comparison
from masmc_ros.report.measure.metrics import declared, Metrics
from masmc_ros.robot.declaration import Point
import numpy as np

LOST = 1.0
"""Error in m from which a run is lost although it does not diverge."""

COMPARED = {name: metric for name, metric in declared(Metrics).items() if metric.is_compared}
"""Metrics of whole runs that are compared."""


@dataclass(frozen=True)
class Row:
    """
    Results of a contender in a trial; numbers are medians over the runs that did not diverge.

    Attributes
    ----------
    error
        RMS distance of all points together, m; infinite if most runs were lost.
    errors
        RMS distance of each of the robot's points, m, by its key; infinite if most runs were
        lost.
    worst
        largest error of the runs, m; infinite if one was lost.
    largest
        largest distance of any point during a run, m.
    efforts
        metrics of COMPARED by name.
    runs
        number of runs.
    lost
        number of runs that diverged, or were farther than LOST from the path.

    """

    error: float
    errors: Mapping[str, float]
    worst: float
    largest: float
    efforts: Mapping[str, float]
    runs: int
    lost: int

    def numbers(self) -> dict[str, float]:
        """Return all numbers by name."""
        errors = {f'{key}_rms': value for key, value in self.errors.items()}
        extremes = {'worst': self.worst, 'largest': self.largest}
        counts = {'runs': self.runs, 'lost': self.lost}
        return {'error': self.error, **errors, **extremes, **self.efforts, **counts}


@dataclass(frozen=True)
class Ranked:
    """A contender with its results in each trial, by name."""

    contender: Contender
    rows: Mapping[str, Row]


def ranking(comparison: Comparison, rows: Rows) -> list[Ranked]:
    """
    Return the contenders by their error in the first trial, the smallest error first.

    `rows` are those of all runs, see `compare.campaign.compute`.
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
        results.append(Ranked(contender, by_trial))
    name = comparison.trials[0].name
    return sorted(results, key=lambda entry: (entry.rows[name].error, entry.contender.label))


def _row(columns: Mapping[str, Sequence[float]], points: Sequence[Point]) -> Row:
    """Return the results of the runs of a contender in a trial."""
    distances = [
        math.sqrt(sum(rms**2 for rms in of_run))
        for of_run in zip(*(columns[f'{p.key}_rms'] for p in points), strict=True)
    ]
    largest = [
        max(of_run) for of_run in zip(*(columns[f'{p.key}_max'] for p in points), strict=True)
    ]
    # The distances of a run that diverged are NaN.
    kept = [k for k, distance in enumerate(distances) if distance < LOST]
    lost = len(distances) - len(kept)
    is_lost = 2 * lost > len(distances)

    def median(values: Sequence[float]) -> float:
        return float(np.median([values[k] for k in kept])) if kept and not is_lost else math.inf

    return Row(
        error=median(distances),
        errors={p.key: median(columns[f'{p.key}_rms']) for p in points},
        worst=math.inf if lost else max(distances),
        largest=median(largest),
        efforts={name: median(columns[metric.name]) for name, metric in COMPARED.items()},
        runs=len(distances),
        lost=lost,
    )
