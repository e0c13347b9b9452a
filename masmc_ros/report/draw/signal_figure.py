# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Signals of one run over time, and its paths in the plane."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.report.draw.style import (
    caption,
    draw_line,
    GREY,
    mathtext,
    new_figure,
    PAGE,
    time_axis,
)
from masmc_ros.report.panels import Line, Panel
from matplotlib.figure import Figure
import numpy as np

_HEIGHT = 48.0
"""Height of a panel in mm."""

_CAPTION = 12.0
"""Height in mm of the axis of time and the caption."""

_INNER = 0.5, 99.5
"""Percentiles of the values that are drawn: the first ticks of a run may be far larger."""

_MARGIN = 0.15
"""Margin of the values, as a part of their range."""


def signal_figure(panels: Sequence[Panel], label: str) -> Figure:
    """Draw panels over time below each other; the caption of the first has the label."""
    figure = new_figure(PAGE, _CAPTION + _HEIGHT * len(panels))
    all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(all_axes, panels, strict=True):
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        drawn = [draw_line(axes, line, linewidth=0.9) for line in panel.lines]
        axes.set_ylabel(mathtext(panel.quantity))
        low, high = np.nanpercentile([line.y for line in panel.lines], _INNER)
        margin = _MARGIN * (high - low)
        if margin > 0.0:
            axes.set_ylim(min(low, 0.0) - margin, max(high, 0.0) + margin)
        caption(figure, axes, label if panel is panels[0] else '', drawn)
    time_axis(all_axes[-1])
    figure.align_ylabels()
    return figure


def plane_figure(lines: Sequence[Line], label: str) -> Figure:
    """Draw paths in top view, in m and to scale."""
    figure = new_figure(PAGE, PAGE)
    axes = figure.subplots()
    drawn = [draw_line(axes, line, linewidth=1.0) for line in lines]
    axes.set_aspect('equal', 'datalim')
    axes.set_xlabel('$x$ (m)')
    axes.set_ylabel('$y$ (m)')
    caption(figure, axes, label, drawn)
    return figure
