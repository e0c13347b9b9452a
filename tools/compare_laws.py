# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of all laws for docs/reference/laws/comparison.md: `python tools/compare_laws.py [NAME ...]`.

A name is a part of PARTS, or `tuned`; without names all parts are computed. The results replace
those in docs/reference/laws/comparison.csv, from which `python tools/tables.py` writes the tables.
"""

from __future__ import annotations

from collections.abc import Mapping
import csv
from itertools import islice
import math
import os
from pathlib import Path
import sys
from typing import Any, NamedTuple

from masmc_ros import compare_laws, load
from masmc_ros.campaign.runs import metric_columns
from masmc_ros.campaign.tune import Candidate, Evaluation, Range, tuned
from masmc_ros.campaign.variable import Variable
from masmc_ros.child_process import processors
from masmc_ros.compare.law_comparison import comparison_of
from masmc_ros.law import registry
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.table import Column
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / 'docs' / 'reference' / 'laws' / 'comparison.csv'
COLUMNS = ('part', 'law', 'switching', 'trial', 'runs', 'lost', 'error', 'worst',
           'end_effector_rms', 'platform_rms', 'torque_rms', 'torque_variation',
           'gains')  # fmt: skip

_SAME = 'input_output_decoupling'
"""Law with the torque of `nonlinear_feedback`, which is not computed again."""

LAWS = tuple(
    name if not switching else f'{name}:{switching}'
    for name, law in registry.LAWS.items()
    for switching in (('tanh', 'implicit') if law.uses_switching else ('',))
    if name != _SAME
)
"""Laws of the comparison, those with a reaching term with a smooth and a sampled one."""


class Part(NamedTuple):
    """Runs of laws on a scenario."""

    scenario: str
    trials: str
    seeds: int
    settings: Mapping[str, object] = {}
    laws: tuple[str, ...] = LAWS


_ROBOTS = {
    'duration': 12.0,
    'plant.velocity_noise': 0.02,
    'plant.encoder_resolution': 0.0001,
    'controller.torque_limit': [8.0, 8.0, 20.0, 10.0],
    'controller.torque_rate_limit': [400.0, 400.0, 1000.0, 500.0],
}

_FAST = {**_ROBOTS, 'controller.torque_rate_limit': [4000.0, 4000.0, 10000.0, 5000.0]}
"""The same with motors that reach their limit in 2 ms instead of 20 ms."""

_WITHOUT = {'controller.observer_gain': 0.0}
_IMPLICIT = tuple(name for name in LAWS if name.endswith(':implicit'))

PARTS = {
    'paper': Part('paper', 'laws', 100),
    'robust': Part('robust', 'laws', 100),
    'conditions': Part(
        'paper', 'true model,noise,delay', 100, {'controller.observer_gain': 0.5}
    ),
    'robots': Part('robust', 'as it is', 1000, _ROBOTS),
    'robots without estimate': Part(
        'robust', 'as it is', 1000, {**_ROBOTS, **_WITHOUT}, _IMPLICIT
    ),
    'fast drives': Part('robust', 'as it is', 100, _FAST),
    'fast drives without estimate': Part(
        'robust', 'as it is', 100, {**_FAST, **_WITHOUT}, _IMPLICIT
    ),
}
"""Parts of the comparison by name."""

DEFAULT, TUNED, COMMON = 'default gains', 'tuned', 'tuned at 1000 N·m/s'
"""
Parts with the same robots: the default gains, and tuned gains with the smallest error at no more
variation than the default gains, and at no more than VARIATION.
"""

VARIATION = 1000.0
"""Largest variation of the torques in N·m/s that all laws have in common."""

CANDIDATES, SPAN = 192, 5.0
"""Candidates of each law, and range of a gain around its default as a factor."""

ROBOTS, SEARCH, SELECTION = 250, 8, 32
"""Robots of the results; others of each candidate, and of the best candidates."""

BEST = 6
"""Number of candidates that run with the robots of the selection."""

SHORTER = 'duration=6.0'
"""Setting of the runs of the search."""


def _error(metrics: Metrics) -> float:
    errors = (reached.rms for reached in metrics.points.values())
    return math.hypot(*(math.nan if error is None else error for error in errors))


ERROR = Column(
    'error', 'm', 'error', 'mm', 1.0e3, _error,
    is_of_campaigns=True, is_shown=True, is_larger_better=False,
)  # fmt: skip
"""RMS error of all points together."""


def main() -> None:
    """Compute the parts, and write their results after every few laws."""
    for name in sys.argv[1:] or (*PARTS, TUNED):
        if name == TUNED:
            for law in LAWS:
                _write(_tuned(law))
            continue
        part, laws = PARTS[name], iter(PARTS[name].laws)
        while group := tuple(islice(laws, os.cpu_count() or 1)):
            table = compare_laws(
                part.scenario,
                group,
                trials=part.trials,
                seeds=part.seeds,
                settings=part.settings,
            )
            _write([{'part': name, **row} for row in table.to_pylist()])
    print('run: python tools/tables.py')


def _tuned(law: str) -> list[dict[str, Any]]:
    """Tune a law, and compute its default and its tuned gains with other robots."""
    part = PARTS['robots']
    scenario = load(part.scenario, part.settings)
    evaluations = []
    for first, count, settings in ((ROBOTS, SEARCH, (SHORTER,)), (ROBOTS + SEARCH, SELECTION, ())):
        comparison = comparison_of(
            scenario.file, (*scenario.settings, *settings), law, part.trials, first + count
        )
        ranges = _ranges(law, comparison.scenario['controller'])
        mechanism = comparison.mechanism
        variables = [Variable.named(entry.name, mechanism, law) for entry in ranges]
        known = {column.name: column for column in metric_columns(mechanism)}
        evaluations.append(Evaluation(
            list(comparison.runs(first, count)),
            comparison.most_lanes,
            variables,
            (ERROR, known['torque_variation']),
            100.0,
            processors(),
        ))
    search, selection = evaluations
    result = tuned(search, ranges, evaluations=CANDIDATES, seed=0)
    start = result.start._replace(objectives=selection([None])[0])
    rows = [{'part': DEFAULT, **_computed(part, law, start)}]
    own = (result.start.objectives[1], start.objectives[1])
    for name, limits in ((TUNED, own), (COMMON, (VARIATION, VARIATION))):
        below = [c for c in result.candidates if c.objectives[1] <= limits[0]]
        best = sorted(below, key=_objectives)[:BEST]
        reached = selection([list(c.values.values()) for c in best]) if best else []
        final = [c._replace(objectives=r) for c, r in zip(best, reached, strict=True)]
        allowed = [c for c in (start, *final) if c.objectives[1] <= limits[1]]
        if allowed:
            rows.append({'part': name, **_computed(part, law, min(allowed, key=_objectives))})
    print(law, flush=True)
    return rows


def _objectives(candidate: Candidate) -> tuple[float, float]:
    return candidate.objectives


def _computed(part: Part, law: str, candidate: Candidate) -> dict[str, Any]:
    """Return the row of a law with the gains of a candidate."""
    gains = {name: float(f'{value:.3g}') for name, value in candidate.values.items()}
    settings = {**part.settings, **gains}
    table = compare_laws(
        part.scenario, [law], trials=part.trials, seeds=ROBOTS, settings=settings
    )
    return {**table.to_pylist()[0], 'gains': ' '.join(f'{n}={v:g}' for n, v in gains.items())}


def _ranges(law: str, values: Mapping[str, Any]) -> list[Range]:
    """Return the ranges of the gains of a law and its switching term that are not 0."""
    name, _, switching = law.partition(':')
    declared = [*registry.LAWS[name].parameters]
    declared += registry.REACHING[switching].parameters if switching else ()
    largest = {p.name: getattr(p, 'maximum', None) or math.inf for p in declared}
    kinds = {p.name: getattr(p, 'kind', 'double') for p in declared}
    gains = {n: float(np.max(values[n])) for n, kind in kinds.items() if kind == 'double'}
    return [
        Range(f'controller.{n}', value / SPAN, min(SPAN * value, largest[n]), True)
        for n, value in gains.items()
        if value > 0.0
    ]


def _write(rows: list[dict[str, Any]]) -> None:
    """Add rows to the results, and remove those of the same law and part."""
    kept = list(csv.DictReader(RESULTS.open(encoding='utf-8'))) if RESULTS.exists() else []
    new = {_key(row) for row in rows}
    kept = [row for row in kept if _key(row) not in new]
    for row in rows:
        row.update({n: '' if v is None else f'{v:.6g}' for n, v in row.items() if n in _NUMBERS})
    with RESULTS.open('w', encoding='utf-8', newline='') as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction='ignore', lineterminator='\n')
        writer.writeheader()
        writer.writerows(sorted([*kept, *rows], key=_place))


_NUMBERS = frozenset(COLUMNS[6:-1])


def _key(row: Mapping[str, Any]) -> tuple[str, ...]:
    return row['part'], row['law'], row['switching']


def _place(row: Mapping[str, Any]) -> tuple[int, int]:
    name = f'{row["law"]}:{row["switching"]}'.rstrip(':')
    return [*PARTS, DEFAULT, TUNED, COMMON].index(row['part']), LAWS.index(name)


if __name__ == '__main__':
    main()
