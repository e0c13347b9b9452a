# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Figures of runs over time: signals, tracking errors, comparisons and adaptation.

Tracking errors are the paper's Figures 4, 5, 7 and 8.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

from masmc_ros.report.draw import style
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.tracking import SMALL, Tracking
from masmc_ros.report.panels import comparison_panels, error_panel, Line, logarithmic_range, Panel
from masmc_ros.robot.declaration import Point
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

_SIGNAL_HEIGHT = 48.0
"""Height of a panel in mm."""

_CAPTION = 12.0
"""Height in mm of the axis of time and the caption."""

_INNER = 0.5, 99.5
"""Percentiles of the values that are drawn: the first ticks of a run may be far larger."""

_SIGNAL_MARGIN = 0.15
"""Margin of the values, as a part of their range."""


def signal_figure(panels: Sequence[Panel], label: str) -> Figure:
    """Draw panels over time below each other; the caption of the first has the label."""
    figure = style.new_figure(style.PAGE, _CAPTION + _SIGNAL_HEIGHT * len(panels))
    all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(all_axes, panels, strict=True):
        axes.axhline(0.0, color=style.GREY, linewidth=0.6)
        drawn = [style.draw_line(axes, line, linewidth=0.9) for line in panel.lines]
        axes.set_ylabel(style.mathtext(panel.quantity))
        low, high = np.nanpercentile([line.y for line in panel.lines], _INNER)
        margin = _SIGNAL_MARGIN * (high - low)
        if margin > 0.0:
            axes.set_ylim(min(low, 0.0) - margin, max(high, 0.0) + margin)
        style.caption(figure, axes, label if panel is panels[0] else '', drawn)
    style.time_axis(all_axes[-1])
    figure.align_ylabels()
    return figure


def plane_figure(lines: Sequence[Line], label: str) -> Figure:
    """Draw paths in top view, in m and to scale."""
    figure = style.new_figure(style.PAGE, style.PAGE)
    axes = figure.subplots()
    drawn = [style.draw_line(axes, line, linewidth=1.0) for line in lines]
    axes.set_aspect('equal', 'datalim')
    axes.set_xlabel('$x$ (m)')
    axes.set_ylabel('$y$ (m)')
    style.caption(figure, axes, label, drawn)
    return figure


_ERROR_HEIGHT = 78.0
_ERROR_MARGIN = 0.08
"""Margin of the lower panel, as a part of the range of the errors in the window."""


def error_figure(
    tracked: Tracking, reached: Metrics, label: str, point: Point
) -> Figure | None:
    """
    Draw the errors of a point over the whole run and, enlarged, within the window.

    Returns None without errors in the window.
    """
    rms = reached.points[point].rms
    if rms is None:
        return None
    figure = style.new_figure(style.COLUMN, _ERROR_HEIGHT)
    upper, lower = figure.subplots(2, 1)
    # Letters for the axes of a path, numbers for joints.
    axis_names = [str(1 + i) for i in range(point.size)]
    if point.is_place:
        axis_names = [f'{axis}<sub>{point.symbol}</sub>' for axis in 'xyz'[:point.size]]
    panel = error_panel(tracked, point, [f'<i>e<sub>{name}</sub></i>' for name in axis_names])
    for axes in (upper, lower):
        axes.axhline(0.0, color=style.GREY, linewidth=0.6)
        for line in panel.lines:
            style.draw_line(axes, line, linewidth=0.9)
        axes.set_ylabel(panel.quantity)
    _enlarge(lower, tracked, tracked.small_errors(point), reached)
    upper.axvspan(reached.start, reached.end, color=style.GREY, alpha=0.12, linewidth=0.0)
    lower.text(
        1.0,
        1.02,
        rf'enlarged; RMS $|e_{point.symbol}|$ = {rms * SMALL:.3g} {point.small_unit} over'
        f' {reached.start:g}–{reached.end:g} s',
        transform=lower.transAxes,
        fontsize=7.0,
        ha='right',
        va='bottom',
    )
    style.time_axis(upper)
    upper.set_xlabel('')
    style.time_axis(lower)
    style.caption(figure, upper, label, upper.get_lines()[1:])
    figure.align_ylabels()
    return figure


def _enlarge(axes: Axes, tracked: Tracking, error: np.ndarray, reached: Metrics) -> None:
    """Limit the axes to the window and to the errors in it."""
    settled = error[(reached.start <= tracked.times) & (tracked.times < reached.end)]
    axes.set_xlim(reached.start, reached.end)
    low, high = float(np.nanmin(settled, initial=0.0)), float(np.nanmax(settled, initial=0.0))
    if np.isfinite(high - low) and high > low:
        margin = _ERROR_MARGIN * (high - low)
        axes.set_ylim(low - margin, high + margin)


