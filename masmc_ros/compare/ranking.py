# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ranking of contenders: medians over the seeds, in the order of the error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import math
from typing import Any

from masmc_ros.compare.campaign import Outcome
from masmc_ros.compare.contenders import Contender
from masmc_ros.report.measure.metrics import Metrics
import numpy as np

LOST = 1.0
"""Error in m from which a robot that does not diverge does not follow either."""


@dataclass(frozen=True)
class Row:
    """
    How a contender did in a trial; numbers are medians over the runs that did not diverge.

    Attributes
    ----------
    errors
        RMS distance of each of the robot's points, m, by its key.
    error
        RMS distance of all points together, m; infinite where most runs were lost.
    worst
        the largest of the runs' errors, m; infinite where one was lost.
    largest
        largest distance of any point on the way, m.
    torque_rms
        N m.
    torque_variation
        N m/s, large for a command that chatters.
    runs
        how many there were.
    lost
        how many of them diverged, or were farther than LOST from the path.

    """

    errors: Mapping[str, float]
    error: float
    worst: float
    largest: float
    torque_rms: float
    torque_variation: float
    runs: int
    lost: int


@dataclass(frozen=True)
class Ranked:
    """A contender with what it did in each trial, by name."""

    contender: Contender
    rows: Mapping[str, Row]


def ranking(found: Iterable[Outcome], first: str) -> list[Ranked]:
    """Return the contenders by their error in a trial, the least first."""
    rows: dict[Contender, dict[str, Row]] = {}
    for outcome in found:
        rows.setdefault(outcome.contender, {})[outcome.trial] = _row(outcome.reached)
    ranked = [Ranked(contender, each) for contender, each in rows.items()]
    return sorted(ranked, key=lambda each: (each.rows[first].error, each.contender.label))


def _together(reached: Metrics) -> float:
    """Return the RMS distance of all points of a run together, m."""
    return math.sqrt(sum((point.rms or 0.0) ** 2 for point in reached.points.values()))


def _row(reached: tuple[Metrics | None, ...]) -> Row:
    there = [each for each in reached if each is not None]
    kept = [each for each in there if _together(each) < LOST]
    lost = len(reached) - len(kept)
    is_lost = 2 * lost > len(reached)

    def median(values: Iterable[Any]) -> float:
        numbers = [value for value in values if value is not None]
        return float(np.median(numbers)) if numbers and not is_lost else math.inf

    points = tuple(there[0].points) if there else ()
    return Row(
        errors={p.key: median(each.points[p].rms for each in kept) for p in points},
        error=median(map(_together, kept)),
        worst=math.inf if lost else max(map(_together, kept)),
        largest=median(max(p.largest or 0.0 for p in each.points.values()) for each in kept),
        torque_rms=median(each.torque_rms for each in kept),
        torque_variation=median(each.torque_variation for each in kept),
        runs=len(reached),
        lost=lost,
    )
