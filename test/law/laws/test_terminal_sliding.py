# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Terminal sliding mode: against its formula, and that errors end in finite time."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
from helpers.robots import Array
import numpy as np
import pytest

LAW = 'terminal'
GAINS = ('c_1', 'c_2', 'k_1', 'k_2')


def wanted(error: Array, rate: Array, c_1: Array, c_2: Array, k_1: Array, k_2: Array) -> Array:
    """Return xddot_c - xddot_d as Yang and Yang have it, with exponents 2 and 3/2."""
    surface = error + c_1 * np.sign(error) * error**2 + c_2 * np.sign(rate) * np.abs(rate) ** 1.5
    slope = 1.0 + 2.0 * c_1 * np.abs(error)
    found: Array = (
        -np.sign(rate) * np.abs(rate) ** 0.5 * slope / (1.5 * c_2)
        - k_1 * surface
        - k_2 * np.sign(surface) * np.abs(surface) ** 0.5
    )
    return found


@pytest.mark.parametrize('seed', range(20))
def test_it_is_its_formula(seed: int) -> None:
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


def test_errors_end_when_the_differential_equation_says_so() -> None:
    """With the true model e'' of each axis is the formula; it is integrated here by itself."""
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
    found, part = [], 20
    step = 0.0005 / part
    for _ in track.time:
        found.append(error)
        for _ in range(part):
            rate = rate + step * wanted(error, rate, *gains)
            error = error + step * rate
    expected = np.array(found)
    size = np.abs(expected[0]).max()
    assert np.abs(track.error - expected).max() < 0.02 * size
    # A linear surface as fast at 1 cm would still have e^-8 of it.
    assert np.abs(track.error[-1000:]).max() < 1e-5 * size


def test_it_follows_the_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02
