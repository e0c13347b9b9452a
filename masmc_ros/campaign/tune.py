# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Search of parameters that minimise two metrics at once, over drawn robots.

NSGA-II of Optuna proposes generations of candidates. Each candidate runs with all draws, which
are the same for all candidates. Its objectives are a percentile of the metrics over these runs; a
lost run counts as infinite. The result is the Pareto front: the candidates for which no other one
is better in both metrics.

`BaseFile` writes tuned values as a ROS parameter file: the file of the scenario, and blocks below
it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import math
from threading import Event
from typing import Any, NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.runs import Device, evaluated, LANES, Run
from masmc_ros.campaign.variable import check_distinct, Variable, with_variables
from masmc_ros.errors import InputError
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.blocks import read_blocks
from masmc_ros.params.declaration import Values
from masmc_ros.params.file import anywhere
from masmc_ros.params.text import typed
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.table import Column
from masmc_ros.scenario.node_parameters import NODES
from masmc_ros.scenario.scenario import load_scenario, source_of
import numpy as np
import yaml

POPULATION = 32
"""Candidates of a generation."""

FORM = 'NAME=LOW:HIGH or NAME=LOW:HIGH:log'

_LOST = 1.0e300
"""Objective of candidates with lost runs; with infinite ones, distances in Optuna are NaN."""


class Range(NamedTuple):
    """Parameter that is searched, with its range; `is_log`: on a logarithmic scale."""

    name: str
    low: float
    high: float
    is_log: bool


class Candidate(NamedTuple):
    """Values of the searched parameters by name, and both objectives, infinite with lost runs."""

    values: dict[str, float]
    objectives: tuple[float, float]


class Tuning(NamedTuple):
    """
    Result of a search.

    Attributes
    ----------
    start
        Candidate with the values of the scenario; its `values` are empty.
    candidates
        All evaluated candidates.
    front
        Pareto front, sorted by the first objective.
    chosen
        Candidate of the front with the smallest first objective whose second one does not exceed
        that of `start`. Without such a candidate it is the one nearest to the smallest objectives.

    """

    start: Candidate
    candidates: list[Candidate]
    front: list[Candidate]
    chosen: Candidate


def searched(text: str) -> Range:
    """Return the range of a text of `--tune`, see FORM; InputError for an invalid or empty one."""
    name, _, values = text.partition('=')
    parts = values.split(':')
    is_log = parts[2:] == ['log']
    numbers = [typed(part) for part in parts[:2]]
    if not name or len(parts) != (3 if is_log else 2) or not all(
        isinstance(n, int | float) and not isinstance(n, bool) for n in numbers
    ):
        raise InputError(f'--tune {text}: expected {FORM}')
    low, high = map(float, numbers)
    if not low < high or (is_log and low <= 0.0):
        expected = '0 < LOW < HIGH' if is_log else 'LOW < HIGH'
        raise InputError(f'--tune {text}: empty range; expected {expected}')
    return Range(name, low, high, is_log)


def variables_of(campaign: Campaign, ranges: Sequence[Range]) -> list[Variable]:
    """
    Return the searched parameters as variables of a campaign.

    Raises InputError if a parameter is unknown or no number, if it appears twice or is also drawn,
    or if its range exceeds its bounds.
    """
    variables = []
    for entry in ranges:
        place = f'--tune {entry.name}'
        variable = Variable.named(entry.name, campaign.mechanism, place)
        if variable.parameter.kind not in ('double', 'doubles'):
            raise InputError(f'{place}: expected a parameter whose values are numbers')
        for value in (entry.low, entry.high):
            try:
                with_variables(campaign.scenario, [variable], [value])
            except InputError as error:
                raise InputError(f'{place}: {error}') from None
        variables.append(variable)
    check_distinct([*variables, *campaign.variables])
    return variables


def with_values(run: Run, variables: Sequence[Variable], values: Sequence[float]) -> Run:
    """
    Return a run with the values of a candidate.

    Parameters
    ----------
    run
        Run of the campaign, which is not modified.
    variables
        Searched parameters.
    values
        Their values, in the same order.

    """
    return replace(run, scenario=with_variables(run.scenario, variables, values))


class Evaluation:
    """Objectives of candidates, computed in lanes and threads."""

    def __init__(
        self,
        runs: Sequence[Run],
        lanes: int,
        variables: Sequence[Variable],
        objectives: Sequence[Column],
        percentile: float,
        threads: int,
        device: Device | None = None,
    ) -> None:
        """
        Initialise the evaluation.

        Parameters
        ----------
        runs
            Runs of each candidate.
        lanes
            Number of runs that are computed side by side.
        variables
            Searched parameters.
        objectives
            Two metrics.
        percentile
            Percentile of the metrics over the runs; 100 is the worst case.
        threads
            Number of threads.
        device
            Device that computes all runs of a generation at once; None: the threads compute them.

        """
        self._runs, self._lanes = runs, lanes
        self._variables, self._objectives = variables, objectives
        self._percentile, self._threads, self._device = percentile, threads, device

    def __call__(
        self, candidates: Sequence[Sequence[float] | None]
    ) -> list[tuple[float, float]]:
        """Return both objectives of each candidate; None stands for the values of the scenario."""
        runs = [
            run if values is None else with_values(run, self._variables, values)
            for values in candidates
            for run in self._runs
        ]
        size = LANES if self._device is None else len(runs)
        batches = [runs[first:first + size] for first in range(0, len(runs), size)]
        stop = Event()
        with ThreadPoolExecutor(self._threads) as pool:
            try:
                parts = pool.map(
                    lambda batch: evaluated(batch, self._lanes, stop.is_set, self._device), batches
                )
                results = [result for part in parts for result in part]
            finally:
                stop.set()
        rows = np.array([[self._value(c, r) for c in self._objectives] for r in results])
        by_candidate = rows.reshape(len(candidates), len(self._runs), 2)
        reached = np.percentile(by_candidate, self._percentile, axis=1, method='higher')
        return [(float(first), float(second)) for first, second in reached]

    @staticmethod
    def _value(column: Column, result: Metrics | float) -> float:
        value = None if isinstance(result, float) else column.value(result)
        return math.inf if value is None else value


