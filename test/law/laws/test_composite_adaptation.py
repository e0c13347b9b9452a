# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Composite adaptation: update formula, and convergence of theta_hat to theta."""

from __future__ import annotations

from helpers.dense_regressor import regressor, THETA
from helpers.law_bench import at_random, Instant, run, tick
from helpers.robots import Array
import numpy as np
import pytest

LAW = 'composite_adaptation'

EXCITED = (
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.slope=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.amplitude=[0.1, 0.15, 0.1, 0.1]',
    'trajectory.line_sine.frequency=[3.0, 2.0, 1.0, 1.7]',
)
"""Motion that excites every parameter, without a disturbance."""


def torque(at: Instant, theta: Array) -> Array:
    """Return Y theta + J' u with tanh and the gains of the paper's file."""
    y = regressor(at.position, at.v, *at.reference)
    u = -100.0 * at.surface - 100.0 * np.tanh(at.surface / 0.2)
    applied: Array = y @ theta + at.jacobian.T @ u
    return applied


def tracking(at: Instant) -> Array:
    """Return Y' sigma."""
    y = regressor(at.position, at.v, *at.reference)
    gradient: Array = y.T @ np.linalg.solve(at.jacobian, at.surface)
    return gradient


@pytest.mark.parametrize('seed', range(20))
def test_composite_adaptation_update_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gamma, kappa, rate = rng.uniform(0.5, 5.0, 7), rng.uniform(0.1, 5.0), rng.uniform(50, 1e3)
    controller, at = at_random(
        seed, LAW, gamma=tuple(gamma), **{f'{LAW}__kappa': kappa, f'{LAW}__rate': rate}
    )
    theta, filtered = at.scale * THETA, np.zeros(4)
    gradient, last = tracking(at), at.v
    for _ in range(3):
        applied = torque(at, theta)
        np.testing.assert_allclose(tick(controller, at), applied, rtol=1e-9, atol=1e-9)
        theta = theta - at.period * gradient / gamma
        np.testing.assert_allclose(controller.estimate, theta, rtol=1e-9, atol=1e-9)
        last, v = at.v, at.v + 0.01 * rng.normal(size=4)
        at = Instant(at.period, at.position, v, at.desired, at.scale, at.sigma)
        middle = 0.5 * (v + last)
        w = regressor(at.position, middle, middle, (v - last) / at.period)
        error = np.linalg.solve(at.inertia, w @ theta - applied)
        filtered = (filtered + at.period * rate * error) / (1.0 + at.period * rate)
        along = w.T @ filtered
        change = w @ (along / gamma)
        curvature = change @ np.linalg.solve(at.inertia, change) / (along @ (along / gamma))
        gradient = tracking(at) + kappa / (1.0 + at.period * kappa * curvature) * along


@pytest.mark.slow
def test_composite_adaptation_converges_to_theta() -> None:
    """Relative error of every parameter, from half of its value at the start."""
    gamma = ', '.join(f'{0.03 / theta**2:.6g}' for theta in THETA)
    settings = (*EXCITED, f'controller.gamma=[{gamma}]', f'controller.{LAW}.kappa=2.0')
    composite, tracked = (
        np.abs(run(law, *settings, duration=10.0).estimate[-1] / THETA - 1.0)
        for law in (LAW, 'rasmc')
    )
    assert composite.max() < 0.05
    assert tracked.max() > 0.5


def test_composite_adaptation_after_pause_ignores_prediction() -> None:
    """After a pause only the tracking error moves theta_hat, as in rasmc."""
    controller, at = at_random(0, LAW)
    reference, _ = at_random(0, 'rasmc')
    for known in (controller, reference):
        tick(known, at)
    controller.output_not_applied()
    reference.output_not_applied()
    for known in (controller, reference):
        tick(known, at)
    assert (controller.estimate == reference.estimate).all()


@pytest.mark.slow
def test_composite_adaptation_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.05
