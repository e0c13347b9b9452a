# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptive super-twisting: torque formula, increase, decrease and bound of the gains."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
from helpers.robots import Array
from masmc_ros.law.sliding.adaptive_super_twisting import realisable_surface
from masmc_ros.law.sliding.super_twisting import surface_rate
import numpy as np
import pytest

LAW = 'adaptive_super_twisting'


def step(s: Array, w: Array, alpha: Array, beta: Array, period: float) -> tuple[Array, Array]:
    """Return nu and the next w; sqrt|z| is the root of a quadratic."""
    zeta, root = s / (period**2 * beta), np.zeros_like(s)
    for i in np.flatnonzero(np.abs(zeta) > 1.0):
        zeta[i] = np.sign(s[i])
        free = period**2 * beta[i] - abs(s[i])
        root[i] = np.roots([1.0, period * alpha[i], free]).max() * zeta[i]
    w_next = w - period * beta * zeta
    return w_next - alpha * root - period * beta * zeta, w_next


@pytest.mark.parametrize('seed', range(20))
def test_adaptive_super_twisting_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    settings = {
        'rate': rng.uniform(10.0, 1e4, 4),
        'zone': rng.uniform(0.1, 0.5, 4),
        'least': rng.uniform(0.5, 5.0, 4),
        'largest': rng.uniform(2.0, 20.0, 4),
        'epsilon': rng.uniform(1.0, 1e4, 4),
    }
    controller, at = at_random(
        seed, LAW, **{f'{LAW}__{name}': tuple(value) for name, value in settings.items()}
    )
    w, alpha = np.zeros(4), settings['least']
    for _ in range(4):
        nu, w = step(at.surface, w, alpha, 2.0 * settings['epsilon'] * alpha, at.period)
        wanted = at.desired[2] - at.sigma * at.error_rate + nu
        np.testing.assert_allclose(
            tick(controller, at), at.model_torque(wanted), rtol=1e-9, atol=1e-9
        )
        side = np.sign(np.abs(at.surface) - settings['zone'])
        alpha = alpha + at.period * settings['rate'] * side
        alpha = np.maximum(np.minimum(alpha, settings['largest']), settings['least'])


def test_realisable_surface_inverts_surface_rate() -> None:
    """For the nu that the law requests, the result is |s|."""
    rng = np.random.default_rng(0)
    for s, w in zip(rng.normal(0.0, 1e-3, 50), rng.normal(0.0, 1.0, 50), strict=True):
        nu = surface_rate(s, w, 5.0, 100.0, 1e-3)
        assert abs(realisable_surface(w, nu, 5.0, 100.0, 1e-3) - abs(s)) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize('amplitude', [10.0, 100.0])
def test_adaptive_super_twisting_gains_stay_bounded(amplitude: float) -> None:
    """The second disturbance exceeds what the gains can reject."""
    largest = np.array([4.0, 5.0, 6.0, 7.0])
    pushed = run(
        LAW,
        f'plant.disturbance.amplitude={[amplitude] * 4}',
        f'controller.{LAW}.largest={largest.tolist()}',
        'controller.torque_limit=[80.0, 80.0, 80.0, 80.0]',
        duration=4.0,
    )
    growth = pushed.controller.memory[f'{LAW}_growth'][0, :, 0]
    assert np.isfinite(pushed.torque).all()
    assert (growth <= largest - 2.0).all()


@pytest.mark.slow
def test_adaptive_super_twisting_constant_push_gains_fall() -> None:
    """A constant disturbance causes no constant s: alpha falls to its minimum."""
    pushed = run(
        LAW,
        'plant.disturbance.amplitude=[6.0, 6.0, 12.0, 12.0]',
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
        'trajectory.line_sine.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'controller.adaptive_super_twisting.zone=0.001',
        duration=6.0,
    )
    assert (pushed.controller.memory[f'{LAW}_growth'][0, :, 0] < 1.0).all()


@pytest.mark.slow
def test_adaptive_super_twisting_gains_fall_near_surface() -> None:
    """Undisturbed gains return to their start values. A disturbance keeps them up."""
    quiet = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        duration=10.0,
    )
    growth = quiet.controller.memory['adaptive_super_twisting_growth'][0, :, 0]
    assert (np.abs(quiet.surface[len(quiet.surface) // 2:]) < 0.02).all()
    assert (growth == 0.0).all()
    pushed = run(LAW, 'plant.disturbance.amplitude=[6.0, 6.0, 12.0, 12.0]', duration=10.0)
    assert pushed.controller.memory['adaptive_super_twisting_growth'][0, :, 0].max() > 1.0


@pytest.mark.slow
def test_adaptive_super_twisting_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02
