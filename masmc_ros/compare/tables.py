# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A comparison as text, as JSON and as a page."""

from __future__ import annotations

from collections.abc import Sequence
import json
import math
from pathlib import Path
from typing import Any

from markupsafe import Markup
from masmc_ros import __version__
from masmc_ros.compare.ranking import LOST, Ranked, Row
from masmc_ros.compare.trials import Trial
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.report.aligned import aligned
from masmc_ros.report.measure.table import number
from masmc_ros.report.page.template import STYLE, template_at
from masmc_ros.robot.declaration import Point, symbols_of

_SMALL = 1e3
"""Factor of errors in mm and mrad."""
_LOST = 'lost'
_PAGE = Path(__file__).with_name('page.html')
_DECADES = 4.0
"""Colours of errors relative to the smallest one, from pale to dark."""


def text(ranked: Sequence[Ranked], trials: Sequence[Trial], points: Sequence[Point]) -> str:
    """Return the ranking, and the error in each trial, as aligned tables."""
    first = trials[0].name
    heads, units = _heads(points)
    body = [[str(k), *_cells(each, first, points)] for k, each in enumerate(ranked, start=1)]
    symbols = ', '.join(point.symbol for point in points)
    together = ' together' if len(points) > 1 else ''
    table = aligned([['', *heads], ['', *units], *body], left=(1,))
    lines = [f'{trials[0].description}:', '', *table]
    if len(trials) > 1:
        rows = [
            [each.contender.label, *(_small(each.rows[t.name].error) for t in trials)]
            for each in ranked
        ]
        names = ['law', *(trial.name for trial in trials)]
        head = f'RMS error of {symbols}{together}, {_units(points)}:'
        lines += ['', head, '', *aligned([names, *rows], left=(0,)), '']
        lines += [f'{trial.name}: {trial.description}' for trial in trials[1:]]
    runs = next(iter(ranked[0].rows.values())).runs
    lines += [
        '',
        f'Errors, torques and their variation over the second half of a run; medians of {runs} '
        f'run{"s" if runs != 1 else ""}.',
        f'{_LOST}: diverged, or farther than {_farthest(points)} from the path, in most runs.',
    ]
    return '\n'.join(lines) + '\n'


def _heads(points: Sequence[Point]) -> tuple[list[str], list[str]]:
    names = [f'{point.symbol} RMS' for point in points]
    heads = ['law', *names, 'largest', 'torque RMS', 'variation', 'lost']
    units = [f'({point.small_unit})' for point in points]
    return heads, ['', *units, f'({_units(points)})', '(N·m)', '(N·m/s)', 'runs']


def _units(points: Sequence[Point]) -> str:
    """Return the units of the errors of all points."""
    return ' or '.join(dict.fromkeys(point.small_unit for point in points))


def _farthest(points: Sequence[Point]) -> str:
    """Return from where on a run is lost."""
    return ' or '.join(dict.fromkeys(f'{LOST:g} {point.unit}' for point in points))


def _cells(each: Ranked, trial: str, points: Sequence[Point]) -> list[str]:
    row = each.rows[trial]
    return [
        each.contender.label,
        *(_small(row.errors.get(point.key, math.inf)) for point in points),
        _small(row.largest),
        _known(row.torque_rms),
        _known(row.torque_variation),
        f'{row.lost}/{row.runs}',
    ]


def _small(error: float) -> str:
    return number(_SMALL * error) if math.isfinite(error) else _LOST


def _known(value: float) -> str:
    return number(value) if math.isfinite(value) else '-'


def as_json(ranked: Sequence[Ranked]) -> str:
    """Return every number, SI units; null for one that is none."""
    return json.dumps(
        [
            {
                'law': each.contender.law,
                'switching': each.contender.switching,
                'trial': trial,
                **{name: _finite(value) for name, value in _numbers(row).items()},
            }
            for each in ranked
            for trial, row in each.rows.items()
        ],
        indent=1,
    )


def _numbers(row: Row) -> dict[str, Any]:
    return {
        'error': row.error,
        **{f'{key}_rms': value for key, value in row.errors.items()},
        'worst': row.worst,
        'largest': row.largest,
        'torque_rms': row.torque_rms,
        'torque_variation': row.torque_variation,
        'runs': row.runs,
        'lost': row.lost,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def page(
    ranked: Sequence[Ranked], trials: Sequence[Trial], points: Sequence[Point], title: str
) -> str:
    """Return a comparison as HTML, which loads nothing from elsewhere."""
    heads, units = _heads(points)
    rows = [each.rows[trial.name] for each in ranked for trial in trials]
    least = min((row.error for row in rows), default=math.inf)
    return template_at(_PAGE).render(
        version=__version__,
        title=title,
        heads=[f'{name} {unit}'.strip() for name, unit in zip(heads, units, strict=True)],
        trials=[(trial.name, trial.description) for trial in trials],
        symbols=symbols_of(points),
        rows=[
            {
                'law': each.contender.label,
                'summary': _summary(each.contender.law),
                'cells': _cells(each, trials[0].name, points)[1:],
                'errors': [
                    (
                        _small(each.rows[trial.name].error),
                        _shade(each.rows[trial.name].error, least),
                    )
                    for trial in trials
                ],
            }
            for each in ranked
        ],
        runs=rows[0].runs if rows else 0,
        units=_units(points),
        farthest=_farthest(points),
        style=Markup(STYLE.read_text(encoding='utf-8')),
    )


def _shade(error: float, least: float) -> int:
    """Return how dark a cell is, in percent: 0 for the least error, more by its logarithm."""
    if not math.isfinite(error):
        return 100
    if least <= 0.0:
        return 0
    return round(100.0 * min(1.0, math.log10(error / least) / _DECADES))


def _summary(name: str) -> str:
    law = registry.load(name)
    return law.summary if isinstance(law, Law) else ''
