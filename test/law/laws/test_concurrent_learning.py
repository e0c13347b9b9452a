# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Concurrent learning: formulas of record and update, and behaviour without excitation."""

from __future__ import annotations

from dataclasses import replace

from helpers.dense_regressor import regressor, THETA
from helpers.law_bench import at_random, Instant, PAPER, run, tick
from helpers.robots import Array
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

LAW = 'concurrent_learning'

EXCITED = (
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.slope=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.amplitude=[0.1, 0.15, 0.1, 0.1]',
    'trajectory.line_sine.frequency=[3.0, 2.0, 1.0, 1.7]',
)
"""Motion that excites every parameter, without a disturbance."""


@pytest.mark.parametrize('seed', range(20))
def test_concurrent_learning_update_matches_formula(seed: int) -> None:
    """Implicit Euler for the recorded data: (Gamma + T kappa A) d = T kappa (b - A theta)."""
    rng = np.random.default_rng(seed)
    gamma, kappa, fading = rng.uniform(0.5, 5.0, 7), rng.uniform(0.1, 50.0), rng.uniform(0.0, 5.0)
    controller, at = at_random(
        seed, LAW, gamma=tuple(gamma), **{f'{LAW}__kappa': kappa, f'{LAW}__forgetting': fading}
    )
    theta = at.scale * THETA
    information, vector = np.zeros((7, 7)), np.zeros(7)
    for _ in range(4):
        torque = tick(controller, at)
        y = regressor(at.position, at.v, *at.reference)
        u = -100.0 * at.surface - 100.0 * np.tanh(at.surface / 0.2)
        np.testing.assert_allclose(torque, y @ theta + at.jacobian.T @ u, rtol=1e-9, atol=1e-9)
        weight = at.period * kappa
        moved = np.linalg.solve(
            np.diag(gamma) + weight * information, weight * (vector - information @ theta)
        )
        tracking = y.T @ np.linalg.solve(at.jacobian, at.surface)
        theta = theta + moved - at.period * tracking / gamma
        np.testing.assert_allclose(controller.estimate, theta, rtol=1e-9, atol=1e-9)
        last, v = at.v, at.v + 0.01 * rng.normal(size=4)
        at = Instant(at.period, at.position, v, at.desired, at.scale, at.sigma)
        middle = 0.5 * (v + last)
        w = regressor(at.position, middle, middle, (v - last) / at.period)
        weighted = at.period * np.linalg.solve(at.inertia, w).T
        kept = 1.0 / (1.0 + at.period * fading)
        information = kept * information + weighted @ w
        vector = kept * vector + weighted @ torque


def errors_after_excitation(law: str) -> tuple[Array, Array]:
    """Return the relative errors of theta_hat 1 s and 6 s after 3 s of excitation ended."""
    weight = 'controller.concurrent_learning.kappa=30.0'
    values = load_scenario(PAPER, (f'controller.law={law}', weight, *EXCITED, 'duration=3.0'))
    excited = next(Simulation(values).run(block=10**6)).reference
    still = np.zeros_like(excited[-1])
    still[:4] = excited[-1][:4]
    single = Simulation(values)
    plant, controller = single.plant, single.controller
    errors = []
    for k in range(9000):
        controller.tick(plant.position, plant.velocity, excited[k] if k < 3000 else still)
        plant.advance(controller.torque)
        if k in (4000, 8999):
            errors.append(np.linalg.norm(controller.estimate / THETA - 1.0))
    return errors[0], errors[1]


def test_concurrent_learning_excitation_ends_still_converges() -> None:
    """At rest rasmc keeps its parameter errors; the recorded data removes them."""
    recorded, tracked = errors_after_excitation(LAW), errors_after_excitation('rasmc')
    assert recorded[1] < 0.2 * recorded[0]
    assert tracked[1] > 0.95 * tracked[0]


def test_concurrent_learning_too_many_parameters_raises() -> None:
    large = replace(TWO_LINK, theta=TWO_LINK.theta * 5)
    assert registry.load_for(LAW, TWO_LINK).name == LAW
    with pytest.raises(InputError, match='35 base inertial parameters, expected at most 32'):
        registry.load_for(LAW, large)


def test_concurrent_learning_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.05
