# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figure of a preview: speeds, torques and distances to the ends of ranges along a path."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.report.draw.style import GREY, new_figure, PAGE, paper_style, time_axis
from masmc_ros.report.measure.path_preview import Preview
from matplotlib.figure import Figure
import numpy as np

_HEIGHT = 42.0
"""Height of a panel in mm."""

_LEGEND = 12.0
"""Height of the legend in mm."""

_COLUMNS = 4
"""Names in a row of the legend."""

_MOST_POINTS = 4000
"""Largest number of points of a line."""


def preview_figure(seen: Preview) -> Figure:
    """Return the figure of a preview, with a line for each joint."""
    joints = seen.mechanism.joints
    torque, torque_unit = _shared(seen.torque, seen.torque_share, seen.torque_limits, 'N·m, N')
    speed, speed_unit = _shared(
        np.abs(seen.velocity), seen.speed_share, np.array(seen.mechanism.speed_limits), 'SI units'
    )
    panels = [
        (f'speed ({speed_unit})', speed, speed_unit == _SHARE),
        (f'torque ({torque_unit})', torque, torque_unit == _SHARE),
    ]
    margin = seen.range_margin
    if np.isfinite(margin).any():
        panels.append(('distance to the end\nof the range (rad, m)', margin, False))
    rows = -(-len(joints) // _COLUMNS)
    with paper_style():
        figure = new_figure(PAGE, _HEIGHT * len(panels) + _LEGEND * rows / 2.0)
        heights = (_LEGEND * rows / 2.0, *([_HEIGHT] * len(panels)))
        names, *drawings = figure.subplots(1 + len(panels), 1, height_ratios=heights)
        names.set_axis_off()
        step = max(1, len(seen.times) // _MOST_POINTS)
        for axes, (label, values, is_share) in zip(drawings, panels, strict=True):
            for k, joint in enumerate(joints):
                if np.isfinite(values[:, k]).all():
                    axes.plot(
                        seen.times[::step], values[::step, k], label=joint.label,
                        color=f'C{k % 10}', linestyle='-' if k < 10 else '--',
                    )  # fmt: skip
            if is_share:
                axes.axhline(1.0, color=GREY, linewidth=0.8)
            axes.set_ylabel(label)
            axes.set_ylim(bottom=min(0.0, *axes.get_ylim()))
            time_axis(axes)
            axes.label_outer()
        handles, labels = drawings[0].get_legend_handles_labels()
        names.legend(handles, labels, loc='center', ncols=_COLUMNS)
    return figure


_SHARE = 'part of the limit'


def _shared(values: Array, share: Array, limits: Array, unit: str) -> tuple[Array, str]:
    """Return parts of the limits and their unit; the values if no joint has a limit."""
    if np.isfinite(limits).any():
        return np.where(np.isfinite(limits), share, np.nan), _SHARE
    return values, unit
