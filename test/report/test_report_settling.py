# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Settling times of errors with known answers."""

from __future__ import annotations

from dataclasses import replace
import math

from helpers.report_runs import run_of, ticks, with_change
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.settling import FLOOR, settling_band, settling_time
import numpy as np
import pytest

NEAR_THE_BAND = st.sampled_from([0.0, 0.5, 1.0]).flatmap(lambda x: st.floats(-0.04 * x, x))


@given(st.floats(0.1, 10.0), st.floats(1.0, 5.0))
def test_exponential_settles_after_four_time_constants(size: float, rate: float) -> None:
    t = ticks(20.0, 0.001)
    errors = size * np.exp(-rate * t)[:, None] * [0.6, -0.8]
    assert settling_time(t, errors) == pytest.approx(math.log(50.0) / rate, abs=1.01e-3)


def test_end_effector_and_platform_settle_on_their_own() -> None:
    t = ticks()
    error = np.zeros((len(t), 4))
    error[:, 1] = np.where(t < 2.0, 0.5, 0.01)  # 2 % of 0.5 m is inside
    error[:, 2] = np.where(t < 3.0, 0.5, 0.0101)  # this is not
    found = metrics(run_of(error, t))
    assert found.of('end_effector').settling == 2.0
    assert found.of('platform').settling == math.inf


def test_small_errors_are_settled_from_the_start() -> None:
    t = ticks()
    errors = np.tile([FLOOR * 0.6, FLOOR * 0.8], (len(t), 1))
    assert settling_band(errors) == FLOOR
    assert settling_time(t, errors) == 0.0
    assert settling_time(t, 1.01 * errors) == math.inf


@pytest.mark.parametrize(('at', 'settled'), [(9.9, 9.91), (10.1, math.inf), (20.0, math.inf)])
def test_who_leaves_the_band_again_has_not_settled(at: float, settled: float) -> None:
    t = ticks()
    errors = np.exp(-t)[:, None] * [1.0, 0.0]
    errors[np.isclose(t, at)] = 0.1
    assert settling_time(t, errors) == settled


@pytest.mark.parametrize(
    ('changed', 'settled'),
    [(0.0, math.inf), (5.0, math.inf), (9.0, 14.0), (13.0, 14.0), (19.9, 14.0)],
)
def test_a_change_of_parameters_begins_anew(changed: float, settled: float) -> None:
    t = ticks()
    errors = np.where(t < 14.0, 1.0, 0.0)[:, None] * [1.0, 0.0]
    error = np.hstack((errors, errors))
    run = with_change(run_of(error, t), changed, 'controller', k_s1=1.0)
    assert metrics(run).of('platform').settling == settled


def test_a_change_shortly_before_the_end_is_no_excuse() -> None:
    t = ticks()
    errors = np.where(t < 15.5, 1.0, 0.0)[:, None] * [1.0, 0.0]
    assert settling_time(t, errors, 15.4) == math.inf


def test_what_is_no_number_has_not_settled() -> None:
    t = ticks()
    errors = np.exp(-t)[:, None] * [1.0, 0.0]
    for where in (0, -1):
        broken = errors.copy()
        broken[where, 1] = np.nan
        assert settling_time(t, broken) == math.inf


def test_time_counts_from_the_first_error() -> None:
    t = ticks()
    run = run_of(np.exp(-2.0 * t)[:, None] * np.ones(4), t)
    late = replace(run, times=run.times - 5.0)  # the controller begins 5 s after the plant
    settled = metrics(run).of('end_effector').settling
    assert metrics(late).of('end_effector').settling == pytest.approx(settled)


@given(hnp.arrays(float, st.tuples(st.integers(2, 40), st.just(2)), elements=NEAR_THE_BAND))
def test_after_settling_the_error_is_in_the_band(errors: np.ndarray) -> None:
    t = np.arange(len(errors)) * 0.1
    found = settling_time(t, errors)
    size = np.linalg.norm(errors, axis=1)
    is_in = size <= settling_band(errors)
    if found == math.inf:
        assert not is_in[(len(t) - 1) // 2:].all()
    else:
        assert is_in[t >= found].all()
        before = t < found
        assert not before.any() or not is_in[before][-1]