def tuned(
    evaluate: Evaluation,
    ranges: Sequence[Range],
    *,
    evaluations: int,
    seed: int,
    advance: Callable[[int], object] = lambda _: None,
) -> Tuning:
    """
    Return the result of a search.

    Parameters
    ----------
    evaluate
        Evaluation of candidates.
    ranges
        Searched parameters with their ranges, in the order of the variables of `evaluate`.
    evaluations
        Number of candidates.
    seed
        Seed of the search.
    advance
        Called after each generation with the number of its candidates.

    Raises
    ------
    InputError
        if no candidate has finite objectives.

    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    # Seeds of Optuna have 32 bits; the draws use all bits.
    sampler = optuna.samplers.NSGAIISampler(population_size=POPULATION, seed=seed % 2**32)
    study = optuna.create_study(directions=['minimize', 'minimize'], sampler=sampler)
    spaces: dict[str, optuna.distributions.BaseDistribution] = {
        entry.name: optuna.distributions.FloatDistribution(entry.low, entry.high, log=entry.is_log)
        for entry in ranges
    }
    candidates: list[Candidate] = []
    while len(candidates) < evaluations:
        count = min(POPULATION, evaluations - len(candidates))
        trials = [study.ask(spaces) for _ in range(count)]
        asked = [[trial.params[entry.name] for entry in ranges] for trial in trials]
        for trial, objectives in zip(trials, evaluate(asked), strict=True):
            study.tell(trial, [min(value, _LOST) for value in objectives])
            candidates.append(Candidate(dict(trial.params), objectives))
        advance(count)
    start = Candidate({}, evaluate([None])[0])
    front = pareto_front(candidates)
    return Tuning(start, candidates, front, _chosen(front, start))


def pareto_front(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the Pareto front of the finite candidates, sorted by the first objective."""
    front: list[Candidate] = []
    for candidate in sorted(candidates, key=lambda entry: entry.objectives):
        is_better = not front or candidate.objectives[1] < front[-1].objectives[1]
        if all(map(math.isfinite, candidate.objectives)) and is_better:
            front.append(candidate)
    return front


def _chosen(front: Sequence[Candidate], start: Candidate) -> Candidate:
    if not front:
        raise InputError(
            'no candidate has finite metrics: runs diverge, or errors do not settle; expected '
            'other ranges, or fewer conditions'
        )
    allowed = [entry for entry in front if entry.objectives[1] <= start.objectives[1]]
    if allowed and math.isfinite(start.objectives[1]):
        return allowed[0]
    objectives: Array = np.log(np.maximum([entry.objectives for entry in front], 1e-12))
    ideal, spread = objectives.min(axis=0), np.ptp(objectives, axis=0)
    distances = np.linalg.norm((objectives - ideal) / np.where(spread > 0.0, spread, 1.0), axis=1)
    return front[int(np.argmin(distances))]


_BLOCK = '/**/plant: {ros__parameters: {duration: 1.0}}'


class BaseFile(NamedTuple):
    """
    Parameter file of a scenario when a search starts; later changes of the file have no effect.

    Attributes
    ----------
    text
        Content of the file.
    original
        Scenario of the file.
    scenario
        The same with the settings.

    """

    text: str
    original: Scenario
    scenario: Scenario

    @classmethod
    def read(cls, file: str, settings: Sequence[str]) -> BaseFile:
        """
        Read a parameter file, with settings NAME=VALUE.

        Raises InputError if it cannot be loaded, or if no blocks can stand below its text.
        """
        original, source = load_scenario(file), source_of(file, settings)
        scenario = source.scenario()
        try:
            text = source.text.decode('utf-8').rstrip('\n')
            read_blocks(f'{text}\n{_BLOCK}'.encode(), file)
        except (UnicodeDecodeError, InputError):
            raise InputError(
                f'{file}: no block can be added below its text; expected text in UTF-8, without '
                'braces around all blocks and without the end of a document (...)'
            ) from None
        return cls(text, original, scenario)

    def tuned(self, variables: Sequence[Variable], values: Mapping[str, float]) -> str:
        """
        Return the text of a parameter file with the settings and tuned values.

        The last value of a name in a file applies, so the blocks stand below the original text.

        Parameters
        ----------
        variables
            Tuned parameters.
        values
            Tuned values by the names of the variables.

        """
        tuned = with_variables(self.scenario, variables, [values[v.name] for v in variables])
        lines = [self.text, '', '# Tuned by masmc tune.']
        for node in NODES:
            original = self.original[node]
            # Settings can select a robot with other parameters.
            changed = {
                n: v for n, v in tuned[node].items() if n not in original or v != original[n]
            }
            changed |= anywhere(tuned[node])
            if changed:
                block = {f'/**/{node}': {'ros__parameters': _nested(changed)}}
                text = yaml.safe_dump(block, default_flow_style=None, width=99)
                lines.append(text.rstrip('\n'))
        return '\n'.join(lines) + '\n'


def _nested(values: Values) -> dict[str, Any]:
    """Return values by the parts of their dotted names."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *outer, last = name.split('.')
        block = tree
        for part in outer:
            block = block.setdefault(part, {})
        block[last] = list(value) if isinstance(value, tuple) else value
    return tree
