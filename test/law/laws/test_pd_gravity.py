# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""PD with gravity compensation: torque formula and decrease of energy at a set point."""

from __future__ import annotations

from pathlib import Path

from helpers.lagrangian import matrices
from helpers.law_bench import at_random, PAPER, run, tick
from helpers.robots import DEFAULT
from helpers.small_tree import write_scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

LAW = 'pd_gravity'


@pytest.mark.parametrize('seed', range(20))
def test_pd_gravity_torque_matches_formula(seed: int) -> None:
    """The default robot moves in a plane; its gravity term is zero."""
    k_p, k_d = np.random.default_rng(seed).uniform(1.0, 500.0, (2, 4))
    controller, at = at_random(seed, LAW, pd_gravity__k_p=tuple(k_p), pd_gravity__k_d=tuple(k_d))
    force = -k_p * at.error - k_d * at.error_rate
    np.testing.assert_allclose(tick(controller, at), at.jacobian.T @ force, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_pd_gravity_set_point_energy_decreases() -> None:
    """Robot energy plus spring energy K_p e^2 / 2, up to the effect of holding torques for T."""
    at_rest = (
        'trajectory.line_sine.slope=[0.0, 0.0, 0.0, 0.0]',
        'trajectory.line_sine.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    )
    values = load_scenario(PAPER, (f'controller.law={LAW}', 'duration=2.0', *at_rest))
    simulation = Simulation(values)
    plant, controller = simulation.plant, simulation.controller
    reference = np.array([0.3, 0.5, *[0.0] * 10])
    energy = []
    for _ in range(2000):
        controller.tick(plant.position, plant.velocity, reference)
        rates = plant.velocity[-4:]
        h = matrices(DEFAULT, plant.position, rates).reduced_inertia
        energy.append(0.5 * rates @ h @ rates + 1000.0 * controller.error @ controller.error)
        plant.advance(controller.torque)
    assert max(np.diff(energy)) < 1e-5 * energy[0]
    assert energy[-1] < 0.05 * energy[0]


@pytest.mark.slow
def test_pd_gravity_lift_torque_supports_its_load(tmp_path: Path) -> None:
    """Without gains the law supports lift, arm and hand (5.1 kg) with half of the true masses."""
    scenario = write_scenario(tmp_path, [0.0] * 6, 1.0)
    no_gains = [f'controller.{LAW}.{gain}=0.0' for gain in ('k_p', 'k_d')]
    settings = (f'controller.law={LAW}', 'controller.model_scale=0.5', *no_gains)
    simulation = Simulation(load_scenario(str(scenario), settings))
    plant, controller = simulation.plant, simulation.controller
    controller.tick(plant.position, plant.velocity, np.zeros(controller.signals['reference'].size))
    assert controller.raw_torque[3] == pytest.approx(0.5 * 5.1 * 9.81, rel=1e-9)
    assert controller.raw_torque[:3] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_pd_gravity_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.05
