# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The barrier: against its formula, and that it is not left."""

from __future__ import annotations

import math

from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'barrier'
WIDTH, GAIN = 0.02, 50.0


def held(s: float, width: float, push: float) -> float:
    """Return |s+| with y + push y / (width - y) = |s|, by bisection."""
    low, high = 0.0, width
    for _ in range(200):
        middle = 0.5 * (low + high)
        exceeds = middle + push * middle / (width - middle) > abs(s) if middle < width else True
        low, high = (low, middle) if exceeds else (middle, high)
    return 0.5 * (low + high)


@pytest.mark.parametrize('seed', range(20))
def test_it_is_its_formula(seed: int) -> None:
    """Axes within eps / 2 are behind the barrier at once, others have a gain that grows."""
    rng = np.random.default_rng(seed)
    given = {
        'width': rng.uniform(0.1, 2.0, 4),
        'gain': rng.uniform(1.0, 1e3, 4),
        'start': rng.uniform(1.0, 50.0, 4),
        'growth': rng.uniform(1.0, 1e4, 4),
    }
    controller, at = at_random(
        seed, LAW, **{f'{LAW}__{name}': tuple(value) for name, value in given.items()}
    )
    size, outside = np.abs(at.surface), given['start'].copy()
    is_inside = size <= 0.5 * given['width']
    for _ in range(3):
        following = [
            held(s, width, at.period * gain) if inside else max(s - at.period * k, 0.0)
            for s, width, gain, inside, k in zip(
                size, given['width'], given['gain'], is_inside, outside, strict=True
            )
        ]
        nu = np.sign(at.surface) * (np.array(following) - size) / at.period
        wanted = at.desired[2] - at.sigma * at.error_rate + nu
        np.testing.assert_allclose(
            tick(controller, at), at.model_torque(wanted), rtol=1e-9, atol=1e-8
        )
        outside += np.where(is_inside, 0.0, at.period * given['growth'] * size)


def test_it_is_not_left_by_a_disturbance_that_sampling_lets_it_hold() -> None:
    """
    From eps the law steps back by sqrt(T rho eps + (T rho / 2)^2) - T rho / 2.

    A disturbance below that step per period, in m/s2, cannot take s to eps.
    """
    push = 0.001 * GAIN
    most = (math.sqrt(push * WIDTH + 0.25 * push**2) - 0.5 * push) / 0.001
    assert most > 15.0
    track = run(LAW, 'controller.model_scale=1.0', duration=10.0)
    size = np.abs(track.surface)
    for axis in size.T:
        entered = int(np.flatnonzero(axis <= 0.5 * WIDTH)[0])
        assert entered < 3000
        assert axis[entered:].max() < WIDTH


def test_a_disturbance_three_times_as_large_leaves_it() -> None:
    """The test above can fail."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[4.5, 4.5, 9.0, 9.0]',
        duration=2.0,
    )
    assert np.abs(track.surface[1000:]).max() > WIDTH


def test_it_follows_the_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02
