# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Sliding mode with a fuzzy network: torque formula and balance of its Lyapunov function."""

from __future__ import annotations

from helpers.fuzzy_rules import FIVE, gaussians, pairs
from helpers.lagrangian import matrices
from helpers.law_bench import at_random, run, tick
from helpers.robots import DEFAULT
import numpy as np
import pytest

LAW = 'hybrid_network'


@pytest.mark.parametrize('seed', range(20))
def test_hybrid_network_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ('k', 'gamma', 'rate', 'delta', 'velocity_span', 'error_span')
    values = dict(zip(names, rng.uniform(0.2, 20.0, (6, 4)), strict=True))
    leak = rng.uniform(0.0, 5.0)
    controller, at = at_random(
        seed,
        LAW,
        **{f'{LAW}__{name}': tuple(value) for name, value in values.items()},
        **{f'{LAW}__leak': leak},
    )
    v_r, a_r = at.reference
    z, decay = at.v - v_r, 1.0 + at.period * leak
    phi = pairs(
        gaussians(v_r / values['velocity_span'], FIVE),
        gaussians(z / values['error_span'], FIVE),
    )
    weights, robust = np.zeros((4, 25)), np.zeros(4)
    for _ in range(4):
        a = a_r - values['k'] * z - (weights * phi).sum(axis=1)
        a -= robust * np.clip(z / values['delta'], -1.0, 1.0)
        wanted = at.inertia @ a + at.coriolis @ at.v
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)
        weights = (weights + at.period * (values['gamma'] * z)[:, None] * phi) / decay
        beyond = np.maximum(np.abs(z) - values['delta'], 0.0)
        robust = (robust + at.period * values['rate'] * beyond) / decay


@pytest.mark.slow
def test_hybrid_network_lyapunov_function_matches_linear_term() -> None:
    """V = (z^2 + W' W / gamma) / 2 and V' = -K z^2 hold for every joint with the true model."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.{LAW}.leak=0.0',
        f'controller.{LAW}.rate=0.0',
        f'controller.{LAW}.k=3.0',
        f'controller.{LAW}.gamma=100.0',
        duration=0.4,
    )
    z = np.array([
        np.linalg.solve(matrices(DEFAULT, q, rates[3:]).jacobian, s)
        for q, rates, s in zip(track.position, track.velocity, track.surface, strict=True)
    ])
    weights = track.controller.memory['hybrid_network_weights'][0, :, 0].reshape(4, -1)
    stored = (weights**2).sum(axis=1) / (2.0 * 100.0)
    dissipated = (z[0] ** 2 - z[-1] ** 2) / 2.0 - stored
    assert (stored > 0.05 * z[0] ** 2 / 2.0).all()
    np.testing.assert_allclose(dissipated, 3.0 * 0.0005 * (z**2).sum(axis=0), rtol=0.03)


@pytest.mark.slow
def test_hybrid_network_tracks_path() -> None:
    fixed = (f'controller.{LAW}.gamma=0.0', f'controller.{LAW}.rate=0.0')
    plain = run(LAW, *fixed, duration=10.0).settled
    adaptive = run(LAW, duration=10.0).settled
    assert (adaptive < 0.5 * plain).all()
    assert (adaptive < (0.0042, 0.007, 0.0011, 0.0013)).all()
