# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Sliding mode with radial basis functions: torque formula and bounded weights."""

from __future__ import annotations

from helpers.fuzzy_rules import FIVE, gaussians, pairs
from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'rbf_sliding'


@pytest.mark.parametrize('seed', range(20))
def test_rbf_sliding_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, k_s = rng.uniform(1.0, 50.0, (2, 4))
    rate, nu = rng.uniform(100.0, 9000.0), rng.uniform(0.0, 0.1)
    controller, at = at_random(
        seed,
        LAW,
        **{
            f'{LAW}__k': tuple(k),
            f'{LAW}__k_s': tuple(k_s),
            f'{LAW}__rate': rate,
            f'{LAW}__nu': nu,
        },
    )
    s, (v_r, a_r) = at.surface, at.reference
    phi = pairs(
        gaussians((at.desired[1] - at.sigma * at.error) / 0.5, FIVE),
        gaussians((at.desired[2] - at.sigma * at.error_rate) / 1.0, FIVE),
    )
    weights = np.zeros((4, 25))
    for _ in range(3):
        u = (weights * phi).sum(axis=1) - k * s - k_s * np.clip(s / 0.2, -1.0, 1.0)
        wanted = at.inertia @ a_r + at.coriolis @ v_r + at.jacobian.T @ u
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)
        weights -= at.period * rate * phi * s[:, None]
        weights /= 1.0 + at.period * rate * nu * np.linalg.norm(s)


@pytest.mark.slow
def test_rbf_sliding_weights_stay_within_bound_of_nu() -> None:
    """The bound |W| <= 1 / nu holds for any adaptation rate and any command."""
    nu, rate = f'controller.{LAW}.nu=0.05', f'controller.{LAW}.rate=50000.0'
    weights = run(LAW, nu, rate, duration=8.0).controller.memory['rbf_sliding_weights']
    assert 5.0 < np.abs(weights).max() <= 20.0
    unbounded = run(LAW, f'controller.{LAW}.nu=0.0', rate, duration=8.0)
    assert np.abs(unbounded.controller.memory['rbf_sliding_weights']).max() > 20.0


@pytest.mark.slow
def test_rbf_sliding_network_reduces_tracking_error() -> None:
    plain = run(LAW, f'controller.{LAW}.rate=0.0', duration=10.0).settled
    adaptive = run(LAW, duration=10.0).settled
    assert (adaptive < 0.5 * plain).all()
    assert (adaptive < (0.0011, 0.0012, 0.0073, 0.0115)).all()
