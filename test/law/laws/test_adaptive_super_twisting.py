# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptive super-twisting: torque formula, increase and decrease of the gains."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
from helpers.robots import Array
import numpy as np
import pytest

LAW = 'adaptive_super_twisting'


def step(s: Array, w: Array, alpha: Array, beta: Array, period: float) -> tuple[Array, Array]:
    """Return nu and the next w; sqrt|s+| is the root of a quadratic."""
    b = s + period * w
    nu, w_next = -s / period, -s / period
    for i in np.flatnonzero(np.abs(b) > period**2 * beta):
        root = np.roots([1.0, period * alpha[i], period**2 * beta[i] - abs(b[i])]).max()
        w_next[i] = w[i] - period * beta[i] * np.sign(b[i])
        nu[i] = -alpha[i] * root * np.sign(b[i]) + w_next[i]
    return nu, w_next


@pytest.mark.parametrize('seed', range(20))
def test_adaptive_super_twisting_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gains = {
        'rate': rng.uniform(10.0, 1e4, 4),
        'zone': rng.uniform(0.1, 0.5, 4),
        'least': rng.uniform(0.5, 5.0, 4),
        'epsilon': rng.uniform(1.0, 1e4, 4),
    }
    controller, at = at_random(
        seed, LAW, **{f'{LAW}__{name}': tuple(value) for name, value in gains.items()}
    )
    w, alpha = np.zeros(4), gains['least']
    for _ in range(4):
        nu, w = step(at.surface, w, alpha, 2.0 * gains['epsilon'] * alpha, at.period)
        wanted = at.desired[2] - at.sigma * at.error_rate + nu
        np.testing.assert_allclose(
            tick(controller, at), at.model_torque(wanted), rtol=1e-9, atol=1e-9
        )
        side = np.sign(np.abs(at.surface) - gains['zone'])
        alpha = np.maximum(alpha + at.period * gains['rate'] * side, gains['least'])


def test_adaptive_super_twisting_gains_fall_near_surface() -> None:
    """Undisturbed gains return to their start values. A disturbance keeps them up."""
    undisturbed = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        duration=10.0,
    )
    growth = undisturbed.controller.memory['adaptive_super_twisting_growth'][0, :, 0]
    assert (np.abs(undisturbed.surface[len(undisturbed.surface) // 2:]) < 0.02).all()
    assert (growth == 0.0).all()
    disturbed = run(LAW, 'plant.disturbance.amplitude=[6.0, 6.0, 12.0, 12.0]', duration=10.0)
    assert disturbed.controller.memory['adaptive_super_twisting_growth'][0, :, 0].max() > 1.0


def test_adaptive_super_twisting_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02
