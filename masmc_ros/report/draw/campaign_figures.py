# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of campaigns: maps over one or two axes, and metrics over drawn values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import AnyArray, Array, Flags
from masmc_ros.report.draw import style
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
import numpy as np

_HEIGHT = 66.0
_LABELS = 6
"""Largest number of labels of an axis, roughly."""
_COLUMNS = 3
_SHOWN = 20_000
_LARGEST = 1e100
"""Largest number in figures, of runs that almost diverged; scales of Matplotlib overflow later."""


class MapAxis(NamedTuple):
    """Axis of a map."""

    name: str
    values: tuple[object, ...]


def map_figure(axes: Sequence[MapAxis], values: Array, label: str) -> Figure:
    """
    Draw a metric over the first two axes of a grid.

    Parameters
    ----------
    axes
        Axes of the grid.
    values
        Metric at its points, an array with a dimension for each axis; NaN for lost points, which
        are grey. Of further axes the median is drawn.
    label
        Name and unit of the metric.

    """
    values = _drawable(values)
    further = tuple(range(2, values.ndim))
    if further:
        label = f'{label}, median over {", ".join(axis.name for axis in axes[2:])}'
        values = np.median(np.where(np.isnan(values), math.inf, values), axis=further)
        values = np.where(np.isfinite(values), values, np.nan)
    figure = style.new_figure(style.COLUMN, _HEIGHT)
    drawing = figure.add_subplot()
    _ticks(drawing, 'x', axes[0])
    if len(axes) == 1:
        drawing.plot(np.arange(len(values)), values, 'o-', color=style.BLUE, markersize=2.5)
        for k in np.flatnonzero(np.isnan(values)).tolist():
            drawing.axvspan(k - 0.5, k + 0.5, color=style.GREY, alpha=0.4, linewidth=0.0)
        drawing.set_ylabel(style.plain(label))
        if _spans_decades(values):
            drawing.set_yscale('log')
        return figure
    _ticks(drawing, 'y', axes[1])
    drawing.grid(False)
    drawing.set_facecolor(style.GREY)
    norm = LogNorm() if _spans_decades(values) else None
    image = drawing.imshow(
        np.ma.masked_invalid(values.T), origin='lower', aspect='auto', cmap='viridis', norm=norm
    )
    figure.colorbar(image, label=style.plain(label))
    return figure


def draws_figure(
    drawn: Mapping[str, AnyArray], values: Array, lost: Flags, label: str
) -> Figure:
    """
    Draw a metric over the values of each draw; lost runs are marks at the upper edge.

    Of more than _SHOWN runs the first ones are drawn.
    """
    drawn = {name: numbers[:_SHOWN] for name, numbers in drawn.items()}
    values, lost = _drawable(values[:_SHOWN]), lost[:_SHOWN]
    columns = min(_COLUMNS, len(drawn))
    rows = math.ceil(len(drawn) / columns)
    figure = style.new_figure(style.PAGE if columns > 1 else style.COLUMN, _HEIGHT * 0.8 * rows)
    for place, (name, numbers) in enumerate(drawn.items(), start=1):
        drawing = figure.add_subplot(rows, columns, place)
        drawing.plot(
            numbers, values, '.', color=style.BLUE, markersize=1.5, alpha=0.5, rasterized=True
        )
        # At the upper edge of the axes whatever their scale.
        top = np.full(int(lost.sum()), 0.98)
        drawing.plot(
            numbers[lost], top, 'x', color=style.VERMILLION, markersize=3.0,
            transform=drawing.get_xaxis_transform(),
        )  # fmt: skip
        if _spans_decades(values):
            drawing.set_yscale('log')
        drawing.margins(x=0.03)
        drawing.set_xlabel(style.plain(name))
        drawing.set_ylabel(style.plain(label))
    return figure


def front_figure(
    candidates: Array, front: Array, chosen: Array, start: Array, first: str, second: str
) -> Figure:
    """
    Draw a Pareto front.

    Parameters
    ----------
    candidates, front
        Objectives (n, 2) of all candidates and of those on the front, infinite with lost runs.
    chosen, start
        Those (1, 2) of the chosen candidate and of the values of the scenario.
    first, second
        Names and units of the objectives.

    """
    candidates, front, chosen, start = map(_drawable, (candidates, front, chosen, start))
    figure = style.new_figure(style.COLUMN, _HEIGHT)
    drawing = figure.add_subplot()
    drawing.plot(*candidates.T, '.', color=style.GREY, markersize=2.0, label='candidates')
    drawing.plot(*front.T, '.-', color=style.BLUE, markersize=3.5, label='front')
    drawing.plot(*chosen.T, 'o', color=style.VERMILLION, markersize=5.0, label='chosen')
    if np.isfinite(start).all():
        drawing.plot(*start.T, 's', color=style.BLACK, markersize=4.0, label='scenario')
    for values, scale in ((candidates[:, 0], 'xscale'), (candidates[:, 1], 'yscale')):
        if _spans_decades(values):
            drawing.set(**{scale: 'log'})
    drawing.margins(0.05)
    drawing.set_xlabel(style.plain(first))
    drawing.set_ylabel(style.plain(second))
    drawing.legend()
    return figure


def _ticks(drawing: Axes, direction: str, axis: MapAxis) -> None:
    """Label the places of the values of an axis, at most about _LABELS of them."""
    step = max(1, math.ceil(len(axis.values) / _LABELS))
    places = np.arange(0, len(axis.values), step)
    texts = [_text(axis.values[k]) for k in places.tolist()]
    drawing.set(**{
        f'{direction}ticks': places, f'{direction}ticklabels': texts,
        f'{direction}label': style.plain(axis.name),
        f'{direction}lim': (-0.5, len(axis.values) - 0.5),
    })  # fmt: skip


def _text(value: object) -> str:
    return f'{value:.4g}' if isinstance(value, float) else style.plain(str(value))


def _drawable(values: Array) -> Array:
    """Return values, NaN for those that no scale can show."""
    return np.where(np.abs(values) <= _LARGEST, values, np.nan)


def _spans_decades(values: Array) -> bool:
    """Return True if a logarithmic scale is better."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and finite.min() > 0.0 and finite.max() > 10.0 * finite.min())
