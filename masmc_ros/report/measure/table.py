# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs next to each other: as text to read, as Markdown and as CSV to compute with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
import csv
import io
import math

from masmc_ros.report.aligned import aligned
from masmc_ros.report.measure.metrics import Metrics, Reached
from masmc_ros.report.measure.settling import BAND, FLOOR
from masmc_ros.robot.declaration import listed, Point, symbols_of
import numpy as np

_COUNTS = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight')
_OTHERS = {'torque_rms': 'N·m', 'torque_variation': 'N·m/s', 'estimate_norm': 'mixed'}
"""Metrics of a whole run, with their units."""
_CONTACT = {'fastest_slip': 'm/s', 'least_normal_force': 'N'}
"""Metrics of runs with contacts with the ground."""
CONTACT_NOTE = (
    'Slip and normal force: of all wheels over the whole run, as often as plant/contact is logged.'
)
_UNKNOWN = Reached(None, None, None)
_DIGITS = 5
_SMALL = 1.0e3
"""Factor of errors in mm and mrad, and of slip in mm/s."""


def text_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as an aligned table, errors in mm or mrad, and what they mean."""
    points = points_of(rows.values())
    is_told = tells_contact(rows.values())
    columns = _heads(points, is_told)
    top = [[name for name, _ in columns], [unit for _, unit in columns]]
    body = [cells(label, each, points, contact=is_told) for label, each in rows.items()]
    symbols = symbols_of(points)
    units = ' or '.join(dict.fromkeys(point.small_unit for point in points))
    titles = listed([f'of the {point.title.removeprefix("the ")}' for point in points])
    count = max(each.joints for each in rows.values())
    commands = _COUNTS[count] if count < len(_COUNTS) else str(count)
    widths = [max(map(len, column)) for column in zip(*top, *body, strict=True)]
    rule = ['-' * width for width in widths]
    return '\n'.join(aligned([*top, rule, *body], left=(0,))) + (
        '\n\n'
        f'{symbols}: distance {titles} from where {"they" if len(points) > 1 else "it"}'
        ' should be.\n'
        f'Settles: when it comes to stay below {BAND:.0%} of the first distance, or'
        f' {FLOOR * _SMALL:g} {units} if that is more.\n'
        f'Torque variation: sum of the changes of all {commands} commands, per second.\n'
        + (CONTACT_NOTE + '\n' if is_told else '')
    )


def markdown_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a Markdown table, errors in mm or mrad."""
    points, is_told = points_of(rows.values()), tells_contact(rows.values())
    top = heads(points, contact=is_told)
    lines = [
        top,
        ['---'] + ['---:'] * (len(top) - 1),
        *(
            cells(label.replace('|', r'\|'), each, points, contact=is_told)
            for label, each in rows.items()
        ),
    ]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def csv_table(rows: Mapping[str, Metrics]) -> str:
    """
    Return metrics by label as CSV: SI units, all digits, missing ones empty.

    The settling time of what does not settle is `inf`.
    """
    points = points_of(rows.values())
    whole = {**_OTHERS, **(_CONTACT if tells_contact(rows.values()) else {})}
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    names = (
        ('begin', 's'),
        ('end', 's'),
        *((f'{point.key}_{what}', point.unit) for point in points for what in ('rms', 'max')),
        *((f'{point.key}_settling', 's') for point in points),
        *whole.items(),
    )
    writer.writerow(['run', *(f'{name} ({unit})' for name, unit in names)])
    for label, each in rows.items():
        reached = [each.points.get(point, _UNKNOWN) for point in points]
        errors = [error for one in reached for error in (one.rms, one.largest)]
        settling = [one.settling for one in reached]
        others = [getattr(each, name) for name in whole]
        writer.writerow([label, each.begin, each.end, *errors, *settling, *others])
    return out.getvalue()


def points_of(rows: Iterable[Metrics]) -> tuple[Point, ...]:
    """Return the points of all robots, each once."""
    return tuple(dict.fromkeys(point for row in rows for point in row.points))


def tells_contact(rows: Iterable[Metrics]) -> bool:
    """Return True if any run has contacts with the ground, which then have columns."""
    return any(row.fastest_slip is not None for row in rows)


def _heads(points: Sequence[Point], contact: bool) -> tuple[tuple[str, str], ...]:
    errors = (
        (f'{point.symbol} {what}', f'({point.small_unit})')
        for point in points
        for what in ('RMS', 'max')
    )
    return (
        ('run', ''),
        ('window', '(s)'),
        *errors,
        *((f'{point.symbol} settles', '(s)') for point in points),
        ('torque RMS', '(N·m)'),
        ('torque variation', '(N·m/s)'),
        ('estimate norm', '(mixed)'),
        *((('fastest slip', '(mm/s)'), ('least normal force', '(N)')) if contact else ()),
    )


def number(value: float) -> str:
    """Write a number with five significant digits, with an exponent only if it must be."""
    if value != 0.0 and not 1.0e-4 <= abs(value) < 1.0e7:
        return f'{value:.{_DIGITS - 1}e}'
    text = np.format_float_positional(value, _DIGITS, unique=False, fractional=False, trim='k')
    return text.rstrip('.')


def heads(points: Sequence[Point], *, contact: bool = False) -> list[str]:
    """Return what the columns of a table show, with units; with contacts if there are any."""
    return [f'{name} {unit}'.rstrip() for name, unit in _heads(points, contact)]


def cells(
    label: str, row: Metrics, points: Sequence[Point], *, contact: bool = False
) -> list[str]:
    """Return one run's line of a table, a text a column."""
    reached = [row.points.get(point, _UNKNOWN) for point in points]
    errors = [error for one in reached for error in (one.rms, one.largest)]
    settling = [one.settling for one in reached]
    others = [row.torque_rms, row.torque_variation, row.estimate_norm]
    if contact:
        slip = row.fastest_slip
        others += [None if slip is None else slip * _SMALL, row.least_normal_force]
    return [
        label,
        f'{row.begin:g}-{row.end:g}',
        *(_known(None if error is None else error * _SMALL) for error in errors),
        *('does not' if time == math.inf else _known(time) for time in settling),
        *map(_known, others),
    ]


def _known(value: float | None) -> str:
    return '-' if value is None else number(value)
