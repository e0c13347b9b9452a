# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Barrier function law: torque formula, and s stays within the barrier."""

from __future__ import annotations

import math

from helpers.law_bench import at_random, run, tick
from masmc_ros.law.sliding.barrier import grown, is_inside, surface_rate
import numpy as np
import pytest

LAW = 'barrier'
WIDTH, GAIN = 0.02, 50.0


def next_distance(s: float, width: float, disturbance: float) -> float:
    """Return |s+| with y + disturbance y / (width - y) = |s|, by bisection."""
    low, high = 0.0, width
    for _ in range(200):
        middle = 0.5 * (low + high)
        exceeds = middle >= width or middle + disturbance * middle / (width - middle) > abs(s)
        low, high = (low, middle) if exceeds else (middle, high)
    return 0.5 * (low + high)


@pytest.mark.parametrize('seed', range(20))
def test_barrier_torque_matches_formula(seed: int) -> None:
    """Axes within eps / 2 are inside the barrier at once; the others have a growing gain."""
    rng = np.random.default_rng(seed)
    settings = {
        'width': rng.uniform(0.1, 2.0, 4),
        'gain': rng.uniform(1.0, 1e3, 4),
        'start': rng.uniform(1.0, 50.0, 4),
        'growth': rng.uniform(1.0, 1e4, 4),
    }
    controller, at = at_random(
        seed, LAW, **{f'{LAW}__{name}': tuple(value) for name, value in settings.items()}
    )
    size, outside = np.abs(at.surface), settings['start'].copy()
    inside = size <= 0.5 * settings['width']
    for _ in range(3):
        next_size = [
            next_distance(s, width, at.period * gain) if active else max(s - at.period * k, 0.0)
            for s, width, gain, active, k in zip(
                size, settings['width'], settings['gain'], inside, outside, strict=True
            )
        ]
        nu = np.sign(at.surface) * (np.array(next_size) - size) / at.period
        wanted = at.desired[2] - at.sigma * at.error_rate + nu
        np.testing.assert_allclose(
            tick(controller, at), at.model_torque(wanted), rtol=1e-9, atol=1e-8
        )
        grows = ~inside & (size > at.period * outside)
        outside += np.where(grows, at.period * settings['growth'] * size, 0.0)


def largest_disturbance(period: float) -> float:
    """Return the disturbance in m/s² that moves s to the barrier in a period."""
    half = 0.5 * GAIN
    return math.sqrt(GAIN * WIDTH / period + half**2) - half


@pytest.mark.parametrize('period', [0.0005, 0.001, 0.01])
def test_barrier_sampled_bound_is_sharp(period: float) -> None:
    """A constant disturbance below the bound of the docs leaves s within, one above does not."""
    for share, stays in ((0.999, True), (1.001, False)):
        s, largest = 0.0, 0.0
        for _ in range(300):
            nu = surface_rate(s, 1.0, 0.0, 0.0, WIDTH, GAIN, period)
            s += period * (nu + share * largest_disturbance(period))
            largest = max(largest, abs(s))
        assert (largest < WIDTH) == stays


@pytest.mark.parametrize('disturbance', [8.0, 12.0])
def test_barrier_gain_outside_grows_until_surface_is_reached(disturbance: float) -> None:
    """
    The gain exceeds an unknown disturbance after a finite time, and is constant then.

    The second disturbance moves s by more than eps / 2 per period, so s stays outside.
    """
    period, start = 0.001, 2.0
    s, inside, growth, gains = 0.3, 0.0, 0.0, []
    for _ in range(2000):
        inside = is_inside(inside, s, WIDTH)
        nu = surface_rate(s, inside, growth, start, WIDTH, GAIN, period)
        growth = grown(growth, inside, s, nu, start, 0.0, 100.0, period)
        gains.append(growth)
        s += period * (nu + disturbance)
    assert disturbance - start < gains[1000] < 25.0
    assert len(set(gains[1000:])) == 1
    assert abs(s) < WIDTH
    assert inside == (period * disturbance < 0.5 * WIDTH)


@pytest.mark.slow
def test_barrier_disturbance_within_bound_is_not_left() -> None:
    """
    From eps the law moves s back by sqrt(T rho eps + (T rho / 2)^2) - T rho / 2.

    A disturbance below that step per period, in m/s2, cannot move s to eps.
    """
    assert largest_disturbance(0.001) > 15.0
    track = run(LAW, 'controller.model_scale=1.0', duration=10.0)
    size = np.abs(track.surface)
    for axis in size.T:
        entered = int(np.flatnonzero(axis <= 0.5 * WIDTH)[0])
        assert entered < 3000
        assert axis[entered:].max() < WIDTH


@pytest.mark.slow
def test_barrier_disturbance_beyond_bound_is_left() -> None:
    """The previous test can fail: this disturbance exceeds the bound."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[4.5, 4.5, 9.0, 9.0]',
        duration=2.0,
    )
    assert np.abs(track.surface[1000:]).max() > WIDTH


@pytest.mark.slow
def test_barrier_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.02


def test_barrier_end_without_gain_finite() -> None:
    """The radicand is zero at s = eps; rounding next to it must not make it negative."""
    for s in 0.02 + 1e-9 * np.linspace(-1.0, 1.0, 5001):
        assert math.isfinite(surface_rate(s, 1.0, 10.0, 1.0, WIDTH, 0.0, 0.001))
