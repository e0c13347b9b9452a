# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lines of the report page: every sample, or the bounds of every section."""

from __future__ import annotations

from helpers.report_html import unpacked
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.report.page.packed_samples import packed_path, packed_signal
import numpy as np

ANY = st.floats(-1e300, 1e300) | st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf])
SAMPLES = hnp.arrays(float, st.integers(1, 120), elements=ANY)
LARGEST = float(np.finfo(np.float32).max)


def single(values: np.ndarray) -> np.ndarray:
    """Return float32 values; finite values stay finite."""
    clipped = np.where(np.isfinite(values), np.clip(values, -LARGEST, LARGEST), values)
    return clipped.astype(np.float32)


def times_of(values: np.ndarray) -> np.ndarray:
    return np.round(1.7e9 + 1e-3 * np.arange(len(values)), 3) - 1.7e9


@given(SAMPLES)
def test_packed_signal_short_has_every_sample(values: np.ndarray) -> None:
    times = times_of(values)
    packed = packed_signal(times, values)
    assert set(packed) == {'x', 'y'}
    np.testing.assert_array_equal(unpacked(packed['y']), single(values))
    np.testing.assert_allclose(unpacked(packed['x'], is_times=True), times, rtol=0, atol=1e-9)


@given(SAMPLES, st.integers(1, 119))
def test_packed_signal_long_has_bounds_of_every_section(values: np.ndarray, limit: int) -> None:
    times = times_of(values)
    packed = packed_signal(times, values, limit)
    if len(values) <= 2 * limit:
        assert set(packed) == {'x', 'y'}
        return
    x = unpacked(packed['x'], is_times=True)
    low, high = unpacked(packed['low']), unpacked(packed['high'])
    assert len(x) == len(low) + 1 == len(high) + 1 <= limit + 1
    size = -(-len(values) // limit)
    for number, first in enumerate(range(0, len(values), size)):
        section = single(values[first:first + size])
        np.testing.assert_allclose(x[number], times[first], rtol=0, atol=1e-9)
        if np.isnan(section).all():
            assert np.isnan([low[number], high[number]]).all()
        else:
            assert (low[number], high[number]) == (np.nanmin(section), np.nanmax(section))


@given(hnp.arrays(float, st.tuples(st.integers(1, 120), st.just(2)), elements=ANY),
       st.integers(1, 130))  # fmt: skip
def test_packed_path_keeps_both_ends(points: np.ndarray, limit: int) -> None:
    packed = packed_path(*points.T, limit)
    path = np.stack([unpacked(packed[axis]) for axis in 'xy'], axis=1)
    assert len(path) <= limit + 1
    np.testing.assert_array_equal(path[[0, -1]], single(points[[0, -1]]))
    if len(points) <= limit:
        np.testing.assert_array_equal(path, single(points))


def test_packed_signal_of_one_hour_stays_below_3_mb() -> None:
    times = 1e-3 * np.arange(3_600_000)
    values = np.random.default_rng(3).standard_normal(len(times))
    packed = packed_signal(times, values)
    assert sum(len(text) for text in packed.values()) < 2.5e6
