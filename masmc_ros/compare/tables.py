# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A comparison as text, as JSON and as a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
from pathlib import Path
import sys
from textwrap import fill

from masmc_ros.compare.law_comparison import COMPARED, LOST, Ranked, Row
from masmc_ros.compare.trials import Trial
from masmc_ros.report.measure.table import number
from masmc_ros.report.measure.tracking import SMALL
from masmc_ros.report.page.template import rendered
from masmc_ros.result_text import aligned, json_text
from masmc_ros.robot.declaration import Point, symbols_of, units_of

_LOST, _NOT_RUN = 'lost', '-'
_PAGE = Path(__file__).with_name('page.html')
_DECADES = 4.0
"""Decades of the error, relative to the smallest one, from a pale to a dark colour."""


def text(
    ranked: Sequence[Ranked],
    trials: Sequence[Trial],
    points: Sequence[Point],
    width: int = sys.maxsize,
) -> str:
    """Return the ranking, and the error in each trial, as aligned tables of a `width`."""
    first = trials[0].name
    body = [[str(k), *_cells(entry, first, points)] for k, entry in enumerate(ranked, start=1)]
    top = [('', *row) for row in zip(*_heads(points), strict=True)]
    lines = [f'{trials[0].description}:', '', *aligned([*top, *body], (1,), keys=2, width=width)]
    if len(trials) > 1:
        names = ['law', *(trial.name for trial in trials)]
        for head, cells in _of_trials(ranked, trials, points):
            rows = [
                [entry.contender.label, *row] for entry, row in zip(ranked, cells, strict=True)
            ]
            lines += ['', f'{head}:', '', *aligned([names, *rows], (0,), width=width)]
        lines += ['']
        lines += [fill(f'{trial.name}: {trial.description}', width) for trial in trials[1:]]
    runs = next(iter(ranked[0].rows.values())).runs
    notes = (
        'Errors, torques and variation: over the second half of a run;'
        f' medians of {runs} run{"s" if runs != 1 else ""}.',
        f'{_LOST}: diverged, or farther than {_farthest(points)} from the path, in most runs.',
    )
    lines += ['', *(fill(note, width) for note in notes)]
    if trials[0].benchmark:
        lines += [f'Benchmark: {trials[0].benchmark}.']
    return '\n'.join(lines) + '\n'


def _of_trials(
    ranked: Sequence[Ranked], trials: Sequence[Trial], points: Sequence[Point]
) -> list[tuple[str, list[list[str]]]]:
    """Return heads and cells of the tables of error and variation by trials."""
    variation = COMPARED['torque_variation']

    def cells(value: Callable[[Row], str]) -> list[list[str]]:
        return [
            [_of_row(entry.rows.get(trial.name), value) for trial in trials] for entry in ranked
        ]

    return [
        *(
            (
                f'RMS error of {_together(points, unit)}, m{unit}',
                cells(partial(_error, unit=unit)),
            )
            for unit in units_of(points)
        ),
        (
            f'{variation.head.capitalize()}, {variation.unit}',
            cells(lambda row: _effort(row.efforts['torque_variation'])),
        ),
    ]


def _of_row(row: Row | None, value: Callable[[Row], str]) -> str:
    return _NOT_RUN if row is None else value(row)


def _error(row: Row, unit: str) -> str:
    return _small(row.together[unit])


def _together(points: Sequence[Point], unit: str) -> str:
    """Return the symbols of the points with a unit, whose errors are added."""
    added = [point for point in points if point.unit == unit]
    return f'{symbols_of(added)}{" together" if len(added) > 1 else ""}'


def _effort(value: float) -> str:
    return number(value) if math.isfinite(value) else _NOT_RUN


def _heads(points: Sequence[Point]) -> list[tuple[str, str]]:
    """Return heads and units of the columns."""
    return [
        ('law', ''),
        *((f'{point.symbol} RMS', f'({point.small_unit})') for point in points),
        ('largest', f'({points[0].small_unit})'),
        *((metric.head, f'({metric.unit})') for metric in COMPARED.values()),
        ('lost', 'runs'),
    ]


def _farthest(points: Sequence[Point]) -> str:
    """Return the distances from which a run is lost."""
    return ' or '.join(f'{LOST:g} {unit}' for unit in units_of(points))


def _cells(entry: Ranked, trial: str, points: Sequence[Point]) -> list[str]:
    row = entry.rows.get(trial)
    if row is None:
        return [entry.contender.label, *[_NOT_RUN] * (len(_heads(points)) - 1)]
    return [
        entry.contender.label,
        *(_small(row.errors[point.key]) for point in points),
        _small(row.largest),
        *map(_effort, row.efforts.values()),
        f'{row.lost}/{row.runs}',
    ]


def _small(error: float) -> str:
    return number(SMALL * error) if math.isfinite(error) else _LOST


def rows_of(ranked: Sequence[Ranked], trials: Sequence[Trial]) -> list[dict[str, object]]:
    """Return all numbers of each law and trial in SI units; None for infinite ones."""
    return [
        {n: None if isinstance(v, float) and not math.isfinite(v) else v for n, v in row.items()}
        for row in _rows(ranked, trials)
    ]


def _rows(ranked: Sequence[Ranked], trials: Sequence[Trial]) -> list[dict[str, object]]:
    return [
        {
            **entry.contender._asdict(),
            'benchmark': trial.benchmark,
            'trial': trial.name,
            **row.numbers(),
        }
        for entry in ranked
        for trial in trials
        if trial.name in entry.rows
        for row in (entry.rows[trial.name],)
    ]


def as_json(ranked: Sequence[Ranked], trials: Sequence[Trial]) -> str:
    """Return the rows as text."""
    return json_text(_rows(ranked, trials))


def page(
    ranked: Sequence[Ranked], trials: Sequence[Trial], points: Sequence[Point], title: str
) -> str:
    """Return a comparison as HTML without external resources."""
    return rendered(
        _PAGE,
        title=title,
        heads=[f'{name} {unit}'.strip() for name, unit in _heads(points)],
        trials=[(trial.name, trial.description) for trial in trials],
        benchmark=trials[0].benchmark,
        symbols=symbols_of(points),
        rows=[
            {
                'law': entry.contender.label,
                'summary': entry.summary,
                'cells': _cells(entry, trials[0].name, points)[1:],
            }
            for entry in ranked
        ],
        maps=[_map_of(ranked, trials, points, unit) for unit in units_of(points)],
        runs=next(iter(ranked[0].rows.values())).runs,
        farthest=_farthest(points),
    )


def _map_of(
    ranked: Sequence[Ranked], trials: Sequence[Trial], points: Sequence[Point], unit: str
) -> dict[str, object]:
    """Return head and shaded cells of the errors with a unit in all trials."""
    least = min(row.together[unit] for entry in ranked for row in entry.rows.values())

    def cell(row: Row | None) -> tuple[str, int]:
        text = _of_row(row, partial(_error, unit=unit))
        return text, 0 if row is None else _shade(row.together[unit], least)

    return {
        'head': f'RMS error of {_together(points, unit)}, m{unit}',
        'rows': [
            (entry.contender.label, [cell(entry.rows.get(trial.name)) for trial in trials])
            for entry in ranked
        ],
    }


def _shade(error: float, least: float) -> int:
    """Return the darkness of a cell in percent: 0 for the smallest error, then logarithmic."""
    if not math.isfinite(error):
        return 100
    if least <= 0.0:
        return 0
    return round(100.0 * min(1.0, math.log10(error / least) / _DECADES))
