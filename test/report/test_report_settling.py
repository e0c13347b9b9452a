# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Settling times of errors with known results."""

from __future__ import annotations

from dataclasses import replace
import math

from helpers.report_runs import run_of, ticks, with_change
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.tracking import FLOOR, settling_band, settling_time
import numpy as np
import pytest

NEAR_THE_BAND = st.sampled_from([0.0, 0.5, 1.0]).flatmap(lambda x: st.floats(-0.04 * x, x))


@given(st.floats(0.1, 10.0), st.floats(1.0, 5.0))
def test_settling_time_exponential_error_is_four_time_constants(size: float, rate: float) -> None:
    t = ticks(20.0, 0.001)
    errors = size * np.exp(-rate * t)[:, None] * [0.6, -0.8]
    assert settling_time(t, errors) == pytest.approx(math.log(50.0) / rate, abs=1.01e-3)


def test_settling_time_is_separate_per_point() -> None:
    t = ticks()
    error = np.zeros((len(t), 4))
    error[:, 1] = np.where(t < 2.0, 0.5, 0.01)  # 2 % of 0.5 m is inside
    error[:, 2] = np.where(t < 3.0, 0.5, 0.0101)  # this is outside
    result = metrics(run_of(error, t))
    assert result.of('end_effector').settling == 2.0
    assert result.of('platform').settling == math.inf


def test_settling_time_small_errors_is_zero() -> None:
    t = ticks()
    errors = np.tile([FLOOR * 0.6, FLOOR * 0.8], (len(t), 1))
    assert settling_band(errors) == FLOOR
    assert settling_time(t, errors) == 0.0
    assert settling_time(t, 1.01 * errors) == math.inf


@pytest.mark.parametrize(('at', 'settled'), [(9.9, 9.91), (10.1, math.inf), (20.0, math.inf)])
def test_settling_time_error_leaves_band_is_later_or_infinite(at: float, settled: float) -> None:
    t = ticks()
    errors = np.exp(-t)[:, None] * [1.0, 0.0]
    errors[np.isclose(t, at)] = 0.1
    assert settling_time(t, errors) == settled


@pytest.mark.parametrize(
    ('changed', 'settled'),
    [(0.0, math.inf), (5.0, math.inf), (9.0, 14.0), (13.0, 14.0), (19.9, 14.0)],
)
def test_settling_time_parameter_change_restarts(changed: float, settled: float) -> None:
    t = ticks()
    errors = np.where(t < 14.0, 1.0, 0.0)[:, None] * [1.0, 0.0]
    error = np.hstack((errors, errors))
    run = with_change(run_of(error, t), changed, 'controller', k_s1=1.0)
    assert metrics(run).of('platform').settling == settled


def test_settling_time_late_change_stays_infinite() -> None:
    t = ticks()
    errors = np.where(t < 15.5, 1.0, 0.0)[:, None] * [1.0, 0.0]
    assert settling_time(t, errors, 15.4) == math.inf


def test_settling_time_nan_error_is_infinite() -> None:
    t = ticks()
    errors = np.exp(-t)[:, None] * [1.0, 0.0]
    for index in (0, -1):
        broken = errors.copy()
        broken[index, 1] = np.nan
        assert settling_time(t, broken) == math.inf


def test_settling_time_starts_at_first_error() -> None:
    t = ticks()
    run = run_of(np.exp(-2.0 * t)[:, None] * np.ones(4), t)
    late = replace(run, times=run.times - 5.0)  # the controller starts 5 s after the plant
    settled = metrics(run).of('end_effector').settling
    assert metrics(late).of('end_effector').settling == pytest.approx(settled)


@given(hnp.arrays(float, st.tuples(st.integers(2, 40), st.just(2)), elements=NEAR_THE_BAND))
def test_settling_time_later_errors_are_in_band(errors: np.ndarray) -> None:
    t = np.arange(len(errors)) * 0.1
    settled = settling_time(t, errors)
    size = np.linalg.norm(errors, axis=1)
    is_in = size <= settling_band(errors)
    if settled == math.inf:
        assert not is_in[(len(t) - 1) // 2:].all()
    else:
        assert is_in[t >= settled].all()
        before = t < settled
        assert not before.any() or not is_in[before][-1]
