# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The disturbance estimate follows less where the base moves other than its wheels roll."""

from __future__ import annotations

from lagrangian import matrices
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, MEASURED
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.loop.signals import inputs
from masmc_ros.numerics.record import fill
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest
from robots import Array, DEFAULT
from scenario import law_records, Scenario

SCALE = 0.05
REFERENCE = [0.8, 0.6, 0.1, 0.0, 0.2, 0.1, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0]
POSITION = np.array([0.0, 0.0, 0.4, 0.0, 0.0, 0.7, -1.2])
RATES = np.array([1.0, 2.0, 0.5, -0.4])


def estimate(slip: Array, backoff: float, source: int = MEASURED) -> Array:
    """Return the disturbance estimate in N after two ticks at which the base slips so."""
    extra = (('slip_backoff', backoff), ('velocity_source', source), ('estimator_bandwidth', 1e3))
    scenario = Scenario(law='smc', switching='implicit', observer_gain=0.5, extra=extra)
    settings, memory = law_records(scenario)
    now = records.signals(TWO_LINK)
    velocity = matrices(DEFAULT, POSITION, RATES).null_space @ RATES
    velocity[:3] += slip
    fill(now, 'position', POSITION)
    fill(now, 'velocity', velocity)
    fill(now, 'reference', REFERENCE)
    for _ in range(2):
        control_tick(settings, memory, now, *inputs(now))
    found: Array = memory['disturbance'][0, :, 0].copy()
    return found


@pytest.mark.parametrize(
    'slip', [(0.05, 0.0, 0.0), (0.0, -0.02, 0.0), (0.0, 0.0, 0.3), (0.3, -0.4, 0.1)]
)
def test_it_follows_by_as_much_less_as_it_slips(slip: tuple[float, float, float]) -> None:
    at = np.array(slip)
    expected = estimate(at, 0.0) / (1.0 + at @ at / SCALE**2)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(estimate(at, SCALE), expected, rtol=1e-9)


def test_where_wheels_roll_its_bits_are_those_without() -> None:
    rolls = np.zeros(3)
    np.testing.assert_array_equal(estimate(rolls, SCALE), estimate(rolls, 0.0))


def test_rates_that_are_not_measured_tell_of_no_slip() -> None:
    slip = np.array([0.3, 0.0, 0.0])
    np.testing.assert_array_equal(
        estimate(slip, SCALE, ESTIMATED), estimate(slip, 0.0, ESTIMATED)
    )
