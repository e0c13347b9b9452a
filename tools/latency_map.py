# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Error of the compensated loop over wrong latencies and masses, with the limit of stability.

`python tools/latency_map.py` draws docs/images/latency.png. The scenarios are the paper's and
TIAGo's with smc, the implicit law, a true latency of 2 to 20 ms and an assumed one of 10 ms. The
line is the limit of the linear loop of one axis, see docs/theory/latency.md.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.law.parts.delay_prediction import gain_of_rule, horizon_of_rule, slope_of_rule
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
PERIOD = 0.001
ASSUMED = 10
"""Assumed latency in periods."""
LATENCIES = tuple(range(2, 21))
"""True latencies in periods."""
MASSES = (0.25, 0.35, 0.5, 0.7, 0.85, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5)
"""Assumed masses as multiples of the true ones."""
LARGEST = 10.0
"""Error in mm from which a run counts as diverged."""
ROBOTS = {
    'paper.yaml': ('planar robot, E', 2, 20.0, LATENCIES),
    'tiago.yaml': ('TIAGo, hand', 3, 10.0, LATENCIES[::2]),
}
"""
Maps by parameter file.

Title, number of coordinates of the point, duration of a run in s, and true latencies.
"""


def error_of(latency: int, mass: float, file: str = 'paper.yaml') -> float:
    """
    Return the RMS of the true distance of a point from its path in mm; NaN if the run diverges.

    Parameters
    ----------
    latency
        True latency in periods.
    mass
        Assumed masses as multiples of the true ones.
    file
        Parameter file, a key of `ROBOTS`. The RMS is that of the second half of its duration.

    """
    _, coordinates, duration, _ = ROBOTS[file]
    settings = (
        'controller.law=smc',
        'controller.switching=implicit',
        f'control_period={PERIOD}',
        f'duration={duration}',
        f'controller.latency={ASSUMED * PERIOD}',
        f'controller.model_scale={mass}',
        f'plant.measurement_delay={latency * PERIOD}',
    )
    simulation = Simulation(load_scenario(str(ROOT / 'config' / file), settings))
    try:
        (run,) = simulation.run(block=30_000)
    except InputError:
        return math.nan
    error = run.true_error(simulation.plant.robot)
    squares = (error[len(error) // 2:-1, :coordinates] ** 2).sum(axis=1)
    rms = 1e3 * math.sqrt(squares.mean())
    return rms if rms < LARGEST else math.nan


def growth(latency: int, mass: float, assumed: int = ASSUMED) -> float:
    """
    Return the spectral radius of the linear loop of one axis with the gains of the rule.

    States are the true velocities and the commanded accelerations of the last periods, d and
    delta.
    """
    count = max(latency, assumed) + 2
    rows = np.eye(2 * count + 3)
    velocity, command = rows[:count + 1], rows[count:2 * count + 1]
    of_rule = assumed * PERIOD, PERIOD
    gain, horizon = gain_of_rule(*of_rule), horizon_of_rule(*of_rule)
    slope_gain = slope_of_rule(*of_rule) * gain * gain
    rate = (velocity[latency] - velocity[latency + 1]) / PERIOD
    f = rate - command[1 + assumed] - rows[-2]
    slope = rows[-1] + slope_gain * f
    d = rows[-2] + gain * f + slope
    ahead = command[1:assumed + 1].sum(axis=0) + assumed * d + assumed * (assumed - 1) / 2 * slope
    u = -(velocity[latency] + PERIOD * ahead) / horizon - d - (assumed + 1) * slope
    step = np.vstack([
        velocity[0] + PERIOD * mass * u, velocity[:count], u, command[1:count], d, slope
    ])
    return float(np.abs(np.linalg.eigvals(step)).max())


def draw(drawing: Any, title: str, latencies: Array, errors: Array, limit: Array) -> Any:
    """
    Draw a map and return its mesh.

    Parameters
    ----------
    drawing
        Axes of Matplotlib.
    title
        Title of the map.
    latencies
        True latencies (n) in periods.
    errors
        Errors (n, masses) in mm.
    limit
        Spectral radii (all latencies, any number) of the linear loop.

    """
    drawing.set_facecolor('0.8')
    mesh = drawing.pcolormesh(MASSES, latencies / ASSUMED, errors, norm='log', shading='nearest')
    fine = np.geomspace(MASSES[0], MASSES[-1], limit.shape[1])
    drawing.contour(fine, np.array(LATENCIES) / ASSUMED, limit, levels=[1.0], colors='red')
    drawing.set_xscale('log')
    drawing.set_xticks(MASSES, [f'{mass:g}' for mass in MASSES], minor=False, rotation=90)
    drawing.minorticks_off()
    drawing.set(title=title, xlabel='assumed / true masses')
    return mesh


def main() -> None:
    """Draw the maps."""
    from matplotlib.figure import Figure

    limit: Array = np.array([
        [growth(latency, mass) for mass in np.geomspace(MASSES[0], MASSES[-1], 60)]
        for latency in LATENCIES
    ])
    figure = Figure(figsize=(9.0, 4.2), layout='constrained')
    drawings = figure.subplots(1, len(ROBOTS), sharey=True)
    for drawing, (file, (title, _, _, latencies)) in zip(drawings, ROBOTS.items(), strict=True):
        errors = np.array([
            [error_of(latency, mass, file) for mass in MASSES] for latency in latencies
        ])
        mesh = draw(drawing, title, np.array(latencies), errors, limit)
        figure.colorbar(mesh, ax=drawing, label='RMS error (mm); grey: diverged')
    drawings[0].set_ylabel('true / assumed latency (10 ms)')
    figure.savefig(ROOT / 'docs' / 'images' / 'latency.png', dpi=110)


if __name__ == '__main__':
    main()
