# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ranking of contenders: medians over the seeds, sorted by error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import math

from masmc_ros.compare.campaign import Outcome
from masmc_ros.compare.contenders import Contender
from masmc_ros.report.measure.metrics import declared, Metrics
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
        RMS distance of each of the robot's points, m, by its key.
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


def ranking(outcomes: Iterable[Outcome], first: str) -> list[Ranked]:
    """Return the contenders by their error in the trial `first`, the smallest error first."""
    rows: dict[Contender, dict[str, Row]] = {}
    for outcome in outcomes:
        rows.setdefault(outcome.contender, {})[outcome.trial] = _row(outcome.reached)
    ranked = [Ranked(contender, trials) for contender, trials in rows.items()]
    return sorted(ranked, key=lambda entry: (entry.rows[first].error, entry.contender.label))


def _together(reached: Metrics) -> float:
    """Return the RMS distance of all points of a run together, m."""
    return math.sqrt(sum((point.rms or 0.0) ** 2 for point in reached.points.values()))


def _row(reached: tuple[Metrics | None, ...]) -> Row:
    finite = [metrics for metrics in reached if metrics is not None]
    kept = [metrics for metrics in finite if _together(metrics) < LOST]
    lost = len(reached) - len(kept)
    is_lost = 2 * lost > len(reached)

    def median(values: Iterable[float | None]) -> float:
        numbers = [value for value in values if value is not None]
        return float(np.median(numbers)) if numbers and not is_lost else math.inf

    points = tuple(finite[0].points) if finite else ()
    return Row(
        error=median(map(_together, kept)),
        errors={p.key: median(run.points[p].rms for run in kept) for p in points},
        worst=math.inf if lost else max(map(_together, kept)),
        largest=median(max(p.largest or 0.0 for p in run.points.values()) for run in kept),
        efforts={name: median(getattr(run, name) for run in kept) for name in COMPARED},
        runs=len(reached),
        lost=lost,
    )
