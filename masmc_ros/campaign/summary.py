# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Summary of a campaign: percentiles of the metrics, rank correlations and lost runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import math
import sys
from textwrap import fill
from typing import Any

from masmc_ros.aliases import AnyArray, Array
from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.runs import metric_columns, missing_columns
from masmc_ros.errors import InputError, suggestion
from masmc_ros.params.text import yaml_text
from masmc_ros.report.measure.table import Column, number
from masmc_ros.result_text import aligned
import numpy as np
from numpy.typing import NDArray

Columns = Mapping[str, NDArray[Any]]

_PERCENTILES = (5, 50, 95, 100)

_AXIS_VALUES = 10
"""Number of values of an axis that are printed."""

_SHOWN = 5
"""Number of lost runs that are printed; the dataset has all."""


def metric_named(campaign: Campaign, name: str, option: str = '--metric') -> Column:
    """
    Return the metric of a name; an empty name is the first metric.

    Raises InputError for an unknown name; its message starts with the name of the `option`.
    """
    known = {column.name: column for column in metric_columns(campaign.mechanism)}
    name = name or next(iter(known))
    if name in (column.name for column in missing_columns(campaign.mechanism)):
        raise InputError(
            f"{option}: '{name}' is not computed in campaigns; expected {', '.join(known)}"
        )
    if name not in known:
        raise InputError(f"{option}: '{name}' is unknown; {suggestion(name, known)}")
    return known[name]


def grid_lines(campaign: Campaign) -> list[str]:
    """Return a line with the values of each axis, and the number of runs; none without axes."""
    if not campaign.axes:
        return []
    axes = []
    for name, values in campaign.axes:
        texts = [yaml_text(value) for value in values]
        if len(texts) > _AXIS_VALUES:
            texts = [*texts[:_AXIS_VALUES - 2], '...', texts[-1]]
        axes.append(f'{name}: {", ".join(texts)}')
    sizes = ' x '.join(str(len(values)) for _, values in campaign.axes)
    return [*axes, f'grid: {sizes}, {campaign.total} runs']


def text(campaign: Campaign, columns: Columns, metric: Column, width: int = sys.maxsize) -> str:
    """
    Return the summary of a campaign for a terminal.

    Parameters
    ----------
    campaign
        Campaign.
    columns
        Columns of all rows by name.
    metric
        Metric of the best point of the axes, and of the correlations.
    width
        Width of lines in characters.

    """
    lost = np.flatnonzero(columns['lost'])
    lines = [f'{campaign.total} runs, {len(lost)} of them diverged', '']
    lines += _percentiles(campaign, columns, width)
    if missing := missing_columns(campaign.mechanism):
        lines += ['', f'not computed in campaigns: {", ".join(c.head for c in missing)}']
    if campaign.axes:
        lines += ['', *_best(campaign, columns, metric)]
    if campaign.draws and campaign.repeats > 2:
        lines += ['', *_correlations(campaign, columns, metric, width)]
    if len(lost):
        lines += ['', 'diverged runs, each with the command that repeats it:']
        for run in lost[:_SHOWN].tolist():
            command = campaign.command(next(campaign.runs(run, 1)))
            lines.append(f'run {run}, t = {columns["lost_at"][run]:g} s: {command}')
        if len(lost) > _SHOWN:
            lines.append(f'... and {len(lost) - _SHOWN} more, column lost of the dataset')
    return '\n'.join(lines) + '\n'


def summary(campaign: Campaign, columns: Columns, metric: Column) -> dict[str, Any]:
    """
    Return the summary of a campaign for JSON, in SI units.

    The arguments are those of `text`. All diverged runs are listed.
    """
    lost = np.flatnonzero(columns['lost']).tolist()
    point, correlations = None, None
    if campaign.axes:
        values, least = _best_point(campaign, columns, metric)
        point = None if values is None else {'values': values, metric.name: least}
    if campaign.draws and campaign.repeats > 2:
        correlations = _correlation_by_draw(campaign, columns, metric)
    return {
        'metric': {'name': metric.name, 'unit': metric.unit},
        'runs': campaign.total,
        'metrics': [
            {
                'name': column.name,
                'unit': column.unit,
                'percentiles': dict(zip(_PERCENTILES, percentiles, strict=True)),
            }
            for column, percentiles in _percentiles_of(campaign, columns)
        ],
        'best': point,
        'rank_correlations': correlations,
        'diverged': [
            {
                'run': run,
                'time': columns['lost_at'][run],
                'command': campaign.command(next(campaign.runs(run, 1))),
            }
            for run in lost
        ],
    }


