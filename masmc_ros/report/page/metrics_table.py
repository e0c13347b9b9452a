# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of the page: differing parameters, metrics and final errors of the adaptation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import NamedTuple

from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.parameters import Difference, differences, LABELLED
from masmc_ros.report.measure.table import cells, Column, DIGITS, heads, number, shown_columns
from masmc_ros.report.panels import percent, plain_symbol

_MOST = 6
"""Maximum number of columns of differing parameters."""

_OWN = 2
"""Columns of `heads` before the metrics: run and window."""


class Cell(NamedTuple):
    """
    Cell of a table.

    Attributes
    ----------
    whole, fraction
        text up to the decimal point, and the remaining text; columns align between them.
    key
        value by which rows are sorted, a number or text; empty: after all others.
    title
        text with all digits for the pointer; empty without it.
    is_best
        whether no other row of the column has a better value.
    link
        identifier of the section of a run; for the first column.

    """

    whole: str
    fraction: str = ''
    key: str = ''
    title: str = ''
    is_best: bool = False
    link: str = ''


class PageTable(NamedTuple):
    """
    Table of the page.

    Attributes
    ----------
    heads
        Heads of the columns, the first one of the names of the runs.
    rows
        Cells of each run.

    """

    heads: list[str]
    rows: list[list[Cell]]

    @property
    def widths(self) -> list[int]:
        """Return the largest number of characters from the decimal point on, per column."""
        columns = zip(*self.rows, strict=True)
        return [max(len(cell.fraction) for cell in column) for column in columns]


def metrics_table(
    rows: Mapping[str, Metrics], runs: Sequence[Run], links: Sequence[str]
) -> PageTable:
    """
    Return the metrics of runs by name, with the parameters in which the runs differ.

    Parameters
    ----------
    rows, runs, links
        Metrics of the runs by name, the runs, and identifiers of their sections.

    """
    differing = shown_differences(runs)[:_MOST]
    metric_columns = shown_columns(rows.values())
    top = [f'{name} {unit}'.rstrip() for name, unit in heads(rows)]
    columns = [
        [Cell(name, key=name, link=link) for name, link in zip(rows, links, strict=True)],
        *(
            [_parameter_cell(value, text) for value, text in zip(d.values, d.texts, strict=True)]
            for d in differing
        ),
        [Cell(row[1], key=row[1]) for row in cells(rows)],
        *(_metric_cells(column, list(rows.values())) for column in metric_columns),
    ]
    names = [top[0], *(difference.name for difference in differing), *top[1:]]
    return PageTable(names, [list(row) for row in zip(*columns, strict=True)])


def shown_differences(runs: Sequence[Run]) -> list[Difference]:
    """Return the differing parameters that the names of laws do not contain."""
    return [entry for entry in differences(runs) if entry.name.split()[-1] not in LABELLED]


def hidden_differences(runs: Sequence[Run]) -> list[str]:
    """Return the names of the differing parameters for which the table has no room."""
    return [entry.name for entry in shown_differences(runs)[_MOST:]]


def adaptation_table(
    adapted: Sequence[tuple[str, Adaptation | None]], links: Sequence[str]
) -> PageTable:
    """
    Return the final errors of the estimates in percent, of the runs that have estimates.

    Parameters
    ----------
    adapted, links
        Names and adaptations of the runs, and identifiers of their sections.

    """
    members = [
        (Cell(label, key=label, link=link), entry)
        for (label, entry), link in zip(adapted, links, strict=True)
        if entry is not None
    ]
    quantities = list(dict.fromkeys(q for _, entry in members for q in entry.quantities))
    columns = []
    for quantity in quantities:
        errors = [
            float(entry.final_errors[entry.quantities.index(quantity)])
            if quantity in entry.quantities else math.nan
            for _, entry in members
        ]  # fmt: skip
        best = min((abs(error) for error in errors if math.isfinite(error)), default=math.nan)
        columns.append([
            _number_cell(e, percent(e).removesuffix(' %'), is_best=_is_best(abs(e), best, errors))
            for e in errors
        ])
    names = [[name for name, _ in members], *columns]
    tops = ['run', *(f'{plain_symbol(q)} (%)' for q in quantities)]
    return PageTable(tops, [list(row) for row in zip(*names, strict=True)])


def section_of(place: int) -> str:
    """Return the identifier of the section of a run by its place from 1."""
    return f'run-{place}'


def _parameter_cell(value: object, text: str) -> Cell:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return _number_cell(float(value), text)
    return Cell(text, key='' if value is None else text)


def _metric_cells(column: Column, rows: Sequence[Metrics]) -> list[Cell]:
    """Return the cells of a metric; the best ones are marked."""
    values = [math.nan if (v := column.value(row)) is None else v for row in rows]
    finite = [value for value in values if math.isfinite(value)]
    choose = max if column.is_larger_better else min
    best = choose(finite, default=math.nan)
    made = []
    for value in values:
        if math.isnan(value):
            made.append(Cell('-'))
        elif math.isinf(value) and column.unit == 's':
            made.append(Cell('does not', key=str(value)))
        else:
            shown = value * column.factor
            title = f'{number(shown)} {column.shown_unit}'
            is_best = _is_best(value, best, values)
            made.append(_number_cell(value, number(shown, DIGITS), title, is_best=is_best))
    return made


def _is_best(value: float, best: float, values: Sequence[float]) -> bool:
    """Return True if a value is the best one of several that differ."""
    return value == best and len({abs(v) for v in values if not math.isnan(v)}) > 1


def _number_cell(value: float, text: str, title: str = '', *, is_best: bool = False) -> Cell:
    if math.isnan(value):
        return Cell('-')
    mantissa, exponent, power = text.partition('e')
    whole, point, fraction = mantissa.partition('.')
    return Cell(whole, f'{point}{fraction}{exponent}{power}', repr(value), title, is_best)
