# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of runs: as text, as Markdown, and as CSV for computations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
import csv
from functools import partial
import io
import math
from operator import attrgetter
import sys
from textwrap import fill
from typing import NamedTuple

from masmc_ros.report.aligned import aligned
from masmc_ros.report.measure.metrics import declared, Metric, Metrics, Reached
from masmc_ros.report.measure.settling import BAND, FLOOR
from masmc_ros.report.measure.tracking import SMALL
from masmc_ros.robot.declaration import listed, Point, symbols_of
import numpy as np

_COUNTS = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight')
CONTACT_NOTE = (
    'Slip and normal force: of all wheels over the whole run, as often as plant/contact is logged.'
)
_UNKNOWN = Reached()
_DIGITS = 5


class Column(NamedTuple):
    """Metric as a column of tables: name and unit of files, head, and unit of texts."""

    name: str
    unit: str
    head: str
    shown_unit: str
    factor: float
    value: Callable[[Metrics], float | None]


def columns(rows: Iterable[Metrics]) -> list[Column]:
    """Return the columns of all metrics of runs: of their points, and of the whole runs."""
    rows = tuple(rows)
    points = points_of(rows)
    has_contact = any(row.fastest_slip is not None for row in rows)
    # The distances of all points precede their settling times.
    return [
        *(
            _of_point(point, attribute, metric)
            for is_time in (False, True)
            for point in points
            for attribute, metric in declared(Reached).items()
            if bool(metric.unit) == is_time
        ),
        *(
            _column(metric, metric.name, metric.head, metric.unit, attrgetter(attribute))
            for attribute, metric in declared(Metrics).items()
            if has_contact or not metric.of_contact
        ),
    ]


def _of_point(point: Point, attribute: str, metric: Metric) -> Column:
    return _column(
        metric._replace(is_small=not metric.unit),
        f'{point.key}_{metric.name}',
        f'{point.symbol} {metric.head}',
        metric.unit or point.unit,
        lambda row: getattr(row.points.get(point, _UNKNOWN), attribute),
    )


def _column(
    metric: Metric, name: str, head: str, unit: str, value: Callable[[Metrics], float | None]
) -> Column:
    shown, factor = (f'm{unit}', SMALL) if metric.is_small else (unit, 1.0)
    return Column(name, unit, head, shown, factor, value)


def text_table(rows: Mapping[str, Metrics], width: int = sys.maxsize) -> str:
    """Return metrics by label as an aligned table, errors in mm or mrad, and their meaning."""
    top, body = heads(rows), cells(rows)
    table = aligned([*zip(*top, strict=True), *body], (0,), rule=2, width=width)
    return '\n'.join([*table, '', *(fill(note, width) for note in notes(rows))]) + '\n'


def notes(rows: Mapping[str, Metrics]) -> list[str]:
    """Return the meaning of the columns, a text for each kind."""
    points = points_of(rows.values())
    units = ' or '.join(dict.fromkeys(point.small_unit for point in points))
    titles = listed([f'of the {point.title.removeprefix("the ")}' for point in points])
    count = max(row.joints for row in rows.values())
    commands = _COUNTS[count] if count < len(_COUNTS) else str(count)
    texts = (
        f'{symbols_of(points)}: distance {titles} from the reference.',
        f'Settles: time after which it stays below {BAND:.0%} of the first distance, or'
        f' {FLOOR * SMALL:g} {units} if that is more.',
        f'Torque variation: sum of the changes of all {commands} commands, per second.',
        contact_note(rows),
    )
    return [text for text in texts if text]


def markdown_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a Markdown table, errors in mm or mrad."""
    top = [f'{name} {unit}'.rstrip() for name, unit in heads(rows)]
    body = ([label.replace('|', r'\|'), *row] for label, *row in cells(rows))
    lines = [top, ['---'] + ['---:'] * (len(top) - 1), *body]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def csv_table(rows: Mapping[str, Metrics]) -> str:
    """
    Return metrics by label as CSV: SI units, all digits, missing ones empty.

    The settling time is `inf` if the distance does not settle.
    """
    shown = columns(rows.values())
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    units = (f'{column.name} ({column.unit})' for column in shown)
    writer.writerow(['run', 'begin (s)', 'end (s)', *units])
    for label, row in rows.items():
        writer.writerow([label, row.start, row.end, *(column.value(row) for column in shown)])
    return out.getvalue()


def points_of(rows: Iterable[Metrics]) -> tuple[Point, ...]:
    """Return the points of all robots, each once."""
    return tuple(dict.fromkeys(point for row in rows for point in row.points))


def contact_note(rows: Mapping[str, Metrics]) -> str:
    """Return the note about columns of contacts with the ground; empty without such columns."""
    return CONTACT_NOTE if any(row.fastest_slip is not None for row in rows.values()) else ''


def heads(rows: Mapping[str, Metrics]) -> list[tuple[str, str]]:
    """Return heads and units of the columns."""
    shown = columns(rows.values())
    return [('run', ''), ('window', '(s)'), *((c.head, f'({c.shown_unit})') for c in shown)]


def cells(rows: Mapping[str, Metrics]) -> list[list[str]]:
    """Return the cells of the runs, one text per column."""
    shown = columns(rows.values())
    return [
        [label, f'{row.start:g}-{row.end:g}', *map(partial(_cell, row), shown)]
        for label, row in rows.items()
    ]


def distance_text(row: Metrics) -> str:
    """Return the RMS error of the first point in words."""
    point, reached = next(iter(row.points.items()))
    return f'RMS error of {point.title} {_text(reached.rms, SMALL)} {point.small_unit}'


def _cell(row: Metrics, column: Column) -> str:
    value = column.value(row)
    # An infinite distance is that of a diverged run, an infinite time is no settling.
    return 'does not' if value == math.inf and column.unit == 's' else _text(value, column.factor)


def _text(value: float | None, factor: float) -> str:
    return '-' if value is None else number(value * factor)


def number(value: float) -> str:
    """Return a number with five significant digits, with an exponent only if necessary."""
    if value != 0.0 and not 1.0e-4 <= abs(value) < 1.0e7:
        return f'{value:.{_DIGITS - 1}e}'
    text = np.format_float_positional(value, _DIGITS, unique=False, fractional=False, trim='k')
    return text.rstrip('.')
