# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ten minutes under config/robust.yaml: no drift, with noise and within limits."""

from __future__ import annotations

from pathlib import Path

from helpers.robots import Array
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

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
    """Ten minutes of true errors, estimates and number of limited ticks."""

    def __init__(self, *settings: str) -> None:
        """Simulate config/robust.yaml with further settings."""
        simulation = Simulation(load_scenario(ROBUST, ('duration=600.0', *settings)))
        robot, self.nominal = simulation.plant.robot, simulation.controller.nominal
        errors, estimates, limited = [], [], 0
        for tick_block in simulation.run():
            errors.append(tick_block.true_error(robot))
            estimates.append(tick_block.estimate)
            limited += int((tick_block.raw_torque != tick_block.torque).any(axis=1).sum())
        self.error, self.estimate = np.concatenate(errors), np.concatenate(estimates)
        self.limited = limited

    def rms(self, start: float, end: float) -> Array:
        """Return the RMS distances of E and F from their paths between two times, in mm."""
        error = 1e3 * self.error[round(1e3 * start):round(1e3 * end)]
        squares = [(error[:, axes] ** 2).sum(axis=1).mean() for axes in ([0, 1], [2, 3])]
        return np.sqrt(squares)


@pytest.mark.slow
@pytest.mark.parametrize('limits', [(), (LIMITS,)], ids=['no limits', 'limits'])
def test_robust_scenario_ten_minutes_of_noise_do_not_drift(limits: tuple[str, ...]) -> None:
    """
    At 600 s errors equal those at 20 s of a run with the same phase of the disturbance.

    The periods of path and disturbance have no common multiple; over 100 s the phases average out.
    """
    run = LongRun(NOISE, *limits)
    assert bool(run.limited) == bool(limits)
    assert_bounded(run)
    young = LongRun(NOISE, *limits, disturbance_later_by(580.0), 'duration=20.0')
    assert (run.rms(590.0, 600.0) <= 1.005 * young.rms(10.0, 20.0)).all()
    assert (run.rms(500.0, 600.0) <= 1.001 * run.rms(10.0, 110.0)).all()
    assert (run.rms(590.0, 600.0) < [0.05, 0.02]).all()


@pytest.mark.slow
@pytest.mark.parametrize('limits', [(), (LIMITS,)], ids=['no limits', 'limits'])
def test_robust_scenario_measured_velocities_do_not_drift(limits: tuple[str, ...]) -> None:
    """Noise changes the RMS of ten seconds by 15 %; these RMS values cover 100 s."""
    run = LongRun(NOISE, MEASURED, *limits)
    assert (run.limited > 10_000) == bool(limits)
    assert_bounded(run)
    assert (run.rms(500.0, 600.0) <= run.rms(10.0, 110.0)).all()
    assert (run.rms(500.0, 600.0) < [2.0, 1.0]).all()


def disturbance_later_by(seconds: float) -> str:
    """Return the setting that shifts the phase of the disturbance by `seconds`."""
    plant = load_scenario(ROBUST)['plant']
    passed = seconds * np.array(plant['disturbance.frequency'])
    phase = passed + plant['disturbance.phase']
    return f'plant.disturbance.phase={phase.tolist()}'


def assert_bounded(run: LongRun) -> None:
    """Assert that theta_hat stays within its bounds at every tick."""
    assert (run.estimate >= 0.2 * run.nominal * (1 - 1e-12)).all()
    assert (run.estimate <= 5.0 * run.nominal * (1 + 1e-12)).all()


@pytest.mark.slow
def test_robust_settings_disabled_estimate_leaves_bounds() -> None:
    run = LongRun(NOISE, MEASURED, LIMITS, *DRIFTING)
    ratio = run.estimate[-1] / run.nominal
    assert ratio.max() > 20.0
    assert ratio.min() < 0.0
