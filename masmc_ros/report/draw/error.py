# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tracking errors over time: the paper's Figures 4, 5, 7 and 8."""

from __future__ import annotations

from masmc_ros.report.draw.style import (
    caption,
    COLUMN,
    draw_line,
    GREY,
    new_figure,
    time_axis,
)
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.tracking import SMALL, Tracking
from masmc_ros.report.panels import error_panel
from masmc_ros.robot.declaration import Point
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

_HEIGHT = 78.0
_MARGIN = 0.08
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
    figure = new_figure(COLUMN, _HEIGHT)
    upper, lower = figure.subplots(2, 1)
    # Letters for the axes of a path, numbers for joints.
    axis_names = [str(1 + i) for i in range(point.size)]
    if point.is_place:
        axis_names = [f'{axis}<sub>{point.symbol}</sub>' for axis in 'xyz'[:point.size]]
    panel = error_panel(tracked, point, [f'<i>e<sub>{name}</sub></i>' for name in axis_names])
    for axes in (upper, lower):
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        for line in panel.lines:
            draw_line(axes, line, linewidth=0.9)
        axes.set_ylabel(panel.quantity)
    _enlarge(lower, tracked, tracked.small_errors(point), reached)
    upper.axvspan(reached.start, reached.end, color=GREY, alpha=0.12, linewidth=0.0)
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
    time_axis(upper)
    upper.set_xlabel('')
    time_axis(lower)
    caption(figure, upper, label, upper.get_lines()[1:])
    figure.align_ylabels()
    return figure


def _enlarge(axes: Axes, tracked: Tracking, error: np.ndarray, reached: Metrics) -> None:
    """Limit the axes to the window and to the errors in it."""
    settled = error[(reached.start <= tracked.times) & (tracked.times < reached.end)]
    axes.set_xlim(reached.start, reached.end)
    low, high = float(np.nanmin(settled, initial=0.0)), float(np.nanmax(settled, initial=0.0))
    if np.isfinite(high - low) and high > low:
        margin = _MARGIN * (high - low)
        axes.set_ylim(low - margin, high + margin)