def label(column: Column) -> str:
    """Return the heading of a metric with its unit."""
    return f'{column.head} ({column.shown_unit})'


def values_by_point(campaign: Campaign, values: Array) -> Array:
    """
    Return the median of a metric at each point of the grid, (values of each axis).

    `values` (runs) are those of all runs. A point has NaN if half or more of its runs diverged.
    """
    shape = tuple(len(axis.values) for axis in campaign.axes)
    by_point = values.reshape(*shape, campaign.repeats)
    known = np.isfinite(by_point)
    # With half or more of the runs lost, the median is infinite.
    filled = np.where(known, by_point, math.inf)
    medians: Array = np.median(filled, axis=-1)
    return np.where(np.isfinite(medians), medians, np.nan)


def _percentiles(campaign: Campaign, columns: Columns, width: int) -> list[str]:
    head = ['', *(f'{p} %' if p < 100 else 'largest' for p in _PERCENTILES)]
    body = []
    for column, percentiles in _percentiles_of(campaign, columns):
        if not column.is_shown:
            continue
        shown = (value * column.factor for value in percentiles)
        cells = (number(v) if math.isfinite(v) else 'does not' for v in shown)
        body.append([label(column), *cells])
    return aligned([head, *body], (0,), rule=1, width=width) if body else []


def _percentiles_of(
    campaign: Campaign, columns: Columns
) -> Iterator[tuple[Column, list[float]]]:
    """Yield the metrics that have values, with their percentiles in SI units."""
    for column in metric_columns(campaign.mechanism):
        values = columns[column.name]
        known = values[~np.isnan(values)]
        if len(known):
            # `nearest` selects an observed value: interpolation with an infinite one is NaN.
            yield column, np.percentile(known, _PERCENTILES, method='nearest').tolist()


def _best(campaign: Campaign, columns: Columns, metric: Column) -> list[str]:
    values, least = _best_point(campaign, columns, metric)
    if values is None:
        return ['no point of the grid has finite metrics in most of its runs']
    point = ', '.join(f'{name} = {_shown(value)}' for name, value in values.items())
    return [f'smallest {label(metric)}: {number(least * metric.factor)} at {point}']


def _best_point(
    campaign: Campaign, columns: Columns, metric: Column
) -> tuple[dict[str, Any] | None, float]:
    """Return the point of the grid with the smallest metric, None without one; and its metric."""
    medians = values_by_point(campaign, columns[metric.name])
    if not np.isfinite(medians).any():
        return None, math.nan
    place = np.unravel_index(int(np.nanargmin(medians)), medians.shape)
    values = {
        axis.name: axis.values[int(i)] for axis, i in zip(campaign.axes, place, strict=True)
    }
    return values, float(medians[place])


def _correlations(
    campaign: Campaign, columns: Columns, metric: Column, width: int
) -> list[str]:
    """Return Spearman's rank correlation of each draw with a metric, by its size."""
    correlations = _correlation_by_draw(campaign, columns, metric)
    if correlations is None:
        return []
    strongest_first = sorted(correlations, key=lambda name: -abs(correlations[name]))
    body = [[name, f'{correlations[name]:.2f}'] for name in strongest_first]
    head = fill(f'rank correlation with {metric.head}, -1 to 1:', width)
    return [head, *aligned(body, (0,), width=width)]


def _correlation_by_draw(
    campaign: Campaign, columns: Columns, metric: Column
) -> dict[str, float] | None:
    """Return the coefficients by the name of the draw; None with fewer than 3 finite metrics."""
    values = columns[metric.name]
    known = np.isfinite(values)
    if known.sum() < 3:
        return None
    return {
        draw.name: _rank_correlation(columns[draw.name][known], values[known])
        for draw in campaign.draws
    }


def _rank_correlation(first: AnyArray, second: Array) -> float:
    """Return Spearman's coefficient; 0 if one of them is constant."""
    ranks = np.array([_ranks(first), _ranks(second)])
    return float(np.corrcoef(ranks)[0, 1]) if np.ptp(ranks, axis=1).all() else 0.0


def _ranks(values: AnyArray) -> Array:
    """Return the ranks, of equal values their mean."""
    _, group, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks: Array = (np.cumsum(counts) - (counts - 1) / 2.0)[group]
    return ranks


def _shown(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
