# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Runs next to each other: as text to read, as Markdown and as CSV to compute with."""

from __future__ import annotations

from collections.abc import Mapping
import csv
from dataclasses import asdict
import io
import math

from masmc_ros.report.metrics import Metrics
from masmc_ros.report.settling import BAND, FLOOR
import numpy as np

_HEADS = (
    ('run', ''),
    ('window', '(s)'),
    ('E RMS', '(mm)'),
    ('E max', '(mm)'),
    ('F RMS', '(mm)'),
    ('F max', '(mm)'),
    ('E settles', '(s)'),
    ('F settles', '(s)'),
    ('torque RMS', '(N·m)'),
    ('torque variation', '(N·m/s)'),
    ('estimate norm', '(mixed)'),
)
_UNITS = {
    'begin': 's',
    'end': 's',
    'end_effector_rms': 'm',
    'end_effector_max': 'm',
    'platform_rms': 'm',
    'platform_max': 'm',
    'end_effector_settling': 's',
    'platform_settling': 's',
    'torque_rms': 'N·m',
    'torque_variation': 'N·m/s',
    'estimate_norm': 'mixed',
}
_DIGITS = 5
_MILLIMETRES = 1.0e3


def text_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as an aligned table, errors in mm, and what they mean."""
    top = [[name for name, _ in _HEADS], [unit for _, unit in _HEADS]]
    body = [cells(label, each) for label, each in rows.items()]
    widths = [max(map(len, column)) for column in zip(*top, *body, strict=True)]
    rule = ['-' * width for width in widths]
    lines = [
        # Names to the left, numbers to the right.
        '  '.join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip()
        for line in (*top, rule, *body)
    ]
    return '\n'.join(lines) + (
        '\n\n'
        'E and F: distance of the end effector and of the platform point F from where they'
        ' should be.\n'
        f'Settles: when it comes to stay below {BAND:.0%} of the first distance, or'
        f' {FLOOR * _MILLIMETRES:g} mm if that is more.\n'
        'Torque variation: sum of the changes of all four commands, per second.\n'
    )


def markdown_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a Markdown table, errors in mm."""
    lines = [
        heads(),
        ['---'] + ['---:'] * (len(_HEADS) - 1),
        *(cells(label.replace('|', r'\|'), each) for label, each in rows.items()),
    ]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def csv_table(rows: Mapping[str, Metrics]) -> str:
    """
    Return metrics by label as CSV: SI units, all digits, missing ones empty.

    The settling time of what does not settle is `inf`.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    writer.writerow(['run', *(f'{name} ({unit})' for name, unit in _UNITS.items())])
    for label, each in rows.items():
        values = asdict(each)
        writer.writerow([label, *(values[name] for name in _UNITS)])
    return out.getvalue()


def number(value: float) -> str:
    """Write a number with five significant digits, with an exponent only if it must be."""
    if value != 0.0 and not 1.0e-4 <= abs(value) < 1.0e7:
        return f'{value:.{_DIGITS - 1}e}'
    text = np.format_float_positional(value, _DIGITS, unique=False, fractional=False, trim='k')
    return text.rstrip('.')


def heads() -> list[str]:
    """Return what the columns of a table show, with units."""
    return [f'{name} {unit}'.rstrip() for name, unit in _HEADS]


def cells(label: str, row: Metrics) -> list[str]:
    """Return one run's line of a table, a text a column."""
    errors = (row.end_effector_rms, row.end_effector_max, row.platform_rms, row.platform_max)
    settling = (row.end_effector_settling, row.platform_settling)
    others = (row.torque_rms, row.torque_variation, row.estimate_norm)
    return [
        label,
        f'{row.begin:g}-{row.end:g}',
        *(_known(None if error is None else error * _MILLIMETRES) for error in errors),
        *('does not' if time == math.inf else _known(time) for time in settling),
        *map(_known, others),
    ]


def _known(value: float | None) -> str:
    return '-' if value is None else number(value)
