# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Error against torque variation of the velocity estimator and of a first-order filter.

`python tools/estimator_curve.py` draws docs/images/estimator.png and updates the table in
docs/theory/estimator.md. The scenario is the paper's with smc, the implicit law and
observer_gain 0.5 at 1 kHz. Encoders have 1e-4 rad, measured velocities a noise of 0.01 rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from pathlib import Path
import re

from masmc_ros.errors import InputError
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
SETTINGS = (
    'controller.law=smc',
    'controller.switching=implicit',
    'controller.observer_gain=0.5',
    'plant.encoder_resolution=0.0001',
    'plant.velocity_noise=0.01',
)
BANDWIDTHS = (400, 500, 700, 1000, 1400, 2000, 3000, 5000, 10000, 30000)
FILTERS = (600, 700, 800, 1000, 1400, 2000, 3000, 5000, 10000, 30000)

_TABLE = re.compile(r'(<!-- curve -->\n).*?(<!-- end of curve -->)', re.DOTALL)
_NO_CURVE = 10.0


@dataclass(frozen=True)
class Point:
    """RMS of the true distance of E from its path in mm, and total variation in N·m/s."""

    bandwidth: float
    error: float
    variation: float


def estimated(bandwidth: float) -> Point:
    """Return the result of the velocity estimator at a bandwidth in rad/s."""
    simulation = _simulation(
        'controller.velocity_source=estimated', f'controller.estimator_bandwidth={bandwidth}'
    )
    (run,) = simulation.run(block=30_000)
    return _point(bandwidth, run.true_error(simulation.plant.robot), run.torque)


def filtered(bandwidth: float) -> Point:
    """Return the result of filtered differences of the angles at a bandwidth in rad/s."""
    simulation = _simulation()
    plant, controller = simulation.plant, simulation.controller
    period = simulation.timing.period
    ticks = (simulation.timing.last or 0) + 1
    reference = simulation.trajectory.sample(0, ticks)
    share = 1.0 - math.exp(-bandwidth * period)
    rates, before = np.zeros(4), plant.position[3:].copy()
    position, torque = np.empty((ticks, 7)), np.empty((ticks, 4))
    for k in range(ticks):
        rates += share * ((plant.position[3:] - before) / period - rates)
        before[:] = plant.position[3:]
        controller.tick(plant.position, np.concatenate([np.zeros(3), rates]), reference[k])
        position[k], torque[k] = plant.true_position, controller.torque
        if k + 1 < ticks:
            plant.advance(controller.torque)
    error = plant.robot.task_positions(position) - reference[:, :4]
    return _point(bandwidth, error, torque)


def measured() -> Point:
    """Return the result of the noisy measured velocities."""
    simulation = _simulation()
    (run,) = simulation.run(block=30_000)
    return _point(math.nan, run.true_error(simulation.plant.robot), run.torque)


def _simulation(*settings: str) -> Simulation:
    paper = str(ROOT / 'config' / 'paper.yaml')
    return Simulation(load_scenario(paper, (*SETTINGS, *settings)))


def _point(
    bandwidth: float, error: NDArray[np.float64], torque: NDArray[np.float64]
) -> Point:
    half = slice(len(error) // 2, len(error) - 1)
    rms = 1e3 * math.sqrt((error[half, :2] ** 2).sum(axis=1).mean())
    duration = 1e-3 * (len(error) // 2)
    return Point(bandwidth, rms, float(np.abs(np.diff(torque[half], axis=0)).sum() / duration))


def _table(estimates: list[Point], filters: list[Point], plain: Point) -> str:
    lines = ['| velocities from | bandwidth (rad/s) | E RMS (mm) | torque variation (N·m/s) |']
    lines.append('|---|---:|---:|---:|')
    for name, points in (('estimator', estimates), ('first-order filter', filters)):
        for p in points:
            row = f'{p.bandwidth:.0f} | {p.error:.3f} | {_spaced(p.variation)}'
            lines.append(f'| {name} | {row} |')
    lines.append(f'| measured, with noise | | {plain.error:.3f} | {_spaced(plain.variation)} |')
    return '\n'.join(lines) + '\n'


def _spaced(number: float) -> str:
    return f'{number:,.0f}'.replace(',', ' ')


def _draw(estimates: list[Point], filters: list[Point], plain: Point) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout='constrained')
    axes = figure.add_subplot()
    for points, label, marker in (
        (estimates, 'estimator', 'o'),
        (filters, 'first-order filter of differences', 's'),
    ):
        axes.loglog(
            [p.variation for p in points], [p.error for p in points], marker, ls='-', label=label
        )
        for p in points[::3]:
            axes.annotate(
                f'{p.bandwidth:.0f}',
                (p.variation, p.error),
                textcoords='offset points',
                xytext=(4, 5),
                fontsize=7,
            )
    axes.loglog(plain.variation, plain.error, '^', label='measured rates, noise 0.01 rad/s')
    axes.set_xlabel('torque variation (N·m/s)')
    axes.set_ylabel('RMS error of E (mm)')
    axes.grid(visible=True, which='both', alpha=0.3)
    axes.legend()
    figure.savefig(ROOT / 'docs' / 'images' / 'estimator.png', dpi=110)


def main() -> None:
    """Draw the curve and update its table."""
    estimates = [estimated(bandwidth) for bandwidth in BANDWIDTHS]
    filters = []
    for bandwidth in FILTERS:
        try:
            filters.append(filtered(bandwidth))
        except InputError:
            print(f'first-order filter, {bandwidth} rad/s: diverges')
    plain = measured()
    _draw(estimates, [p for p in filters if p.error < _NO_CURVE], plain)
    path = ROOT / 'docs' / 'theory' / 'estimator.md'
    table = _table(estimates, filters, plain)
    text = path.read_text(encoding='utf-8')
    path.write_text(_TABLE.sub(lambda m: m[1] + table + m[2], text), encoding='utf-8')
    print(table)


if __name__ == '__main__':
    main()
