# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Error of the compensated loop over wrong latencies and masses, with the limit of stability.

`python tools/latency_map.py` draws docs/images/latency.png. The scenario is the paper's with smc,
the implicit law, a true latency of 2 to 20 ms and an assumed one of 10 ms. The line is the limit
of the linear loop of one axis, see docs/theory/latency.md.
"""

from __future__ import annotations

import math
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.law.parts.delay_compensation import HORIZON, SLOPE
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray

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


def error_of(latency: int, mass: float) -> float:
    """Return the RMS of the true distance of E from its path in mm; NaN if the run diverges."""
    settings = (
        'controller.law=smc',
        'controller.switching=implicit',
        f'controller.latency={ASSUMED * PERIOD}',
        f'controller.model_scale={mass}',
        f'plant.measurement_delay={latency * PERIOD}',
    )
    simulation = Simulation(load_scenario(str(ROOT / 'config' / 'paper.yaml'), settings))
    try:
        (run,) = simulation.run(block=30_000)
    except InputError:
        return math.nan
    error = run.true_error(simulation.plant.robot)
    rms = 1e3 * math.sqrt((error[len(error) // 2:-1, :2] ** 2).sum(axis=1).mean())
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
    gain = min(0.25, 1.0 / assumed)
    slope_gain = SLOPE * gain * gain
    horizon = HORIZON * max(assumed, 1) * PERIOD
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


def main() -> None:
    """Draw the map."""
    from matplotlib.figure import Figure

    errors = np.array([[error_of(latency, mass) for mass in MASSES] for latency in LATENCIES])
    fine = np.geomspace(MASSES[0], MASSES[-1], 60)
    radii: NDArray[np.float64] = np.array([
        [growth(latency, mass) for mass in fine] for latency in LATENCIES
    ])
    ratios = np.array(LATENCIES) / ASSUMED
    figure = Figure(figsize=(7.0, 4.2), layout='constrained')
    axes = figure.add_subplot()
    axes.set_facecolor('0.8')
    mesh = axes.pcolormesh(MASSES, ratios, errors, norm='log', shading='nearest')
    axes.contour(fine, ratios, radii, levels=[1.0], colors='red')
    axes.set_xscale('log')
    axes.set_xticks(MASSES, [f'{mass:g}' for mass in MASSES], minor=False)
    axes.minorticks_off()
    axes.set_xlabel('assumed / true masses')
    axes.set_ylabel('true / assumed latency (10 ms)')
    figure.colorbar(mesh, label='RMS error of E (mm); grey: diverged')
    figure.savefig(ROOT / 'docs' / 'images' / 'latency.png', dpi=110)


if __name__ == '__main__':
    main()
