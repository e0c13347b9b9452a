# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Axes of variation from the text of the command line."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.campaign.variable import axis
from masmc_ros.errors import InputError
import numpy as np
import pytest


@given(st.floats(-1e6, 1e6, allow_subnormal=False), st.floats(1e-3, 1e6), st.integers(2, 50))
def test_range_has_equal_steps_and_exact_ends(low: float, width: float, count: int) -> None:
    values = axis(f'a={low!r}:{low + width!r}:{count}').values
    assert (values[0], values[-1], len(values)) == (low, low + width, count)
    np.testing.assert_allclose(values, np.linspace(low, low + width, count), rtol=1e-12)


@given(st.floats(1e-6, 1e6), st.floats(1.01, 1e6), st.integers(2, 50))
def test_logarithmic_range_has_equal_ratios(low: float, ratio: float, count: int) -> None:
    values = axis(f'a={low!r}:{low * ratio!r}:{count}:log').values
    assert (values[0], values[-1]) == (low, low * ratio)
    np.testing.assert_allclose(values, np.geomspace(low, low * ratio, count), rtol=1e-9)


@pytest.mark.parametrize('count', [23, 50, 101])
def test_range_of_whole_numbers_has_whole_numbers(count: int) -> None:
    assert axis(f'plant.seed=3:{count + 2}:{count}').values == tuple(range(3, count + 3))


def test_list_keeps_types_of_values() -> None:
    assert axis('controller.law=smc, rasmc').values == ('smc', 'rasmc')
    assert axis('plant.seed=1,2').values == (1, 2)
    assert axis('a=0.5,true').values == (0.5, True)


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('a', 'expected NAME=LOW:HIGH:COUNT'),
        ('a=1:2', 'expected NAME=LOW:HIGH:COUNT'),
        ('a=1:2:1000000000000', '1000000000000 values; expected at most 1000000'),
        ('a=1:2:3:lin', 'expected NAME=LOW:HIGH:COUNT'),
        ('a=1:x:3', 'expected NAME=LOW:HIGH:COUNT'),
        ('a=1:2:3.5', 'expected NAME=LOW:HIGH:COUNT'),
        ('a=2:1:3', 'empty range'),
        ('a=1:2:1', 'empty range'),
        ('a=0:2:3:log', 'expected LOW > 0'),
        ('a=1,,2', 'expected different values'),
        ('a=1,1', 'expected different values'),
    ],
)
def test_invalid_axis_raises(text: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        axis(text)
