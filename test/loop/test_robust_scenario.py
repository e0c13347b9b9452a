# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ten minutes under config/robust.yaml: nothing drifts, with noise and within limits."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
import numpy as np
import pytest
from robots import Array

ROBUST = str(Path(__file__).parents[2] / 'config' / 'robust.yaml')

NOISE = 'plant.velocity_noise=0.05'
LIMITS = 'controller.torque_limit=[8.0, 8.0, 20.0, 10.0]'
MEASURED = 'controller.velocity_source=measured'
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
        robot, self.nominal = simulation.plant.robot, simulation.controller.nominal
        errors, estimates, cut = [], [], 0
        for stretch in simulation.run():
            errors.append(stretch.true_error(robot))
            estimates.append(stretch.estimate)
            cut += int((stretch.raw_torque != stretch.torque).any(axis=1).sum())
        self.error, self.estimate = np.concatenate(errors), np.concatenate(estimates)
        self.cut = cut

    def rms(self, begin: float, end: float) -> Array:
        """Return RMS of the distance of E and of F from their paths in a span of time, in mm."""
        error = 1e3 * self.error[round(1e3 * begin):round(1e3 * end)]
        squares = [(error[:, axes] ** 2).sum(axis=1).mean() for axes in ([0, 1], [2, 3])]
        return np.sqrt(squares)


@pytest.mark.slow
@pytest.mark.parametrize('limits', [(), (LIMITS,)], ids=['no limits', 'limits'])
def test_ten_minutes_with_noise_are_no_worse_at_the_end(limits: tuple[str, ...]) -> None:
    """
    At 600 s as at 20 s of a run that the disturbance meets at the same phase.

    The periods of path and disturbance have no common multiple; over 100 s the phases even out.
    """
    run = LongRun(NOISE, *limits)
    assert bool(run.cut) == bool(limits)
    assert_bounded(run)
    young = LongRun(NOISE, *limits, disturbance_later_by(580.0), 'duration=20.0')
    assert (run.rms(590.0, 600.0) <= 1.005 * young.rms(10.0, 20.0)).all()
    assert (run.rms(500.0, 600.0) <= 1.001 * run.rms(10.0, 110.0)).all()
    assert (run.rms(590.0, 600.0) < [0.05, 0.02]).all()


@pytest.mark.slow
@pytest.mark.parametrize('limits', [(), (LIMITS,)], ids=['no limits', 'limits'])
def test_nor_are_they_where_the_noisy_rates_are_used(limits: tuple[str, ...]) -> None:
    """Over 100 s, since noise moves the RMS of ten by 15 %."""
    run = LongRun(NOISE, MEASURED, *limits)
    assert (run.cut > 10_000) == bool(limits)
    assert_bounded(run)
    assert (run.rms(500.0, 600.0) <= run.rms(10.0, 110.0)).all()
    assert (run.rms(500.0, 600.0) < [2.0, 1.0]).all()


def disturbance_later_by(seconds: float) -> str:
    """Return the setting with which a run begins at a later phase of the disturbance."""
    plant = load_scenario(ROBUST)['plant']
    passed = seconds * np.array(plant['disturbance.frequency'])
    phase = passed + plant['disturbance.phase']
    return f'plant.disturbance.phase={phase.tolist()}'


def assert_bounded(run: LongRun) -> None:
    """Hold theta_hat against its box at every tick."""
    assert (run.estimate >= 0.2 * run.nominal * (1 - 1e-12)).all()
    assert (run.estimate <= 5.0 * run.nominal * (1 + 1e-12)).all()


@pytest.mark.slow
def test_without_what_makes_it_last_the_estimate_leaves_the_box() -> None:
    run = LongRun(NOISE, MEASURED, LIMITS, *DRIFTING)
    ratio = run.estimate[-1] / run.nominal
    assert ratio.max() > 20.0
    assert ratio.min() < 0.0
