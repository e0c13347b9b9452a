# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Computed torque in quasi-velocities: torque formula and theoretical decay of errors."""

from __future__ import annotations

from helpers.lagrangian import matrices
from helpers.law_bench import at_random, run, tick
from helpers.robots import DEFAULT
import numpy as np
import pytest

LAW = 'computed_torque'


@pytest.mark.parametrize('seed', range(20))
def test_computed_torque_matches_formula(seed: int) -> None:
    k_d, k_p = np.random.default_rng(seed).uniform(1.0, 50.0, (2, 4))
    controller, at = at_random(seed, LAW, **{f'{LAW}__k_d': tuple(k_d), f'{LAW}__k_p': tuple(k_p)})
    v_r, a_r = at.reference
    z = at.v - v_r
    for k in range(3):
        a = a_r - k_d * z - k_p * k * at.period * z
        wanted = at.inertia @ a + at.coriolis @ at.v
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


def test_computed_torque_zero_sigma_ignores_position_error() -> None:
    """Without sigma the robot position changes nothing except J."""
    controller, at = at_random(3, LAW, sigma=(0.0, 0.0, 0.0, 0.0))
    torque = tick(controller, at)
    controller.reset()
    at.desired[0] += 0.3
    np.testing.assert_array_equal(tick(controller, at), torque)


@pytest.mark.slow
def test_computed_torque_true_model_has_second_order_decay() -> None:
    """Critically damped, with the true model and no disturbance: z = z_0 (1 - 10 t) e^-10t."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.{LAW}.k_p=100.0',
        f'controller.{LAW}.k_d=20.0',
        duration=1.0,
    )
    some = slice(0, None, 40)
    z = np.array([
        np.linalg.solve(matrices(DEFAULT, q, rates[3:]).jacobian, s)
        for q, rates, s in zip(
            track.position[some], track.velocity[some], track.surface[some], strict=True
        )
    ])
    t = track.time[some, None]
    expected = z[0] * (1.0 - 10.0 * t) * np.exp(-10.0 * t)
    assert (np.abs(z - expected).max(axis=0) < 0.01 * np.abs(z[0]).max()).all()


@pytest.mark.slow
def test_computed_torque_tracks_path() -> None:
    """Half of the true masses: the bounds hold for gains that dominate the model error."""
    assert (run(LAW, duration=10.0).settled < (0.013, 0.018, 0.0055, 0.0055)).all()
