# SPDX-License-Identifier: Apache-2.0
"""Runs next to each other: as text to read, as Markdown and as CSV to compute with."""

from __future__ import annotations

from collections.abc import Mapping
import csv
from dataclasses import asdict
import io

import numpy as np

from masmc_ros.report.metrics import Metrics

_HEADS = (
    ('run', ''),
    ('window', '(s)'),
    ('E RMS', '(mm)'),
    ('E max', '(mm)'),
    ('F RMS', '(mm)'),
    ('F max', '(mm)'),
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
    'torque_rms': 'N·m',
    'torque_variation': 'N·m/s',
    'estimate_norm': 'mixed',
}
_DIGITS = 5
_MILLIMETRES = 1.0e3


def text_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as an aligned table, errors in mm, and what they mean."""
    heads = [[name for name, _ in _HEADS], [unit for _, unit in _HEADS]]
    body = [_cells(label, each) for label, each in rows.items()]
    widths = [max(map(len, column)) for column in zip(*heads, *body, strict=True)]
    rule = ['-' * width for width in widths]
    lines = [
        # Names to the left, numbers to the right.
        '  '.join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip()
        for line in (*heads, rule, *body)
    ]
    return '\n'.join(lines) + (
        '\n\n'
        'E and F: distance of the end effector and of the platform point F from where they'
        ' should be.\n'
        'Torque variation: sum of the changes of all four commands, per second.\n'
    )


def markdown_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as a Markdown table, errors in mm."""
    lines = [
        [f'{name} {unit}'.rstrip() for name, unit in _HEADS],
        ['---'] + ['---:'] * (len(_HEADS) - 1),
        *(_cells(label.replace('|', r'\|'), each) for label, each in rows.items()),
    ]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def csv_table(rows: Mapping[str, Metrics]) -> str:
    """Return metrics by label as CSV: SI units, all digits, missing ones empty."""
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


def _cells(label: str, row: Metrics) -> list[str]:
    errors = (row.end_effector_rms, row.end_effector_max, row.platform_rms, row.platform_max)
    others = (row.torque_rms, row.torque_variation, row.estimate_norm)
    return [
        label,
        f'{row.begin:g}-{row.end:g}',
        *(number(error * _MILLIMETRES) for error in errors),
        *('-' if other is None else number(other) for other in others),
    ]
