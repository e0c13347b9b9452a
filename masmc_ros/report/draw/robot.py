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
    """Draw the robot at one position, faintly."""
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
