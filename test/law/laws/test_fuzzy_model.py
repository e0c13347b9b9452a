# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Fuzzy model and fuzzy switching: torque formulas, and independence of the robot model."""

from __future__ import annotations

from helpers.fuzzy_rules import FIVE, pairs, SEVEN, triangles
from helpers.law_bench import at_random, run, tick
import numpy as np
import pytest

LAW = 'fuzzy_model'


@pytest.mark.parametrize('seed', range(20))
def test_fuzzy_model_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ('k', 'k_h', 'gamma', 'gamma_h', 'velocity_span', 'acceleration_span', 'error_span')
    values = dict(zip(names, rng.uniform(1.0, 20.0, (7, 4)), strict=True))
    leak = rng.uniform(0.0, 5.0)
    controller, at = at_random(
        seed,
        LAW,
        **{f'{LAW}__{name}': tuple(value) for name, value in values.items()},
        **{f'{LAW}__leak': leak},
    )
    v_r, a_r = at.reference
    z = at.v - v_r
    xi = pairs(
        triangles(v_r / values['velocity_span'], FIVE),
        triangles(a_r / values['acceleration_span'], FIVE),
    )
    phi = triangles(z / values['error_span'], SEVEN)
    theta, eta = np.zeros((4, 25)), np.zeros((4, 7))
    for _ in range(3):
        h = values['k_h'] * np.clip(z / values['error_span'], -1.0, 1.0)
        h += (eta * phi).sum(axis=1)
        wanted = (theta * xi).sum(axis=1) - values['k'] * z - h
        np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)
        theta -= at.period * (values['gamma'] * z)[:, None] * xi
        eta += at.period * (values['gamma_h'] * z)[:, None] * phi
        theta /= 1.0 + at.period * leak
        eta /= 1.0 + at.period * leak


@pytest.mark.slow
def test_fuzzy_model_constant_disturbance_is_rejected() -> None:
    """
    The rules can represent a constant disturbance; z then falls to a small remainder.

    Without adaptation z stays at d / (K + k_h / span) indefinitely.
    """
    constant = (
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
    )
    fixed = (f'controller.{LAW}.gamma=0.0', f'controller.{LAW}.gamma_h=0.0')
    plain = run(LAW, *constant, *fixed, duration=10.0).settled
    adaptive = run(LAW, *constant, duration=10.0).settled
    assert (adaptive < 0.2 * plain).all()


@pytest.mark.slow
def test_fuzzy_model_torque_is_independent_of_model() -> None:
    half = run(LAW, 'controller.model_scale=0.5', duration=1.0)
    other = run(LAW, 'controller.model_scale=3.0', duration=1.0)
    np.testing.assert_array_equal(half.torque, other.torque)


@pytest.mark.slow
def test_fuzzy_model_tracks_path() -> None:
    assert (run(LAW, duration=10.0).settled < (0.0021, 0.0023, 0.0002, 0.00014)).all()
