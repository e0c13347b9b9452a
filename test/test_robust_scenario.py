# SPDX-License-Identifier: Apache-2.0
"""Ten minutes under config/robust.yaml: nothing drifts, with noise and within limits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from robots import Array

from masmc_ros.loop.simulation import Simulation
from masmc_ros.nodes.scenario import load_scenario

ROBUST = str(Path(__file__).parent.parent / 'config' / 'robust.yaml')

NOISE = 'plant.velocity_noise=0.05'
LIMITS = 'controller.torque_limit=[8.0, 8.0, 20.0, 10.0]'
DRIFTING = (
    'controller.leakage=0.0',
    'controller.dead_zone=0.0',
    'controller.projection.lower=0.0',
    'controller.freeze_when_saturated=false',
)


class LongRun:
    """Ten minutes: true errors, estimates and whether the torque was cut."""

    def __init__(self, *settings: str) -> None:
        """Simulate under config/robust.yaml and further settings."""
        simulation = Simulation(load_scenario(ROBUST, ('duration=600.0', *settings)))
        geometry, self.nominal = simulation.plant.geometry, simulation.controller.nominal
        errors, estimates, cut = [], [], 0
        for stretch in simulation.run():
            errors.append(stretch.true_error(geometry))
            estimates.append(stretch.estimate)
            cut += int((stretch.raw_torque != stretch.torque).any(axis=1).sum())
        self.error, self.estimate = np.concatenate(errors), np.concatenate(estimates)
        self.cut = cut

    def rms(self, end: float) -> Array:
        """Return RMS of the distance of E and of F from their paths over 10 s up to `end`, mm."""
        error = 1e3 * self.error[round(1e3 * (end - 10.0)) : round(1e3 * end)]
        return np.array([math.sqrt((error[:, a] ** 2).sum(axis=1).mean()) for a in ([0, 1], [2, 3])])


@pytest.mark.parametrize('limits', [(), (LIMITS,)], ids=['no limits', 'limits'])
def test_ten_minutes_with_noise_are_no_worse_at_the_end(limits: tuple[str, ...]) -> None:
    run = LongRun(NOISE, *limits)
    assert (run.cut > 10_000) == bool(limits)
    assert (run.estimate >= 0.2 * run.nominal * (1 - 1e-12)).all()
    assert (run.estimate <= 5.0 * run.nominal * (1 + 1e-12)).all()
    at_20, at_end = run.rms(20.0), run.rms(600.0)
    # What the noise alone does to ten seconds' RMS is some percent.
    assert (at_end <= 1.15 * at_20).all()
    assert (at_end < [2.0, 0.6]).all()


def test_without_what_makes_it_last_the_estimate_leaves_the_box() -> None:
    run = LongRun(NOISE, LIMITS, *DRIFTING)
    ratio = run.estimate[-1] / run.nominal
    assert ratio.max() > 20.0
    assert ratio.min() < 0.0
