# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation of runs: a small panel for each base inertial parameter."""

from __future__ import annotations

from collections.abc import Sequence
import math

from masmc_ros.report.draw.style import draw_line, GREY, mathtext, new_figure, PAGE, time_axis
from masmc_ros.report.panels import Panel
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

_COLUMNS = 4
_HEIGHT = 36.0
"""Height of a row of panels in mm."""
_LEGEND_ROW = 4.5
_LEGEND_WIDTH = 110
"""Characters that fit into a row of the legend, with its lines."""
_LINE = 8
"""Width of a line of the legend in characters."""
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
    columns = max(1, _LEGEND_WIDTH // longest)
    above = _LEGEND_ROW * math.ceil(len(labels) / columns)
    count = math.ceil(len(panels) / _COLUMNS)
    figure = new_figure(PAGE, above + _HEIGHT * count + _LEGEND_ROW)
    heights = (max(above, 0.1), *([_HEIGHT] * count))
    layout = figure.add_gridspec(1 + count, _COLUMNS, height_ratios=heights)
    handles: dict[str, Line2D] = {}
    for number, panel in enumerate(panels):
        axes = figure.add_subplot(layout[1 + number // _COLUMNS, number % _COLUMNS])
        if panel.level is not None:
            axes.axhline(panel.level, color=GREY, linewidth=0.8)
        for line in panel.lines:
            handles[line.name] = draw_line(axes, line, linewidth=0.9)
        axes.set_title(_title(panel), fontsize=6.5)
        axes.margins(y=0.12)
        if number % _COLUMNS == 0:
            axes.set_ylabel(mathtext(panel.quantity))
        time_axis(axes, _TICKS)
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
