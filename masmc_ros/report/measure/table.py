# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of runs: as text, as Markdown, and as CSV for computations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
import csv
from functools import partial
from html import escape
import io
import math
from operator import attrgetter
import sys
from textwrap import fill
from typing import NamedTuple

from masmc_ros.report.measure.metrics import declared, Metric, Metrics, Reached
from masmc_ros.report.measure.tracking import BAND, FLOOR, SMALL
from masmc_ros.result_text import aligned
from masmc_ros.robot.declaration import listed, Point, symbols_of, units_of
import numpy as np

_COUNTS = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight')
CONTACT_NOTE = (
    'Slip and normal force: of all wheels over the whole run, as often as plant/contact is logged.'
)
_UNKNOWN = Reached()
_ALL_DIGITS = 5
"""Significant digits of tables of text."""

DIGITS = 3
"""Significant digits of sentences, of tables of the page and of results in figures."""

_COMPLETE = 0.995
"""Part of the window with errors from which a run counts as complete."""


class Column(NamedTuple):
    """Metric as a column of tables: name and unit of files, head, and unit of texts."""

    name: str
    unit: str
    head: str
    shown_unit: str
    factor: float
    value: Callable[[Metrics], float | None]
    is_of_campaigns: bool
    is_shown: bool
    is_larger_better: bool


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


def shown_columns(rows: Iterable[Metrics]) -> list[Column]:
    """Return the columns of tables for people; files with numbers have all of them."""
    return [column for column in columns(rows) if column.is_shown]


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
    return Column(
        name, unit, head, shown, factor, value,
        metric.of_sums is not None, metric.is_shown, metric.is_larger_better,
    )  # fmt: skip


def text_table(rows: Mapping[str, Metrics], width: int = sys.maxsize) -> str:
    """Return metrics by label as an aligned table, errors in mm or mrad, and their meaning."""
    top, body = heads(rows), cells(rows)
    table = aligned([*zip(*top, strict=True), *body], (0,), rule=2, width=width)
    return '\n'.join([*table, '', *(fill(note, width) for note in notes(rows))]) + '\n'


def notes(rows: Mapping[str, Metrics]) -> list[str]:
    """Return the meaning of the columns, a text for each kind."""
    points = points_of(rows.values())
    units = ' or '.join(f'm{unit}' for unit in units_of(points))
    count = max(row.joints for row in rows.values())
    commands = _COUNTS[count] if count < len(_COUNTS) else str(count)
    texts = (
        distances_note(points),
        f'Settles: time after which it stays below {BAND:.0%} of the first distance, or'
        f' {FLOOR * SMALL:g} {units} if that is more.',
        f'Torque variation: sum of the changes of all {commands} commands, per second.',
        contact_note(rows),
    )
    remarks = (f'{label}: {text}' for label, row in rows.items() for text in remarks_of(row))
    return [*(text for text in texts if text), *remarks]


def remarks_of(row: Metrics) -> list[str]:
    """Return sentences about a run whose metrics do not stand for all of its window or log."""
    span, window = row.errors, f'{row.start:g}-{row.end:g} s'
    if span is None or span.share > _COMPLETE:
        return list(row.notes)
    if span.first is None:
        return [f'no errors in the window {window}.', *row.notes]
    return [
        f'errors from t = {span.first:.3f} s to {span.last:.3f} s, for {span.share:.0%} of the'
        f' window {window}; distances are those of this part, torques those of all commands in'
        ' the window.',
        *row.notes,
    ]


def distances_note(points: Sequence[Point]) -> str:
    """Return the meaning of the errors of points: distances and the axes they are in, angles."""
    kinds: dict[str, list[Point]] = {}
    for point in points:
        ending = f' in {listed("xyz"[:point.size])}' if point.is_place else ''
        ending = ', by its sine as in laws' if point.is_rotation else ending
        kinds.setdefault(ending, []).append(point)
    return ' '.join(
        f'{symbols_of(alike)}: {"angle" if alike[0].is_rotation else "distance"} '
        f'{listed([_owner(point) for point in alike])} from the reference{ending}.'
        for ending, alike in kinds.items()
    )


def _owner(point: Point) -> str:
    return f'of the {point.title.removeprefix("the ")}'