_PANELS = 100.0
_LEGEND_ROW = 4.5
_LABELS_OF_COMPARISON = 120
"""Characters that fit into a row of the legend, with its lines."""
_LINE = 8
"""Width of a line of the legend in characters."""


def comparison_figure(
    of_runs: Sequence[tuple[str, Sequence[Panel]]], variations: Sequence[float]
) -> Figure:
    """
    Draw the panels of a comparison in two columns.

    Parameters
    ----------
    of_runs
        Name and `distance_panels` of each run.
    variations
        Torque variation of each run.

    """
    longest = max(len(label) for label, _ in of_runs) + _LINE
    rows = math.ceil(len(of_runs) / max(1, _LABELS_OF_COMPARISON // longest))
    columns = math.ceil(len(of_runs) / rows)
    above = _LEGEND_ROW * rows
    panels = comparison_panels(of_runs)
    count = math.ceil(len(panels) / 2)
    height = _PANELS / 2
    figure = style.new_figure(style.PAGE, above + count * height)
    layout = figure.add_gridspec(1 + count, 2, height_ratios=(above, *([height] * count)))
    drawn = [
        figure.add_subplot(layout[1 + number // 2, number % 2]) for number in range(len(panels))
    ]
    # Chattering lines cover all others, therefore they are drawn first.
    indices = range(len(of_runs))
    order = sorted(indices, key=lambda i: -variations[i])
    for depth, i in enumerate(order):
        for axes, panel in zip(drawn, panels, strict=True):
            style.draw_line(axes, panel.lines[i], linewidth=0.8, zorder=2.0 + depth / len(order))
    for axes, panel in zip(drawn, panels, strict=True):
        axes.set_title(panel.title)
        axes.set_ylabel(style.mathtext(panel.quantity))
        ends = logarithmic_range(panel)
        if ends is not None:
            axes.set_yscale('log')
            axes.set_ylim(ends)
        style.time_axis(axes)
    lines = [drawn[0].get_lines()[order.index(i)] for i in indices]
    legend = figure.add_subplot(layout[0, :])
    legend.set_axis_off()
    legend.legend(handles=lines, loc='center', ncols=columns)
    figure.align_ylabels()
    return figure


_COLUMNS = 4
_PARAMETER_HEIGHT = 36.0
"""Height of a row of panels in mm."""
_LABELS_OF_ADAPTATION = 110
"""Characters that fit into a row of the legend, with its lines."""
_ERRORS = 3
"""Maximum number of final errors in the title of a panel."""
_TICKS = 4
"""Maximum number of intervals of an axis of time."""


def adaptation_figure(panels: Sequence[Panel], labels: Sequence[str] = ()) -> Figure | None:
    """
    Draw the ratios of the estimates to their values, with a line at 1 and the final errors.

    Parameters
    ----------
    panels
        Panels of `adaptation_panels`.
    labels
        Names of all runs, for the legend; without them there is no legend.

    Returns
    -------
        Figure; None without panels.

    """
    if not panels:
        return None
    longest = max((len(label) for label in labels), default=0) + _LINE
    columns = max(1, _LABELS_OF_ADAPTATION // longest)
    above = _LEGEND_ROW * math.ceil(len(labels) / columns)
    count = math.ceil(len(panels) / _COLUMNS)
    figure = style.new_figure(style.PAGE, above + _PARAMETER_HEIGHT * count + _LEGEND_ROW)
    heights = (max(above, 0.1), *([_PARAMETER_HEIGHT] * count))
    layout = figure.add_gridspec(1 + count, _COLUMNS, height_ratios=heights)
    handles: dict[str, Line2D] = {}
    for number, panel in enumerate(panels):
        axes = figure.add_subplot(layout[1 + number // _COLUMNS, number % _COLUMNS])
        if panel.level is not None:
            axes.axhline(panel.level, color=style.GREY, linewidth=0.8)
        for line in panel.lines:
            handles[line.name] = style.draw_line(axes, line, linewidth=0.9)
        axes.set_title(_title(panel), fontsize=6.5)
        axes.margins(y=0.12)
        if number % _COLUMNS == 0:
            axes.set_ylabel(style.mathtext(panel.quantity))
        style.time_axis(axes, _TICKS)
    if labels:
        legend = figure.add_subplot(layout[0, :])
        legend.set_axis_off()
        legend.legend(
            handles=list(handles.values()), loc='center', ncols=min(columns, len(handles))
        )
    figure.align_ylabels()
    return figure


def _title(panel: Panel) -> str:
    """Return the title of a panel, of few runs with their final errors in the legend's order."""
    if len(panel.lines) > _ERRORS:
        return panel.title
    return f'{panel.title}\nfinal {", ".join(line.result for line in panel.lines)}'
