# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Terminal sliding mode: torque formula and finite settling time of errors."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
from helpers.robots import Array
from masmc_ros.law.sliding.terminal import commanded_acceleration
import numpy as np
import pytest

LAW = 'terminal'
GAINS = ('c_1', 'c_2', 'k_1', 'k_2')


def wanted(error: Array, rate: Array, c_1: Array, c_2: Array, k_1: Array, k_2: Array) -> Array:
    """Return xddot_c - xddot_d as defined by Yang and Yang, with exponents 2 and 3/2."""
    surface = error + c_1 * np.sign(error) * error**2 + c_2 * np.sign(rate) * np.abs(rate) ** 1.5
    slope = 1.0 + 2.0 * c_1 * np.abs(error)
    acceleration: Array = (
        -np.sign(rate) * np.abs(rate) ** 0.5 * slope / (1.5 * c_2)
        - k_1 * surface
        - k_2 * np.sign(surface) * np.abs(surface) ** 0.5
    )
    return acceleration


@pytest.mark.parametrize('seed', range(20))
def test_terminal_sliding_torque_matches_formula(seed: int) -> None:
    gains = np.random.default_rng(seed).uniform(0.1, 50.0, (4, 4))
    controller, at = at_random(
        seed,
        LAW,
        **{f'{LAW}__{name}': tuple(gain) for name, gain in zip(GAINS, gains, strict=True)},
    )
    acceleration = at.desired[2] + wanted(at.error, at.error_rate, *gains)
    np.testing.assert_allclose(
        tick(controller, at), at.model_torque(acceleration), rtol=1e-9, atol=1e-9
    )


def test_terminal_sliding_error_ends_in_finite_time() -> None:
    """
    On the surface |e|^(1/3) decreases linearly.

    Two decades of e thus last shorter, from 1e-5 to 1e-7 a fifth of those from 1e-3. On a linear
    surface they last equally long.
    """
    c_2, step = 0.5, 1e-4
    e, rate, last = 0.2, 0.0, {}
    for k in range(20000):
        for size in (1e-3, 1e-5, 1e-7):
            if abs(e) > size:
                last[size] = k * step
        rate += step * commanded_acceleration(0.0, e, rate, 1.0, c_2, 400.0, 200.0)
        e += step * rate
    coarse, fine = last[1e-5] - last[1e-3], last[1e-7] - last[1e-5]
    assert coarse < 3.0 * c_2 ** (2.0 / 3.0) * 0.1
    assert 0.0 < fine < 0.3 * coarse
    assert abs(e) < 1e-9


@pytest.mark.slow
def test_terminal_sliding_errors_match_differential_equation() -> None:
    """With the true model, e'' of every axis is the formula; the test integrates it separately."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        'plant.integrator_step=0.00025',
        duration=4.0,
    )
    gains = [np.array(track.controller.values[f'{LAW}.{name}']) for name in GAINS]
    error, rate = track.error[0], track.surface[0] - 2.0 * track.error[0]
    errors, substeps = [], 20
    step = 0.0005 / substeps
    for _ in track.time:
        errors.append(error)
        for _ in range(substeps):
            rate = rate + step * wanted(error, rate, *gains)
            error = error + step * rate
    expected = np.array(errors)
    size = np.abs(expected[0]).max()
    assert np.abs(track.error - expected).max() < 0.02 * size
    # A linear surface with the same speed at 1 cm would still have a remainder of e^-8.
    assert np.abs(track.error[-1000:]).max() < 1e-5 * size


@pytest.mark.slow
def test_terminal_sliding_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02
