# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The robot seen from above, to scale."""

from __future__ import annotations

from typing import Any

from masmc_ros.report.draw.style import BLACK, GREY
from masmc_ros.robot.declaration import Outline
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

_AREAS = {'body': (GREY, 0.35), 'part': (BLACK, 1.0)}
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
            style: dict[str, Any] = {'color': BLACK, 'alpha': opacity, 'zorder': 1.6}
            axes.plot(*shape.points.T, linewidth=1.2, **style)
            axes.plot(*shape.points[:-1].T, 'o', markersize=2.0, **style)
