# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""All runs in one figure: distances from the reference, and torques."""

from __future__ import annotations

from collections.abc import Sequence
import math

from masmc_ros.report.draw.style import draw_line, mathtext, new_figure, PAGE, time_axis
from masmc_ros.report.panels import comparison_panels, logarithmic_range, Panel
from matplotlib.figure import Figure

_PANELS = 100.0
_LEGEND_ROW = 4.5
_LEGEND_WIDTH = 120
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
    rows = math.ceil(len(of_runs) / max(1, _LEGEND_WIDTH // longest))
    columns = math.ceil(len(of_runs) / rows)
    above = _LEGEND_ROW * rows
    panels = comparison_panels(of_runs)
    count = math.ceil(len(panels) / 2)
    height = _PANELS / 2
    figure = new_figure(PAGE, above + count * height)
    layout = figure.add_gridspec(1 + count, 2, height_ratios=(above, *([height] * count)))
    drawn = [
        figure.add_subplot(layout[1 + number // 2, number % 2]) for number in range(len(panels))
    ]
    # Chattering lines cover all others, therefore they are drawn first.
    indices = range(len(of_runs))
    order = sorted(indices, key=lambda i: -variations[i])
    for depth, i in enumerate(order):
        for axes, panel in zip(drawn, panels, strict=True):
            draw_line(axes, panel.lines[i], linewidth=0.8, zorder=2.0 + depth / len(order))
    for axes, panel in zip(drawn, panels, strict=True):
        axes.set_title(panel.title)
        axes.set_ylabel(mathtext(panel.quantity))
        ends = logarithmic_range(panel)
        if ends is not None:
            axes.set_yscale('log')
            axes.set_ylim(ends)
        time_axis(axes)
    lines = [drawn[0].get_lines()[order.index(i)] for i in indices]
    legend = figure.add_subplot(layout[0, :])
    legend.set_axis_off()
    legend.legend(handles=lines, loc='center', ncols=columns)
    figure.align_ylabels()
    return figure
