# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Integrals of laws under torque limits: back-calculation per joint, no wind-up."""

from __future__ import annotations

from helpers.law_bench import at_random, Instant, tick
from helpers.robots import Array
from masmc_ros.law.parts.integral import integrated
from masmc_ros.loop.controller import Controller
import numpy as np
import pytest

GAINS = {
    'pid': ('k_p', 'k_i'),
    'nonlinear_feedback': ('k_p', 'k_i'),
    'computed_torque': ('k_d', 'k_p'),
}
"""Names of the gains of the error and of its integral."""


def integral(controller: Controller, law: str) -> Array:
    """Return w (4)."""
    value: Array = controller.memory[f'{law}_integral'][0, :, 0].copy()
    return value


def error_and_excess(law: str, at: Instant, change: Array) -> tuple[Array, Array]:
    """Return the integrated error (4) and what a change of the torque (4) is in the law's unit."""
    if law == 'pid':
        return at.error, np.linalg.solve(at.jacobian.T, change)
    a = np.linalg.solve(at.inertia, change)
    if law == 'computed_torque':
        return at.v - at.reference[0], a
    return at.error, at.jacobian @ a


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('law', GAINS)
def test_integral_one_limited_joint_is_back_calculated(law: str, seed: int) -> None:
    """The integral moves on all axes, by the error that fits the commanded torque."""
    rng = np.random.default_rng(seed)
    gains = dict(zip(GAINS[law], rng.uniform(10.0, 500.0, (2, 4)), strict=True))
    named = {f'{law}__{name}': tuple(value) for name, value in gains.items()}
    controller, at = at_random(seed, law, torque_limit=(0.01, 0.0, 0.0, 0.0), **named)
    k_p, k_i = gains.values()
    w = np.zeros(4)
    for _ in range(3):
        change = -tick(controller, at) + controller.torque
        assert (change != 0.0).tolist() == [True, False, False, False]
        error, excess = error_and_excess(law, at, change)
        w = w + at.period * (error - excess / (k_p + at.period * k_i))
        np.testing.assert_allclose(integral(controller, law), w, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize('law', GAINS)
def test_integral_constant_limits_converges(law: str) -> None:
    """At a constant error it converges to the value that fits the commanded torque."""
    named = {f'{law}__{name}': (gain,) * 4 for name, gain in zip(
        GAINS[law], (100.0, 500.0), strict=True
    )}
    controller, at = at_random(0, law, torque_limit=(0.01,) * 4, **named)
    for _ in range(4000):
        tick(controller, at)
    settled = integral(controller, law)
    for _ in range(1000):
        tick(controller, at)
    np.testing.assert_allclose(integral(controller, law), settled, rtol=1e-6, atol=1e-9)
    error, excess = error_and_excess(law, at, controller.torque - controller.raw_torque)
    np.testing.assert_allclose(excess, 100.5 * error, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize('k_p', [0.0, 1e-3, 1.0, 1e3])
@pytest.mark.parametrize('k_i', [0.0, 1.0, 1e5])
def test_integral_back_calculation_any_gains_is_stable(k_p: float, k_i: float) -> None:
    w = 0.0
    for _ in range(20000):
        w = integrated(w, 0.1, 2.0 + k_p * 0.1 + k_i * w, k_p, k_i, 1e-3)
    assert abs(w) < 1e4
