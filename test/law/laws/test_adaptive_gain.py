# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptive switching gain: torque formula, growth of the gain and its limits."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'adaptive_gain'


@pytest.mark.parametrize('seed', range(20))
def test_adaptive_gain_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, gamma, dead_zone = rng.uniform((1.0, 1e2, 0.0), (50.0, 1e5, 0.3), (4, 3)).T
    leak, k_max = rng.uniform(0.0, 5.0), rng.uniform(5.0, 100.0, 4)
    controller, at = at_random(
        seed,
        LAW,
        **{
            f'{LAW}__k': tuple(k),
            f'{LAW}__gamma': tuple(gamma),
            f'{LAW}__dead_zone': tuple(dead_zone),
            f'{LAW}__leak': leak,
            f'{LAW}__k_max': tuple(k_max),
        },
    )
    s, (v_r, a_r) = at.surface, at.reference
    switching = np.zeros(4)
    for _ in range(4):
        u = -k * s - switching * np.clip(s / 0.2, -1.0, 1.0)
        wanted = at.inertia @ a_r + at.coriolis @ v_r + at.jacobian.T @ u
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)
        switching += at.period * gamma * np.maximum(np.abs(s) - dead_zone, 0.0)
        switching = np.minimum(switching / (1.0 + at.period * leak), k_max)


def test_adaptive_gain_unrejected_surface_gain_stays_bounded() -> None:
    """With a constant s the gain of every axis ends at k_max."""
    k_max = (20.0, 30.0, 40.0, 50.0)
    gains = {'gamma': (1e5,) * 4, 'k_max': k_max, 'leak': 0.0}
    controller, at = at_random(
        1, LAW, **{f'{LAW}__{name}': gain for name, gain in gains.items()}
    )
    assert (np.abs(at.surface) > 0.1).all()
    for _ in range(60):
        tick(controller, at)
    k = controller.memory['adaptive_gain_switching'][0, :, 0]
    np.testing.assert_array_equal(k, k_max)


@pytest.mark.slow
def test_adaptive_gain_grows_above_constant_disturbance() -> None:
    """Without leakage, s ends in the dead zone. The gain stops there, below k_max."""
    track = run(
        LAW,
        'plant.disturbance.amplitude=[0.0, 0.0, 1.0, 1.0]',
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
        f'controller.{LAW}.dead_zone=0.02',
        f'controller.{LAW}.gamma=5000.0',
        f'controller.{LAW}.leak=0.0',
        duration=20.0,
    )
    assert np.abs(track.surface[-2000:]).max() < 0.022
    assert np.abs(track.surface[:2000]).max() > 0.1
    assert (track.controller.memory['adaptive_gain_switching'] < 190.0).all()


@pytest.mark.slow
def test_adaptive_gain_tracks_path() -> None:
    plain = run(LAW, f'controller.{LAW}.gamma=0.0', duration=10.0).settled
    adaptive = run(LAW, duration=10.0).settled
    assert (adaptive < 0.5 * plain).all()
    assert (adaptive < (0.0072, 0.006, 0.0105, 0.0137)).all()
