# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Fuzzy gain: torque formula and balance of its Lyapunov function."""

from __future__ import annotations

from helpers.fuzzy_rules import gaussians, SEVEN
from helpers.lagrangian import matrices
from helpers.law_bench import at_random, run, tick, Track
from helpers.robots import DEFAULT
import numpy as np
import pytest

LAW = 'fuzzy_gain'


@pytest.mark.parametrize('seed', range(20))
def test_fuzzy_gain_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, gamma = rng.uniform((1.0, 1e2), (50.0, 1e5), (4, 2)).T
    leak, span = rng.uniform(0.0, 5.0), rng.uniform(0.2, 3.0)
    controller, at = at_random(
        seed,
        LAW,
        **{
            f'{LAW}__a': tuple(a),
            f'{LAW}__gamma': tuple(gamma),
            f'{LAW}__leak': leak,
            f'{LAW}__span': span,
        },
    )
    s, (v_r, a_r) = at.surface, at.reference
    psi, theta = gaussians(s / span, SEVEN), np.zeros((4, 7))
    for _ in range(3):
        u = -a * s - (theta * psi).sum(axis=1)
        wanted = at.inertia @ a_r + at.coriolis @ v_r + at.jacobian.T @ u
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)
        theta += at.period * (gamma * s)[:, None] * psi
        theta /= 1.0 + at.period * leak


def energy(track: Track, k: int) -> float:
    """Return s' H_x s / 2 of the true robot at a tick."""
    robot = matrices(DEFAULT, track.position[k], track.velocity[k, 3:])
    v = np.linalg.solve(robot.jacobian, track.surface[k])
    return float(v @ robot.reduced_inertia @ v) / 2.0


@pytest.mark.slow
def test_fuzzy_gain_lyapunov_function_matches_linear_term() -> None:
    """V = (s' H_x s + theta' theta / gamma) / 2 and V' = -s' A s hold with the true model."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.{LAW}.leak=0.0',
        f'controller.{LAW}.a=30.0',
        f'controller.{LAW}.gamma=500.0',
        duration=0.5,
    )
    theta = track.controller.memory['fuzzy_gain_theta']
    stored = float((theta**2).sum()) / (2.0 * 500.0)
    dissipated = 30.0 * 0.0005 * float((track.surface**2).sum())
    start = energy(track, 0)
    assert stored > 0.05 * start
    assert start - energy(track, -1) - stored == pytest.approx(dissipated, rel=0.02)


@pytest.mark.slow
def test_fuzzy_gain_tracks_path() -> None:
    plain = run(LAW, f'controller.{LAW}.gamma=0.0', duration=10.0).settled
    adaptive = run(LAW, duration=10.0).settled
    assert (adaptive < 0.5 * plain).all()
    assert (adaptive < (0.0013, 0.0012, 0.006, 0.0077)).all()
