# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reduced disturbance adaptation while the wheels slip (slip_backoff)."""

from __future__ import annotations

from helpers.lagrangian import matrices
from helpers.robots import Array, DEFAULT
from helpers.scenario import law_records, Scenario
from masmc_ros.jit.record import fill
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, MEASURED
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.loop.signals import inputs
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

SCALE = 0.05
REFERENCE = [0.8, 0.6, 0.1, 0.0, 0.2, 0.1, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0]
POSITION = np.array([0.0, 0.0, 0.4, 0.0, 0.0, 0.7, -1.2])
RATES = np.array([1.0, 2.0, 0.5, -0.4])


def estimate(slip: Array, backoff: float, source: int = MEASURED) -> Array:
    """Return the disturbance estimate in N after two ticks with a slipping base."""
    extra = (('slip_backoff', backoff), ('velocity_source', source), ('estimator_bandwidth', 1e3))
    scenario = Scenario(law='smc', switching='implicit', observer_gain=0.5, extra=extra)
    settings, memory = law_records(scenario)
    signals = records.signals(TWO_LINK)
    velocity = matrices(DEFAULT, POSITION, RATES).null_space @ RATES
    velocity[:3] += slip
    fill(signals, 'position', POSITION)
    fill(signals, 'velocity', velocity)
    fill(signals, 'reference', REFERENCE)
    for _ in range(2):
        control_tick(settings, memory, signals, *inputs(signals))
    disturbance: Array = memory['disturbance'][0, :, 0].copy()
    return disturbance


@pytest.mark.parametrize(
    'slip', [(0.05, 0.0, 0.0), (0.0, -0.02, 0.0), (0.0, 0.0, 0.3), (0.3, -0.4, 0.1)]
)
def test_slip_backoff_reduces_disturbance_estimate(slip: tuple[float, float, float]) -> None:
    base_slip = np.array(slip)
    expected = estimate(base_slip, 0.0) / (1.0 + base_slip @ base_slip / SCALE**2)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(estimate(base_slip, SCALE), expected, rtol=1e-9)


def test_slip_backoff_without_slip_leaves_estimate_identical() -> None:
    no_slip = np.zeros(3)
    np.testing.assert_array_equal(estimate(no_slip, SCALE), estimate(no_slip, 0.0))


def test_slip_backoff_estimated_velocities_ignores_slip() -> None:
    slip = np.array([0.3, 0.0, 0.0])
    np.testing.assert_array_equal(
        estimate(slip, SCALE, ESTIMATED), estimate(slip, 0.0, ESTIMATED)
    )
