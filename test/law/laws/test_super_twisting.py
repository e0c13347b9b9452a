# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Super-twisting: formula, finite reaching time, order of accuracy, absence of chattering."""

from __future__ import annotations

import math
from typing import Any

from helpers.law_bench import at_random, run, tick
from helpers.robots import Array
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.parts.inverse_dynamics import surface_torque
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.sliding.super_twisting import (
    integrated,
    Memory,
    Settings,
    surface_rate,
)
from masmc_ros.law.tick import Tick
import numpy as np
import pytest

LAW = 'super_twisting'

QUIET = (
    'controller.model_scale=1.0',
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
)


def step(s: Array, w: Array, k_1: Array, k_2: Array, period: float) -> tuple[Array, Array]:
    """Return nu and the next w; bisection finds the root of a function monotone in z."""
    nu, w_next = np.empty_like(s), np.empty_like(s)
    for i, (x, y, one, two) in enumerate(zip(s, w, k_1, k_2, strict=True)):
        beyond = max(abs(x) - period**2 * two, 0.0)
        low, high = 0.0, beyond
        for _ in range(200):
            middle = 0.5 * (low + high)
            exceeds = middle + period * one * math.sqrt(middle) > beyond
            low, high = (low, middle) if exceeds else (middle, high)
        z = math.copysign(0.5 * (low + high), x)
        root = one * math.copysign(math.sqrt(abs(z)), x)
        zeta = (x - z - period * root) / (period**2 * two)
        assert abs(zeta) < 1.0 + 1e-9
        w_next[i] = y - period * two * zeta
        nu[i] = w_next[i] - root - period * two * zeta
    return nu, w_next


@pytest.mark.parametrize('seed', range(20))
def test_super_twisting_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k_1, k_2 = rng.uniform(1.0, 100.0, 4), 10.0 ** rng.uniform(1.0, 6.0, 4)
    controller, at = at_random(
        seed, LAW, super_twisting__k_1=tuple(k_1), super_twisting__k_2=tuple(k_2)
    )
    w = np.zeros(4)
    for _ in range(3):
        nu, w = step(at.surface, w, k_1, k_2, at.period)
        wanted = at.desired[2] - at.sigma * at.error_rate + nu
        np.testing.assert_allclose(
            tick(controller, at), at.model_torque(wanted), rtol=1e-9, atol=1e-9
        )


@pytest.mark.slow
def test_super_twisting_reaches_surface_in_predicted_steps() -> None:
    """With the true model and no disturbance every axis follows the scalar recursion."""
    track = run(LAW, *QUIET, duration=1.0)
    s, w = track.surface[0], np.zeros(4)
    k_1, k_2 = np.full(4, 15.0), np.full(4, 110.0)
    predicted = []
    for _ in range(len(track.time)):
        predicted.append(s)
        nu, w = step(s, w, k_1, k_2, 0.001)
        s = s + 0.001 * nu
    expected = np.array(predicted)
    start = np.abs(expected).max()
    reached = [
        int(np.flatnonzero(np.abs(expected[:, i]) > 1e-9 * start)[-1]) + 1 for i in range(4)
    ]
    assert max(reached) < 900
    assert np.abs(track.surface - expected).max() < 0.02 * start
    for i, first in enumerate(reached):
        assert np.abs(track.surface[first + 50:, i]).max() < 1e-4 * start


@pytest.mark.parametrize('period', [0.002, 0.001, 0.0005])
def test_super_twisting_accuracy_is_period_squared(period: float) -> None:
    """After a finite time |s| <= L T^2, and no more than that, for k_2 > L."""
    slope, frequency, k_1, k_2 = 100.0, 3.0, 15.0, 110.0
    s, w, largest = 0.3, 0.0, 0.0
    for k in range(round(8.0 / period)):
        nu = surface_rate(s, w, k_1, k_2, period)
        w = integrated(w, nu, k_2, period)
        s += period * (nu + slope / frequency * math.sin(frequency * k * period))
        largest = max(largest, abs(s)) if k * period > 4.0 else 0.0
    assert 0.99 * slope * period**2 < largest < 1.001 * slope * period**2


@pytest.mark.slow
def test_super_twisting_half_period_quarters_surface() -> None:
    """The paper's experiment with half of the masses and its disturbance."""
    surface = [
        np.abs(run(LAW, f'control_period={period}', duration=10.0).surface)
        for period in (0.002, 0.001)
    ]
    coarse, fine = (values[len(values) // 2:].max(axis=0) for values in surface)
    assert (coarse / fine > 3.6).all()
    assert (coarse / fine < 4.4).all()


def test_super_twisting_integral_follows_commanded_torque() -> None:
    """Without limits w changes as requested; with limits it approaches the applied nu."""
    rng = np.random.default_rng(0)
    for s, w in zip(rng.normal(0.0, 1e-3, 50), rng.normal(0.0, 1.0, 50), strict=True):
        nu = surface_rate(s, w, 15.0, 110.0, 1e-3)
        requested = step(*(np.array([x]) for x in (s, w, 15.0, 110.0)), 1e-3)
        assert abs(nu - requested[0][0]) < 1e-9
        assert abs(integrated(w, nu, 110.0, 1e-3) - requested[1][0]) < 1e-9
        for applied in (-1.0, 0.0, 1.0):
            following = integrated(w, applied, 110.0, 1e-3)
            assert abs(following - applied) <= abs(w - applied)


@formula
def _explicit(s: float, w: float, k_1: float) -> float:
    return w - k_1 * math.sqrt(abs(s)) * sign(s)


@formula
def _integrated(w: float, s: float, k_2: float, period: float) -> float:
    return w - period * k_2 * sign(s)


@formula
def _torque(settings: Any, tick: Tick, memory: Any) -> tuple[float, ...]:
    w = memory.super_twisting_w
    nu = elementwise(_explicit, tick.surface, w, settings.super_twisting_k_1)
    k_2 = settings.super_twisting_k_2
    w = elementwise(_integrated, w, tick.surface, k_2, tick.period)
    memory.super_twisting_w = w
    return surface_torque(tick, memory.estimate, settings.sigma, nu)


@pytest.mark.slow
def test_super_twisting_chatters_less_than_explicit_form(monkeypatch: pytest.MonkeyPatch) -> None:
    explicit = Law('explicit_twisting', _torque, Settings, Memory, uses_switching=False)
    monkeypatch.setitem(registry.LAWS, explicit.name, explicit)
    implicit, chattering = (
        np.abs(np.diff(run(name, *QUIET, duration=4.0).torque[2000:], axis=0)).sum()
        for name in (LAW, explicit.name)
    )
    assert implicit < 0.2 * chattering


@pytest.mark.slow
def test_super_twisting_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 1e-4
