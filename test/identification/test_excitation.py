# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Exciting motions within the limits of a robot."""

from __future__ import annotations

from masmc_ros.identification.excitation import exciting_series, limits_of, PERIOD, Series
from masmc_ros.identification.parameter_file import nominal_of
from masmc_ros.identification.regressor import instantaneous
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

TORQUE = np.array([0.6, 0.6, 0.6, 0.3])
"""Limits of the torques in N·m, which reduce the motion."""

ROUNDING = 1.005
"""Largest excess between two evaluated states."""


@pytest.mark.parametrize('duration', [10.0, 198.0, 199.8])
def test_exciting_series_of_any_duration_within_limits(duration: float) -> None:
    scenario = load_scenario('config/paper.yaml')
    nominal = nominal_of({**scenario['controller'], 'model_scale': 1.0})
    start = np.array(scenario['plant']['initial_joints'])
    limits = limits_of(nominal.robot, start, TORQUE, 0.5)
    series, condition = exciting_series(nominal, start, limits, duration, 0)
    assert condition < 1.0e4
    angles, rates, accelerations = series.at(np.linspace(0.0, duration, 40_001))
    position = np.hstack([np.zeros((len(angles), 3)), angles])
    equations = instantaneous(nominal.robot, position, rates, accelerations)
    parameters = np.concatenate([nominal.theta, nominal.friction])
    torque = equations.known + equations.matrix @ parameters
    assert (np.abs(torque).max(axis=0) <= ROUNDING * limits.torque).all()
    assert (np.abs(rates).max(axis=0) <= ROUNDING * limits.speed).all()
    assert (np.abs(angles - start).max(axis=0) <= ROUNDING * limits.deviation).all()
    np.testing.assert_array_equal(limits.torque, 0.8 * TORQUE)


@pytest.mark.parametrize('duration', [10.0, 13.0, 14.0, 30.0, 199.8])
def test_instants_contain_ramps_and_one_period(duration: float) -> None:
    times = Series(np.zeros(1), np.zeros((1, 5)), np.zeros((1, 5)), duration).instants(0.02)
    assert times[0] == 0.0
    assert times[-1] == duration
    gaps = np.diff(times)
    assert (gaps >= 0.0).all()
    middle = int(np.argmax(gaps))
    assert np.delete(gaps, middle).max() < 0.02 + 1.0e-9
    # The ramps last 2 s.
    if duration > 2.0 * 2.0 + PERIOD:
        assert times[middle] == pytest.approx(2.0 + PERIOD)
        assert times[middle + 1] == pytest.approx(duration - 2.0)
    else:
        assert gaps[middle] < 0.02 + 1.0e-9
