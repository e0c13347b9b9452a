# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of laws: a campaign of each contender in each trial with each seed, and its ranking.

The ranking has medians over the seeds, sorted by error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cached_property
import json
import math

from masmc_ros.campaign.engine import computed
from masmc_ros.campaign.runs import (
    checked_scenario,
    Description,
    Rows,
    Run,
    scenario_of,
    WORTH_LANES,
)
from masmc_ros.campaign.variable import Variable, with_variables
from masmc_ros.compare.contenders import (
    Contender,
    contenders,
    Controller,
    enter,
    marked,
    summary_of,
)
from masmc_ros.compare.trials import drawn_robot, sets_observer, Trial, trials_named
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import is_hybrid, takes_rates
from masmc_ros.law.registry import SWITCHING_TERM
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.file import parse_value
from masmc_ros.report.measure.metrics import declared, Metrics
from masmc_ros.robot.declaration import Point, units_of
import numpy as np
from tqdm import tqdm


@dataclass(frozen=True, eq=False)
class Comparison(Description):
    """
    Runs of a comparison: contenders, their trials, and the seeds of a trial, which are fastest.

    Attributes
    ----------
    scenario
        Scenario with the settings of the user.
    contenders, trials
        Laws and conditions; their settings replace values of the scenario.
    seeds
        Number of runs of each contender in each trial.

    """

    scenario: Scenario
    contenders: tuple[Contender, ...]
    trials: tuple[Trial, ...]
    seeds: int

    @property
    def total(self) -> int:
        """Return the number of runs."""
        return len(self.contenders) * len(self.trials) * self.seeds

    def by_kind(self) -> list[Comparison]:
        """
        Return a comparison of the laws in plain Python, and one of the compiled laws.

        Each one has the trials that its laws can run. Mistakes in plain Python end the first one.
        """
        plain = tuple(contender for contender in self.contenders if contender.is_plain)
        compiled = tuple(contender for contender in self.contenders if not contender.is_plain)
        of_torques = tuple(trial for trial in self.trials if not trial.is_hybrid)
        kinds = replace(self, contenders=plain, trials=of_torques), replace(
            self, contenders=compiled
        )
        return [kind for kind in kinds if kind.total]

    @property
    def lanes(self) -> int:
        """Return the number of runs that are computed side by side."""
        return self.most_lanes if self.seeds >= WORTH_LANES else 1

    @cached_property
    def text(self) -> str:
        """Return the description as JSON, from which `from_text` makes it again."""
        return json.dumps({**asdict(self), 'scenario': self.scenario.values})

    @classmethod
    def from_text(cls, text: str) -> Comparison:
        """Return the comparison of a JSON text."""
        values = json.loads(text)
        return cls(
            checked_scenario(values['scenario']),
            tuple(Contender(*fields) for fields in values['contenders']),
            tuple(
                Trial(**{**fields, 'settings': tuple(fields['settings'])})
                for fields in values['trials']
            ),
            values['seeds'],
        )

    def runs(self, first: int, count: int) -> Iterator[Run]:
        """
        Yield the runs `first` to `first + count - 1`.

        Raises InputError for values that a node would reject.
        """
        for number in range(first, first + count):
            point, seed = divmod(number, self.seeds)
            yield Run(number, {}, drawn_robot(self._scenario(point), self.mechanism, seed))

    def _scenario(self, point: int) -> Scenario:
        """Return the scenario of a contender in a trial; the trials are faster."""
        contender, trial = divmod(point, len(self.trials))
        settings = (
            *self.contenders[contender].settings,
            *self.trials[trial].settings_for(self.mechanism, self.scenario.controller),
        )
        named = [
            Variable.named(setting.partition('=')[0], self.mechanism, setting)
            for setting in settings
        ]
        values = [parse_value(setting.partition('=')[2], setting) for setting in settings]
        return with_variables(self.scenario, named, values)


def comparison_of(
    file: str,
    settings: Sequence[str],
    laws: str,
    trials: str,
    seeds: int,
    controllers: Mapping[str, Controller] | None = None,
) -> Comparison:
    """
    Return the comparison of laws in a parameter file.

    Parameters
    ----------
    file, settings
        Parameter file, and NAME=VALUE as in `--set`.
    laws, trials
        Names as in `--laws` and `--trials`.
    seeds
        Number of runs of each law in each trial.
    controllers
        Controllers from elsewhere by name, which are compared with the laws.

    Raises
    ------
    InputError
        If a name is unknown or a value out of range, or if the scenario commands velocities,
        also those of the base for laws in plain Python.

    """
    scenario = scenario_of(file, settings)
    controller = scenario.controller
    if takes_rates(controller):
        raise InputError(
            f'{file}: command_interface = velocity: only one law commands velocities; expected'
            ' effort'
        )
    mechanism = scenario.mechanism
    named = trials_named(trials, mechanism)
    chosen = contenders(laws, mechanism, SWITCHING_TERM.of(controller))
    for name, entered in (controllers or {}).items():
        enter(name, entered)
        chosen = (*chosen, Contender(name))
    if is_hybrid(controller) and any(contender.is_plain for contender in chosen):
        raise InputError(
            f'{file}: command_interface = hybrid: laws in plain Python command torques; expected'
            ' effort'
        )
    if not sets_observer(named):
        chosen = marked(chosen, controller)
    return Comparison(scenario, chosen, named, seeds)


def compute(
    comparison: Comparison,
    *,
    threads: int = 0,
    scheduler: str = '',
    advance: Callable[[int], object] = lambda _: None,
) -> Rows:
    """
    Return the rows of all runs in their order.

    Parameters
    ----------
    comparison
        Comparison of one kind of laws (`Comparison.by_kind`).
    threads, scheduler
        As for `campaign.engine.computed`.
    advance
        Called with numbers of runs that are done.

    Raises
    ------
    InputError
        If no scheduler answers, or if the runs cannot be computed.

    """
    if comparison.contenders[0].is_plain:
        # Threads share the interpreter, and a controller need not be safe in several of them.
        threads, scheduler = 1, ''
    parts = []
    results = computed(comparison, comparison.parts, threads=threads, scheduler=scheduler)
    with closing(results):
        for rows in results:
            parts.append(rows)
            advance(len(rows['run']))
    parts.sort(key=lambda rows: int(rows['run'][0]))
    return {name: np.concatenate([rows[name] for rows in parts]) for name in parts[0]}


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
