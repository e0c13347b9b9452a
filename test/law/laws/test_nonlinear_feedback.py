# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nonlinear feedback: torque formula and theoretical decay of errors."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'nonlinear_feedback'


@pytest.mark.parametrize('seed', range(20))
def test_nonlinear_feedback_torque_matches_formula(seed: int) -> None:
    gains = np.random.default_rng(seed).uniform(1.0, 50.0, (3, 4))
    names = ('k_p', 'k_d', 'k_i')
    controller, at = at_random(
        seed,
        LAW,
        **{f'{LAW}__{name}': tuple(gain) for name, gain in zip(names, gains, strict=True)},
    )
    k_p, k_d, k_i = gains
    first, second = tick(controller, at), tick(controller, at)
    for torque, integral in ((first, 0.0 * at.error), (second, at.period * at.error)):
        wanted = at.desired[2] - k_d * at.error_rate - k_p * at.error - k_i * integral
        np.testing.assert_allclose(torque, at.model_torque(wanted), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_nonlinear_feedback_true_model_has_second_order_decay() -> None:
    """Critically damped (k_d**2 = 4 k_p), without a disturbance: e(t) = e_0 (1 + 10 t) e^-10t."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.{LAW}.k_p=100.0',
        f'controller.{LAW}.k_d=20.0',
        duration=2.0,
    )
    decay = (1.0 + 10.0 * track.time) * np.exp(-10.0 * track.time)
    start, rate = track.error[0], track.surface[0] - 2.0 * track.error[0]
    expected = start * decay[:, None] + rate * (track.time * np.exp(-10.0 * track.time))[:, None]
    assert np.abs(track.error - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.slow
def test_nonlinear_feedback_integral_reduces_constant_error() -> None:
    """The integral removes the error of a constant force, within the speed of the arm."""
    constant = (
        'controller.model_scale=1.0',
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
    )
    plain = run(LAW, *constant, duration=10.0).settled
    with_integral = run(LAW, *constant, f'controller.{LAW}.k_i=8100.0', duration=10.0).settled
    assert (with_integral < 0.6 * plain).all()
