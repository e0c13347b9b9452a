# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""PID: torque formula, integral term and its anti-windup."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'pid'


@pytest.mark.parametrize('seed', range(20))
def test_pid_torque_matches_formula(seed: int) -> None:
    k_p, k_d, k_i = np.random.default_rng(seed).uniform(1.0, 500.0, (3, 4))
    controller, at = at_random(
        seed, LAW, pid__k_p=tuple(k_p), pid__k_d=tuple(k_d), pid__k_i=tuple(k_i)
    )
    for passed in range(3):
        force = -k_p * at.error - k_d * at.error_rate - k_i * passed * at.period * at.error
        np.testing.assert_allclose(
            tick(controller, at), at.jacobian.T @ force, rtol=1e-9, atol=1e-9
        )


@pytest.mark.slow
def test_pid_sufficient_limits_keep_accuracy() -> None:
    """With drives and noise, E and F are close to those without limits."""
    limited = run(
        LAW,
        'plant.velocity_noise=0.02',
        'controller.torque_limit=[8.0, 8.0, 20.0, 10.0]',
        'controller.torque_rate_limit=[400.0, 400.0, 1000.0, 500.0]',
        duration=10.0,
    )
    free = np.linalg.norm(run(LAW, duration=10.0).settled)
    assert np.linalg.norm(limited.settled) < 1.1 * free


@pytest.mark.slow
def test_pid_integral_reduces_constant_error() -> None:
    constant = (
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
    )
    plain = run(LAW, *constant, 'controller.pid.k_i=0.0', duration=10.0).settled
    assert (run(LAW, *constant, duration=10.0).settled < 0.5 * plain).all()


@pytest.mark.slow
def test_pid_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.05