def markdown_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a Markdown table, errors in mm or mrad."""
    top = [f'{name} {unit}'.rstrip() for name, unit in heads(rows)]
    body = ([label.replace('|', r'\|'), *row] for label, *row in cells(rows))
    lines = [top, ['---'] + ['---:'] * (len(top) - 1), *body]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def html_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a table of HTML for notebooks, with the meaning below it."""
    top = [' '.join(part for part in head if part) for head in heads(rows)]
    head = ''.join(f'<th>{escape(text)}</th>' for text in top)
    body = ''.join(
        f'<tr><th>{escape(label)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in row)}</tr>'
        for label, *row in cells(rows)
    )
    remarks = ' '.join(notes(rows))
    return (
        f'<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        f'<p>{escape(remarks)}</p>'
    )


def csv_table(rows: Mapping[str, Metrics]) -> str:
    """
    Return metrics by label as CSV: SI units, all digits, missing ones empty.

    The settling time is `inf` if the distance does not settle.
    """
    units, records = _records(rows)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    top = (f'{name} ({unit})' if unit else name for name, unit in units.items())
    writer.writerow(['run', *top])
    writer.writerows([label, *values] for label, values in records.items())
    return out.getvalue()


def json_table(rows: Mapping[str, Metrics]) -> dict[str, object]:
    """Return metrics by label for JSON, with the columns of the CSV table and their units."""
    units, records = _records(rows)
    runs = [
        {'run': label, **dict(zip(units, values, strict=True))}
        for label, values in records.items()
    ]
    return {'units': units, 'runs': runs}


def _records(rows: Mapping[str, Metrics]) -> tuple[dict[str, str], dict[str, list[object]]]:
    """Return names and SI units of the columns of files, and the values of each run by label."""
    shown = columns(rows.values())
    units = {'begin': 's', 'end': 's', **{column.name: column.unit for column in shown}}
    units |= {'first_error': 's', 'last_error': 's', 'error_share': '1', 'notes': ''}
    return units, {
        label: [
            row.start,
            row.end,
            *(column.value(row) for column in shown),
            *(row.errors or (None, None, None)),
            ' '.join(row.notes),
        ]
        for label, row in rows.items()
    }


def points_of(rows: Iterable[Metrics]) -> tuple[Point, ...]:
    """Return the points of all robots, each once."""
    return tuple(dict.fromkeys(point for row in rows for point in row.points))


def contact_note(rows: Mapping[str, Metrics]) -> str:
    """Return the note about columns of contacts with the ground; empty without such columns."""
    return CONTACT_NOTE if any(row.fastest_slip is not None for row in rows.values()) else ''


def heads(rows: Mapping[str, Metrics]) -> list[tuple[str, str]]:
    """Return heads and units of the columns."""
    shown = shown_columns(rows.values())
    return [('run', ''), ('window', '(s)'), *((c.head, f'({c.shown_unit})') for c in shown)]


def cells(rows: Mapping[str, Metrics]) -> list[list[str]]:
    """Return the cells of the runs, one text per column."""
    shown = shown_columns(rows.values())
    return [
        [label, _window(row), *map(partial(_cell, row), shown)]
        for label, row in rows.items()
    ]


def _window(row: Metrics) -> str:
    """Return the window, with the part that has errors if this is not all of it."""
    window, span = f'{row.start:g}-{row.end:g}', row.errors
    # Without errors the cells of the distances are empty.
    if span is None or span.share > _COMPLETE or span.first is None or span.last is None:
        return window
    is_one_part = span.last - span.first <= span.share * (row.end - row.start)
    # Of a window with gaps, the first and the last time would hide them.
    part = f'{round(span.first, 2):g}-{round(span.last, 2):g}'
    return f'{window} (only {part if is_one_part else f"{span.share:.0%}"})'


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


def number(value: float, digits: int = _ALL_DIGITS) -> str:
    """Return a number with significant digits, with an exponent only if necessary."""
    if value != 0.0 and not 1.0e-4 <= abs(value) < 1.0e7:
        return f'{value:.{digits - 1}e}'
    text = np.format_float_positional(value, digits, unique=False, fractional=False, trim='k')
    return text.rstrip('.')
