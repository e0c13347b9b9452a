# SPDX-License-Identifier: Apache-2.0
"""Thinned lines look like whole ones."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np

from masmc_ros.report.thinning import BUCKETS, envelope

ANY = st.floats(-1e300, 1e300) | st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf])
SAMPLES = hnp.arrays(float, st.tuples(st.integers(1, 120), st.integers(1, 3)), elements=ANY)


@given(SAMPLES, st.integers(1, 12))
def test_every_stretch_keeps_its_least_and_its_greatest(values: np.ndarray, buckets: int) -> None:
    kept = envelope(values, buckets)
    assert (np.diff(kept) > 0).all()
    assert (kept[0], kept[-1]) == (0, len(values) - 1)
    size = -(-len(values) // buckets)
    for first in range(0, len(values), size):
        whole = values[first : first + size]
        thin = values[kept[(first <= kept) & (kept < first + size)]]
        for column, left in zip(whole.T, thin.T, strict=True):
            assert np.isnan(column).any() == np.isnan(left).any()
            if not np.isnan(column).all():
                assert np.nanmin(left) == np.nanmin(column)
                assert np.nanmax(left) == np.nanmax(column)


@given(st.integers(1, 50_000), st.integers(1, 3))
def test_there_are_only_so_many(count: int, columns: int) -> None:
    values = np.random.default_rng(count).standard_normal((count, columns))
    kept = envelope(values)
    assert len(kept) <= BUCKETS * 2 * columns + 2
    if count <= 2 * BUCKETS:
        assert len(kept) == count


def test_one_sample_of_a_million_is_seen() -> None:
    values = np.zeros((1_000_000, 1))
    values[123_457] = 5.0
    kept = envelope(values)
    assert 123_457 in kept
