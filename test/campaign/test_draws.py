# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Draws as functions of the number of a run."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.campaign.variable import Draw, draw, drawn_values, Uniform
from masmc_ros.errors import InputError
import numpy as np
import pytest
from scipy import stats

DRAWS = (
    draw('a=uniform:0.6:1.4'),
    draw('b=loguniform:0.1:10'),
    draw('c=normal:1:2'),
    draw('d=truncnormal:17:2:10:25'),
    draw('e=integers:1:6'),
)


@given(st.integers(0, 100), st.integers(1, 60), st.booleans(), st.integers(0, 2**32))
def test_batch_equals_part_of_all(first: int, count: int, sobol: bool, seed: int) -> None:
    everything = drawn_values(DRAWS, seed, 0, 160, sobol=sobol)
    batch = drawn_values(DRAWS, seed, first, count, sobol=sobol)
    for whole, part in zip(everything, batch, strict=True):
        np.testing.assert_array_equal(whole[first:first + count], part)


@given(
    st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.lists(st.floats(0.0, 1.0), min_size=1)
)
def test_uniform_draws_are_those_of_scipy(low: float, width: float, parts: list[float]) -> None:
    own, other = Uniform(low, width), stats.uniform(low, width)
    np.testing.assert_array_equal(own.ppf(np.array(parts)), other.ppf(parts))
    assert own.median() == other.median()
    assert own.support() == other.support()


@pytest.mark.parametrize('sobol', [False, True])
def test_draws_follow_their_distributions(sobol: bool) -> None:
    """The Kolmogorov-Smirnov distance of 4096 numbers is below 0.03 (5 in 10 000 exceed it)."""
    for one, values in zip(DRAWS, drawn_values(DRAWS, 3, 0, 4096, sobol=sobol), strict=True):
        if one.distribution != 'integers':
            known = stats.uniform(0.6, 0.8) if one.distribution == 'uniform' else one.frozen
            assert stats.kstest(values, known.cdf).statistic < 0.03
    counts = np.unique_counts(drawn_values(DRAWS, 3, 0, 6000, sobol=sobol)[4])
    assert counts.values.tolist() == [1, 2, 3, 4, 5, 6]
    assert np.all(np.abs(counts.counts - 1000) < 150)


def test_random_draw_does_not_depend_on_other_draws() -> None:
    alone = drawn_values(DRAWS[2:3], 7, 5, 20, sobol=False)[0]
    np.testing.assert_array_equal(alone, drawn_values(DRAWS, 7, 5, 20, sobol=False)[2])
    assert not np.array_equal(alone, drawn_values(DRAWS[2:3], 8, 5, 20, sobol=False)[0])


def test_draws_of_different_names_are_uncorrelated() -> None:
    one, other = drawn_values((Draw('a', 'uniform', (0.0, 1.0)), Draw('b', 'uniform', (0.0, 1.0))),
                       0, 0, 4000, sobol=False)  # fmt: skip
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.06


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('a', 'expected NAME=DISTRIBUTION'),
        ('a=unifrom:1:2', "unknown distribution 'unifrom'; did you mean uniform"),
        ('a=uniform:1', 'expected NAME=uniform:LOW:HIGH'),
        ('a=uniform:1:x', 'expected NAME=uniform:LOW:HIGH'),
        ('a=uniform:1:.inf', 'expected NAME=uniform:LOW:HIGH'),
        ('a=uniform:2:1', 'with LOW < HIGH'),
        ('a=normal:1:0', 'with STD > 0'),
        ('a=loguniform:0:1', 'with 0 < LOW < HIGH'),
        ('a=truncnormal:0:1:2:1', 'with STD > 0 and LOW < HIGH'),
        ('a=integers:1:2.5', 'with whole numbers'),
    ],
)
def test_invalid_draw_raises(text: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        draw(text)
