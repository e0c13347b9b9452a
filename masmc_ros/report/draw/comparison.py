# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""All runs in one figure: distances from the reference, and torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
from typing import Any, NamedTuple

from masmc_ros.numerics.aliases import Array
from masmc_ros.report.draw.style import line_styles, new_figure, PAGE, plain, time_axis
from masmc_ros.report.measure.metrics import total_variation
from masmc_ros.report.measure.tracking import Compared
from masmc_ros.robot.declaration import Group
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

_PANELS = 100.0
_LEGEND_ROW = 4.5
_LEGEND_WIDTH = 120
"""Characters that fit into a row of the legend, with its lines."""
_LINE = 8
"""Width of a line of the legend in characters."""
_LOWEST = 2.0
"""Percentile of the values at the start of a logarithmic axis, above zero crossings."""


_Vectors = tuple[Array, Array]
"""Times and vectors (n, m)."""


class _Panel(NamedTuple):
    """One plot: title, quantity, and the vectors of a run, None if it has none."""

    title: str
    quantity: str
    vectors: Callable[[Compared], _Vectors | None]


def comparison_figure(compared: Sequence[Compared]) -> Figure:
    """
    Draw the distances of all points from their references, and the norms of the torques.

    The torques are those of each group of joints. If no run has torques, the commanded velocities
    are drawn.
    """
    longest = max(len(run.label) for run in compared) + _LINE
    rows = math.ceil(len(compared) / max(1, _LEGEND_WIDTH // longest))
    columns = math.ceil(len(compared) / rows)
    above = _LEGEND_ROW * rows
    panels = _panels(compared)
    count = math.ceil(len(panels) / 2)
    height = _PANELS / 2
    figure = new_figure(PAGE, above + count * height)
    layout = figure.add_gridspec(1 + count, 2, height_ratios=(above, *([height] * count)))
    drawn = [
        figure.add_subplot(layout[1 + number // 2, number % 2]) for number in range(len(panels))
    ]
    styles = dict(enumerate(line_styles(len(compared))))
    # Chattering lines cover all others, therefore they are drawn first.
    order = sorted(styles, key=lambda i: -total_variation(compared[i].run.torque.values))
    for depth, i in enumerate(order):
        style = {**styles[i], 'zorder': 2.0 + depth / len(order)}
        for axes, panel in zip(drawn, panels, strict=True):
            times, vectors = panel.vectors(compared[i]) or (np.zeros(0), np.zeros((0, 1)))
            _draw(axes, times, vectors, style)
    for axes, panel in zip(drawn, panels, strict=True):
        axes.set_title(panel.title)
        axes.set_ylabel(panel.quantity)
        _scale(axes)
        time_axis(axes)
    lines = [drawn[0].get_lines()[order.index(i)] for i in styles]
    _legend(figure.add_subplot(layout[0, :]), lines, [run.label for run in compared], columns)
    figure.align_ylabels()
    return figure


def _panels(compared: Sequence[Compared]) -> list[_Panel]:
    """Return the plots for the robots of all runs, each once."""
    kinds = tuple(dict.fromkeys(entry.run.mechanism for entry in compared))
    points = dict.fromkeys(point for kind in kinds for point in kind.points)
    panels = [
        _Panel(p.name, f'$|e_{p.symbol}|$ ({p.small_unit})', partial(Compared.errors, point=p))
        for p in points
    ]
    if not all(entry.run.commands_rates for entry in compared):
        groups = dict.fromkeys(group for kind in kinds for group in kind.groups)
        return panels + [
            _Panel(f'{group.name} torques', r'$|\tau|$ (N·m)', partial(_torques, group))
            for group in groups
        ]
    for kind in kinds:
        turns = tuple(i for i, velocity in enumerate(kind.twist) if velocity.unit == 'rad/s')
        chosen = turns or tuple(range(len(kind.twist)))
        names = ' and '.join(kind.twist[i].name for i in chosen)
        rates = r'$|\omega|$ (rad/s)'
        of_base = rates if turns else '$|v|$ (m/s)'
        panels += [
            _Panel(f'commanded {names}', of_base, partial(_base, chosen)),
            _Panel(f'commanded {kind.groups[-1].name} rates', rates, _own_rates),
        ]
    return panels


def _torques(group: Group, compared: Compared) -> _Vectors | None:
    run = compared.run
    if group not in run.mechanism.groups:
        return None
    return run.torque.times - run.times[0], run.torque.values[:, group.joints]


def _base(places: tuple[int, ...], compared: Compared) -> _Vectors:
    run = compared.run
    return run.cmd_vel.times - run.times[0], run.cmd_vel.values[:, list(places)]


def _own_rates(compared: Compared) -> _Vectors:
    run = compared.run
    return run.arm_rates.times - run.times[0], run.arm_rates.values


def _draw(axes: Axes, times: Array, vectors: Array, style: dict[str, Any]) -> None:
    """Draw the Euclidean norm of vectors (n, m) over time."""
    axes.plot(times, np.linalg.norm(vectors, axis=1), linewidth=0.8, **style)


def _legend(axes: Axes, lines: Sequence[Line2D], labels: Sequence[str], columns: int) -> None:
    """Fill axes with a legend."""
    axes.set_axis_off()
    legend = axes.legend(lines, map(str, range(len(lines))), loc='center', ncols=columns)
    for text, label in zip(legend.get_texts(), labels, strict=True):
        # Set afterwards: matplotlib skips a label that starts with an underscore.
        text.set_text(plain(label))


def _scale(axes: Axes) -> None:
    """
    Make the axis logarithmic, from the low percentile _LOWEST of the smallest line.

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
