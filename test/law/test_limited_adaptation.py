# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation behind torque limits: back-calculation per entry, no wind-up."""

from __future__ import annotations

from helpers.law_bench import at_random, tick
from helpers.robots import Array
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.law.parts.realisable import realisable, realisable_part, secant
from masmc_ros.loop.controller import Controller
import numpy as np
import pytest

ADAPTED = {
    'adaptive_gain': 'switching',
    'barrier': 'growth',
    'fuzzy_gain': 'theta',
    'fuzzy_model': 'theta',
    'hybrid_network': 'weights',
    'rbf_sliding': 'weights',
}
"""Adapted fields of laws."""

NUMBER = st.floats(-1e3, 1e3)
SLOPE = st.floats(1e-3, 1e3)


def adapted(controller: Controller, law: str) -> Array:
    """Return what the law adapted, by rows of axes or joints."""
    values: Array = controller.memory[f'{law}_{ADAPTED[law]}'][0].reshape(4, -1).copy()
    return values


@given(NUMBER, NUMBER, SLOPE)
def test_realisable_error_requests_applied_force(error: float, excess: float, k: float) -> None:
    assert -k * realisable(error, excess, k) == pytest.approx(-k * error + excess, abs=1e-9)


@given(NUMBER, NUMBER, st.floats(0.0, 1e3))
def test_realisable_part_lies_between_zero_and_error(
    error: float, excess: float, slope: float
) -> None:
    part = realisable_part(error, excess, slope)
    assert min(0.0, error) <= part <= max(0.0, error)
    assert realisable_part(error, 0.0, slope) == error


@given(NUMBER, SLOPE, SLOPE, SLOPE)
def test_secant_times_error_is_the_switched_feedback(
    error: float, linear: float, switched: float, layer: float
) -> None:
    force = linear * error + switched * np.clip(error / layer, -1.0, 1.0)
    assert secant(linear, switched, error, layer) * error == pytest.approx(force)


@pytest.mark.parametrize('law', ADAPTED)
def test_adaptation_one_limited_joint_does_not_stop_others(law: str) -> None:
    limited, at = at_random(0, law, torque_limit=(0.01, 0.0, 0.0, 0.0))
    free, _ = at_random(0, law)
    raw = tick(limited, at)
    assert (limited.torque != raw).tolist() == [True, False, False, False]
    tick(free, at)
    assert adapted(limited, law)[1:].any(axis=1).all()
    if law == 'fuzzy_model':  # Its rules of a joint depend on the torque of this joint only.
        np.testing.assert_array_equal(adapted(limited, law)[1:], adapted(free, law)[1:])


@pytest.mark.parametrize('law', ADAPTED)
def test_adaptation_constant_limits_does_not_wind_up(law: str) -> None:
    """At a constant state, rules and networks converge; gains grow with the applied part of s."""
    limited, at = at_random(0, law, torque_limit=(0.01,) * 4)
    free, _ = at_random(0, law)
    for _ in range(300):
        tick(limited, at)
        tick(free, at)
    before = adapted(limited, law)
    assert np.abs(before).max() < 0.4 * np.abs(adapted(free, law)).max()
    if law not in ('adaptive_gain', 'barrier'):
        for _ in range(100):
            tick(limited, at)
        change = np.abs(adapted(limited, law) - before).max()
        assert change < 0.1 * np.abs(before).max() + 1e-9
