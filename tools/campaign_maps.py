# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Maps of the paper's scenario: effect of the adaptation, and limits of boundary layers.

`python tools/campaign_maps.py` draws docs/images/adaptation.png and docs/images/stability.png by
sweeps. The lines are the limits of docs/theory/sampled_laws.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from pathlib import Path
from typing import Any, NamedTuple

import masmc_ros as masmc
import numpy as np
from numpy.typing import NDArray

IMAGES = Path(__file__).resolve().parent.parent / 'docs' / 'images'

INERTIA = 0.655
"""Smallest eigenvalue of the task inertia along the path in kg."""

GAIN = 100.0
"""K_s1 and K_s2 of the scenario."""

PUSH, WEAK = 96.5, 33.0
"""Largest disturbance on a task axis along the path, and K_s2 for a third of it, in N."""

WEAKER = {'k_s2': WEAK, 'settings': {'plant.disturbance.amplitude': [0.5, 0.5, 1.0, 1.0]}}
"""Values with a third of the disturbance, for which thick layers keep the arm from its limits."""

Array = NDArray[np.float64]


class Grid(NamedTuple):
    """Axis of a map: name, values, and label."""

    name: str
    values: tuple[float, ...]
    label: str


def spaced(name: str, low: float, high: float, count: int, label: str) -> Grid:
    """Return an axis with values in equal ratios."""
    values = np.geomspace(low, high, count)
    return Grid(name, tuple(float(f'{value:.4g}') for value in values), label)


LAYER = spaced('controller.boundary_layer', 0.01, 3.0, 21, 'boundary layer δ (m/s)')
MASSES = spaced('controller.model_scale', 0.1, 4.0, 17, 'assumed / true masses')

PERIOD = Grid(
    'control_period', (0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.005, 0.007, 0.01),
    'control period T (s)',
)  # fmt: skip


def swept(
    metric: str, x: Grid, y: Grid, laws: Sequence[str], **values: Any
) -> tuple[Array, ...]:
    """Return a metric (x, y) of each law; NaN for runs that diverged."""
    vary: Mapping[str, Sequence[object]] = {
        'controller.law': laws, x.name: x.values, y.name: y.values
    }
    table = masmc.sweep('paper', vary, **values)
    column = np.array(table[metric].to_pylist(), np.float64)
    return tuple(column.reshape(len(laws), len(x.values), len(y.values)))


def smallest_layer(period: Any, gain: Any, delay: int = 0) -> Any:
    """
    Return the smallest boundary layer of a stable loop in m/s, infinite if there is none.

    `delay` is the age of the states in periods.
    """
    room = 2.0 * math.sin(0.5 * math.pi / (2 * delay + 1)) * INERTIA / period - GAIN
    return np.where(room > 0.0, gain / np.maximum(room, 1.0e-9), math.inf)


def draw(drawing: Any, x: Grid, y: Grid, values: Array, **style: Any) -> Any:
    """Draw a map with logarithmic axes; grey: diverged."""
    drawing.set_facecolor('0.8')
    mesh = drawing.pcolormesh(
        x.values, y.values, np.ma.masked_invalid(values.T), shading='nearest', **style
    )
    is_log = x.values[0] > 0.0 and x.values[-1] > 8.0 * x.values[0]
    drawing.set(xscale='log' if is_log else 'linear', yscale='log', xlabel=x.label, ylabel=y.label)
    return mesh


def draw_adaptation() -> None:
    """Draw the ratio of the errors with and without adaptation."""
    from matplotlib.figure import Figure

    gamma = spaced('controller.gamma', 0.003, 30.0, 17, 'Γ')
    observed = {'switching': 'implicit', 'observer_gain': 0.5}
    maps: tuple[tuple[str, Grid, Grid, dict[str, Any]], ...] = (
        ('tanh', LAYER, MASSES, {}),
        ('tanh, δ = 0.2 m/s', gamma, MASSES, {}),
        ('implicit', PERIOD, MASSES, {'switching': 'implicit'}),
        ('implicit, observer_gain 0.5', PERIOD, MASSES, observed),
    )
    figure = Figure(figsize=(8.0, 6.4), layout='constrained')
    drawings = figure.subplots(2, 2)
    for drawing, (title, x, y, values) in zip(drawings.flat, maps, strict=True):
        without, with_adaptation = swept('end_effector_rms', x, y, ('smc', 'rasmc'), **values)
        ratio = np.log10(with_adaptation / without)
        mesh = draw(drawing, x, y, ratio, cmap='RdBu_r', vmin=-1, vmax=1)
        drawing.set_title(title)
    bar = figure.colorbar(
        mesh, ax=drawings, label='error of rasmc / error of smc; grey: one of them diverged'
    )
    bar.set_ticks([-1, -0.5, 0, 0.5, 1], labels=['≤ 0.1', '0.3', '1', '3', '≥ 10'])
    figure.savefig(IMAGES / 'adaptation.png', dpi=110)


def draw_stability() -> None:
    """Draw the torque variation of smc with tanh, and the smallest boundary layer."""
    from matplotlib.figure import Figure

    gain = spaced('controller.k_s2', 10.0, 400.0, 17, '$K_{s2}$ (N)')
    delay = Grid(
        'plant.measurement_delay', tuple(k * 1e-3 for k in range(7)), 'age of the states (s)'
    )
    ages = [round(age / 1e-3) for age in delay.values]
    title = f'$K_{{s2}}$ = {WEAK:g} N'
    maps: tuple[tuple[str, Grid, dict[str, Any], Any], ...] = (
        ('T = 1 ms', gain, {}, smallest_layer(1e-3, np.array(gain.values))),
        (title, PERIOD, WEAKER, smallest_layer(np.array(PERIOD.values), WEAK)),
        (f'{title}, T = 1 ms', delay, WEAKER,
         np.array([smallest_layer(1e-3, WEAK, age) for age in ages])),
    )  # fmt: skip
    figure = Figure(figsize=(11.0, 3.6), layout='constrained')
    drawings = figure.subplots(1, 3)
    for drawing, (title, x, values, limit) in zip(drawings, maps, strict=True):
        (variation,) = swept('torque_variation', x, LAYER, ('smc',), **values)
        mesh = draw(drawing, x, LAYER, variation, norm='log')
        mesh.set_clim(10.0, 1e5)
        drawing.plot(x.values, limit, color='red')
        drawing.set_title(title)
        drawing.set_ylim(LAYER.values[0], LAYER.values[-1])
    drawings[0].axvline(PUSH, color='red', linestyle='--')
    figure.colorbar(mesh, ax=drawings, label='torque variation (N·m/s); grey: diverged')
    figure.savefig(IMAGES / 'stability.png', dpi=110)


def main() -> None:
    """Draw both figures."""
    draw_adaptation()
    draw_stability()


if __name__ == '__main__':
    main()
