# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""All runs in one figure: distances from the reference, and torques."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple

from masmc_ros.log.read.reader import Run
from masmc_ros.report.metrics import total_variation
from masmc_ros.report.style import line_styles, new_figure, PAGE, plain, time_axis
from masmc_ros.report.tracking import Tracking
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PANELS = 100.0
_LEGEND_ROW = 4.5
_LEGEND_WIDTH = 120
"""Letters that fit into a row of the legend, lines counted."""
_LINE = 8
"""Letters that a legend's line takes the room of."""
_MILLIMETRES = 1.0e3
_LOWEST = 2.0
"""Percentile of the values at which a logarithmic axis begins: zero crossings go below."""


class Compared(NamedTuple):
    """One run of a comparison."""

    label: str
    run: Run
    tracked: Tracking


def comparison_figure(compared: Sequence[Compared]) -> Figure:
    """
    Draw |e_E| and |e_F| and the norms of the wheels' and of the arm's torques over time.

    Where no run has torques, platform and arm have the rates that were commanded.
    """
    longest = max(len(each.label) for each in compared) + _LINE
    rows = math.ceil(len(compared) / max(1, _LEGEND_WIDTH // longest))
    columns = math.ceil(len(compared) / rows)
    above = _LEGEND_ROW * rows
    figure = new_figure(PAGE, above + _PANELS)
    layout = figure.add_gridspec(3, 2, height_ratios=(above, _PANELS / 2, _PANELS / 2))
    panels = [figure.add_subplot(layout[row, column]) for row in (1, 2) for column in (0, 1)]
    end_effector, platform, wheels, arm = panels
    styles = dict(enumerate(line_styles(len(compared))))
    # What chatters covers everything, so that it goes to the back.
    order = sorted(styles, key=lambda i: -total_variation(compared[i].run.torque))
    has_rates = all(each.run.commands_rates for each in compared)
    for depth, i in enumerate(order):
        _, run, tracked = compared[i]
        style = {**styles[i], 'zorder': 2.0 + depth / len(order)}
        error = tracked.error * _MILLIMETRES
        _draw(end_effector, tracked.times, error[:, :2], style)
        _draw(platform, tracked.times, error[:, 2:], style)
        if has_rates:
            _draw(wheels, run.cmd_vel_times - run.times[0], run.cmd_vel[:, 1:], style)
            _draw(arm, run.arm_rate_times - run.times[0], run.arm_rates, style)
        else:
            _draw(wheels, run.torque_times - run.times[0], run.torque[:, :2], style)
            _draw(arm, run.torque_times - run.times[0], run.torque[:, 2:], style)
    sizes, unit = ('wheel torques', 'arm torques'), r'$|\tau|$ (N·m)'
    if has_rates:
        sizes, unit = ('commanded yaw rate', 'commanded arm rates'), r'$|\omega|$ (rad/s)'
    titles = ('end effector', 'platform', *sizes)
    quantities = ('$|e_E|$ (mm)', '$|e_F|$ (mm)', unit, unit)
    for axes, title, quantity in zip(panels, titles, quantities, strict=True):
        axes.set_title(title)
        axes.set_ylabel(quantity)
        _scale(axes)
        time_axis(axes)
    lines = [end_effector.get_lines()[order.index(i)] for i in styles]
    _legend(figure.add_subplot(layout[0, :]), lines, [each.label for each in compared], columns)
    figure.align_ylabels()
    return figure


def _draw(axes: Axes, times: Floats, vectors: Floats, style: dict[str, Any]) -> None:
    """Draw the Euclidean norm of vectors (n, 2) over time."""
    axes.plot(times, np.linalg.norm(vectors, axis=1), linewidth=0.8, **style)


def _legend(axes: Axes, lines: Sequence[Line2D], labels: Sequence[str], columns: int) -> None:
    """Fill axes with a legend."""
    axes.set_axis_off()
    legend = axes.legend(lines, map(str, range(len(lines))), loc='center', ncols=columns)
    for text, label in zip(legend.get_texts(), labels, strict=True):
        # Set afterwards: matplotlib leaves out a label that begins with an underscore.
        text.set_text(plain(label))


def _scale(axes: Axes) -> None:
    """
    Make the axis logarithmic, from where the smallest line has its lowest values but a few.

    An axis without positive values stays linear.
    """
    lowest = []
    for line in axes.get_lines():
        values = np.asarray(line.get_ydata())
        values = values[np.isfinite(values) & (values > 0.0)]
        if len(values):
            lowest.append(float(np.percentile(values, _LOWEST)))
    if lowest:
        axes.set_yscale('log')
        axes.set_ylim(bottom=0.7 * min(lowest))
