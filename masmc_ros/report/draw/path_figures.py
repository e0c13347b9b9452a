# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Figures of paths: in the plane, with the robot to scale, and the preview along a path.

Desired and actual paths are the paper's Figures 3 and 6.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.aliases import Array, Bytes
from masmc_ros.log.read.reader import Run
from masmc_ros.report.draw import style
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.report.measure.path_preview import Preview
from masmc_ros.report.measure.tracking import Tracking
from masmc_ros.report.panels import INK, path_panel
from masmc_ros.robot.declaration import Outline
from masmc_ros.robot.robot import Robot
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
import numpy as np

_AREAS = {'body': (style.GREY, 0.35), 'part': (style.BLACK, 1.0)}
"""Colour and opacity of areas by their kind."""


def draw_robot(axes: Axes, outline: Outline, opacity: float) -> None:
    """Draw the robot at one position with an `opacity`."""
    for shape in outline.shapes:
        if shape.kind in _AREAS:
            colour, strength = _AREAS[shape.kind]
            axes.add_patch(
                Polygon(
                    shape.points,
                    facecolor=colour,
                    edgecolor='none',
                    alpha=strength * opacity,
                    zorder=1.5,
                )
            )
        else:
            options: dict[str, Any] = {'color': style.BLACK, 'alpha': opacity, 'zorder': 1.6}
            axes.plot(*shape.points.T, linewidth=1.2, **options)
            axes.plot(*shape.points[:-1].T, 'o', markersize=2.0, **options)


_INSTANTS = 6
_FLATTEST, _STEEPEST = 0.2, 0.8
"""Height of the drawing over its width."""
_MARGIN = 0.02
"""Margin around the drawing, as a part of its longer side."""
_WIDTH = 165.0
"""Width in mm of the axes in the figure."""
_SURROUND = 17.0
"""Height in mm of the labels and the legend."""


def path_figure(run: Run, tracked: Tracking, label: str) -> Figure | None:
    """
    Draw the paths of the robot's points, and the robot at several instants.

    Returns None if the log lacks the positions.
    """
    robot = run_robot(run)
    if tracked.actual is None or tracked.desired is None:
        return None
    if robot is None and not run.mechanism.places:
        return None
    figure = style.new_figure(style.PAGE, style.PAGE)
    axes = figure.subplots()
    if robot is not None:
        _draw_instants(axes, robot, run)
    lines = []
    panel = path_panel(run, tracked)
    for line in panel.lines:
        is_desired = line.colour == INK
        width, depth, marker = (0.8, 2.6, '') if is_desired else (1.2, 2.5, 'o')
        lines.append(style.draw_line(
            axes, line, linewidth=width, zorder=depth, marker=marker, markersize=3.5, markevery=[0]
        ))
    # The drawing is a top view; the error figures show all axes.
    is_flat = all(point.size == 2 for point in run.mechanism.places)
    axes.set_xlabel('$x$ (m)' if is_flat else '$x$ (m), top view without $z$')
    axes.set_ylabel(style.mathtext(panel.quantity))
    width, height = _fit(axes)
    page = _SURROUND + height / width * _WIDTH
    figure.set_figheight(figure.get_figwidth() * page / style.PAGE)
    style.caption(figure, axes, label, lines)
    return figure


def frame(robot: Robot, position: Array, desired: Array, actual: Array) -> Bytes:
    """
    Return a picture (height, width, 3) of a robot in the plane with its paths, in RGB.

    Parameters
    ----------
    robot
        Robot.
    position
        Positions (positions) in the order of joint_states.
    desired, actual
        Task positions (n, axes) and (m, axes) of the desired path and of the path up to now.

    """
    figure = Figure(figsize=(6.4, 4.8), dpi=100)
    canvas, axes = FigureCanvasAgg(figure), figure.subplots()
    for point in robot.mechanism.places:
        x, y = point.first, point.first + 1
        axes.plot(desired[:, x], desired[:, y], '--', color=style.GREY, linewidth=1.0, zorder=1.2)
        axes.plot(actual[:, x], actual[:, y], linewidth=1.5, zorder=2.5)
    draw_robot(axes, robot.mechanism.formulas.outline(robot.geometry, position), opacity=1.0)
    axes.set_xlabel('x (m)')
    axes.set_ylabel('y (m)')
    _fit(axes)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:, :, :3].copy()


def _draw_instants(axes: Axes, robot: Robot, run: Run) -> None:
    """Draw the robot at instants evenly spread over the run, each with its time."""
    for k in np.linspace(0, len(run.position) - 1, _INSTANTS).round().astype(int):
        outline = robot.mechanism.formulas.outline(robot.geometry, run.position[k])
        draw_robot(axes, outline, opacity=0.45)
        x, y = outline.origin
        axes.text(
            x,
            y - outline.below,
            f'{run.times[k] - run.times[0]:.3g} s',
            color=style.GREY,
            fontsize=6.5,
            ha='center',
            va='top',
            clip_on=True,
        )
        # A text does not extend the limits of the data automatically.
        axes.update_datalim([(x, y - outline.below - outline.text)])


def _fit(axes: Axes) -> tuple[float, float]:
    """Fit the axes to the drawing with equal scales; return both extents in m."""
    drawn = axes.dataLim
    margin = 2.0 * _MARGIN * max(drawn.width, drawn.height)
    width, height = drawn.width + margin, drawn.height + margin
    width = max(width, height / _STEEPEST)
    height = max(height, width * _FLATTEST)
    x, y = (drawn.x0 + drawn.x1) / 2.0, (drawn.y0 + drawn.y1) / 2.0
    axes.set_xlim(x - width / 2.0, x + width / 2.0)
    axes.set_ylim(y - height / 2.0, y + height / 2.0)
    axes.set_aspect('equal')
    return width, height


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
    with style.paper_style():
        figure = style.new_figure(style.PAGE, _HEIGHT * len(panels) + _LEGEND * rows / 2.0)
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
                axes.axhline(1.0, color=style.GREY, linewidth=0.8)
            axes.set_ylabel(label)
            axes.set_ylim(bottom=min(0.0, *axes.get_ylim()))
            style.time_axis(axes)
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
