# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Averages over windows against integrals of known functions."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.identification.regressor import (
    average_of_held,
    sample_weights,
    weight,
    Windows,
    windows_in,
)
import numpy as np

HALF = 0.05
TIMES = np.arange(0.0, 1.0, 0.001)


def test_weights_average_values_and_derivatives() -> None:
    windows = windows_in(TIMES, HALF, np.ones(len(TIMES) - 1, bool), 0.1)
    weights = sample_weights(TIMES, windows)
    values, slopes = np.sin(7.0 * TIMES), 7.0 * np.cos(7.0 * TIMES)
    average, derivative = np.zeros((2, len(windows.centres)))
    for k, row in enumerate(weights.window):
        for m, window in enumerate(row):
            if window >= 0:
                average[window] += weights.mean[k, m] * slopes[k]
                derivative[window] += weights.slope[k, m] * values[k]
    assert np.abs(average - derivative).max() < 1.0e-5
    assert np.abs(average - 7.0 * np.cos(7.0 * windows.centres)).max() < 0.05


@settings(max_examples=20, deadline=None)
@given(delay=st.floats(0.0, 0.05), lag=st.floats(0.0, 0.02), seed=st.integers(0, 100))
def test_average_of_held_delay_and_lag_agree_with_quadrature(
    delay: float, lag: float, seed: int
) -> None:
    """The reference is the response of the lag, integrated with steps of 20 us."""
    values = np.random.default_rng(seed).standard_normal((len(TIMES), 1))
    windows = Windows(np.array([0.7]), HALF)
    fine = np.arange(0.4, 0.8, 2.0e-5)
    held = values[np.clip(np.floor((fine - delay) / 0.001 + 1e-9).astype(int), 0, None), 0]
    if lag > 1.0e-3:
        decay = np.exp(-2.0e-5 / lag)
        reached = 0.0
        for k, value in enumerate(held):
            reached = decay * reached + (1.0 - decay) * value
            held[k] = reached
    else:
        lag = 0.0
    expected = float(weight((fine - 0.7) / HALF) / HALF @ held) * 2.0e-5
    average = average_of_held(TIMES, values, windows, delay, lag)
    assert abs(average[0, 0] - expected) < 2.0e-3


def test_windows_skip_gaps() -> None:
    valid = np.ones(len(TIMES) - 1, bool)
    valid[500] = False
    centres = windows_in(TIMES, HALF, valid, 0.1).centres
    assert len(centres) > 5
    assert not ((centres > 0.46) & (centres < 0.64)).any()
