# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of many runs over the parameters in which the runs differ."""

from __future__ import annotations

from collections.abc import Sequence
import math

from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.differences import differences
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.table import shown_columns
from masmc_ros.report.page.section import Section
from masmc_ros.report.panels import COLOURS


def trends(
    runs: Sequence[Run],
    names: Sequence[str],
    rows: Sequence[Metrics],
    sections: Sequence[Section],
) -> dict[str, object] | None:
    """
    Return the numbers of a plot of metrics over parameters; None without a numeric parameter.

    Parameters
    ----------
    runs, names, rows, sections
        Runs with their names, metrics and sections of the page.

    """
    several = differences(runs)
    numbers = {entry.name: [_number(value) for value in entry.values] for entry in several}
    numeric = {
        name: values
        for name, values in numbers.items()
        if len({value for value in values if value is not None}) > 1
    }
    if not numeric:
        return None
    columns = shown_columns(rows)
    return {
        'runs': list(names),
        'links': [section.id for section in sections],
        'parameters': [{'name': name, 'values': values} for name, values in numeric.items()],
        'groups': [{'name': entry.name, 'texts': entry.texts} for entry in several],
        'colours': COLOURS,
        'metrics': [
            {
                'name': f'{column.head} ({column.shown_unit})',
                'values': [_finite(column.value(row), column.factor) for row in rows],
            }
            for column in columns
        ],
    }


def _number(value: object) -> float | None:
    """Return a number, also of a list of equal ones; None for other values."""
    if isinstance(value, list | tuple) and value and all(entry == value[0] for entry in value):
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, float | int):
        return None
    return _finite(value)


def _finite(value: float | None, factor: float = 1.0) -> float | None:
    """Return a value times a factor; None if it is not finite."""
    return None if value is None or not math.isfinite(value) else value * factor
