# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""sin, cos, tanh and exp: accuracy and bitwise identical results on all machines."""

from __future__ import annotations

from collections.abc import Iterable
import hashlib
import math

from helpers.robots import PROPERTY
from hypothesis import example, given
from hypothesis import strategies as st
from masmc_ros.numerics.portable_math import exp, sin_cos, sines, sines_and_cosines, tanh
import mpmath
import numpy as np
import pytest

MODERATE = 1.0e3
EXACT_REDUCTION = 1.6e6
LARGEST = 1.0e9
EPSILON = 2.0**-52

EVERY = st.floats(allow_nan=False, allow_infinity=False)


@pytest.fixture(autouse=True)
def precision() -> Iterable[None]:
    """Compute the exact values with 60 digits."""
    with mpmath.workdps(60):
        yield


def ulps(value: float, exact: mpmath.mpf) -> float:
    """Return the distance in units in the last place of the exact value."""
    return float(abs(mpmath.mpf(value) - exact) / math.ulp(float(exact)))


def multiples_of_half_pi() -> list[float]:
    """Return doubles next to n pi / 2, where argument reduction cancels the most digits."""
    rng = np.random.default_rng(1)
    numbers = [*range(-8, 9), *(int(n) for n in rng.integers(-(2**20) + 16, 2**20 - 16, 500))]
    nearest = [float(n * mpmath.pi / 2) for n in numbers]
    return [x for y in nearest for x in (y, math.nextafter(y, -9e9), math.nextafter(y, 9e9))]


@PROPERTY
@given(st.floats(-MODERATE, MODERATE))
@example(0.0)
@example(5e-324)
@example(math.pi / 4)
@example(MODERATE)
def test_sin_cos_are_within_two_ulp(angle: float) -> None:
    s, c = sin_cos(angle)
    assert ulps(s, mpmath.sin(angle)) <= 2.0
    assert ulps(c, mpmath.cos(angle)) <= 2.0


@PROPERTY
@given(st.floats(-EXACT_REDUCTION, EXACT_REDUCTION))
@example(1576046.2634488605)
@example(EXACT_REDUCTION)
def test_sin_cos_of_large_angles_are_within_three_ulp(angle: float) -> None:
    s, c = sin_cos(angle)
    assert ulps(s, mpmath.sin(angle)) <= 3.0
    assert ulps(c, mpmath.cos(angle)) <= 3.0


def test_sin_cos_near_multiples_of_half_pi_are_within_two_ulp() -> None:
    for angle in multiples_of_half_pi():
        s, c = sin_cos(angle)
        assert ulps(s, mpmath.sin(angle)) <= 2.0, angle
        assert ulps(c, mpmath.cos(angle)) <= 2.0, angle


@PROPERTY
@given(st.floats(EXACT_REDUCTION, LARGEST, exclude_max=True))
def test_sin_cos_huge_angles_have_error_of_angle_rounding(angle: float) -> None:
    s, c = sin_cos(angle)
    assert abs(s - mpmath.sin(angle)) <= EPSILON * angle
    assert abs(c - mpmath.cos(angle)) <= EPSILON * angle


@PROPERTY
@given(st.floats(-LARGEST, LARGEST, exclude_min=True, exclude_max=True))
def test_sin_cos_sine_is_exactly_odd_and_cosine_even(angle: float) -> None:
    s, c = sin_cos(angle)
    mirrored_s, mirrored_c = sin_cos(-angle)
    assert (mirrored_s, mirrored_c) == (-s, c)


@PROPERTY
@given(st.tuples(*[st.floats(-LARGEST, LARGEST, exclude_min=True, exclude_max=True)] * 3))
def test_sin_cos_several_angles_equal_single_results(three: tuple[float, float, float]) -> None:
    alone = tuple(sin_cos(angle) for angle in three)
    assert sines_and_cosines(three) == alone
    assert sines(three) == tuple(s for s, _ in alone)


@pytest.mark.parametrize('angle', [LARGEST, -LARGEST, math.inf, -math.inf, math.nan, 1e300])
def test_sin_cos_out_of_range_or_nan_is_nan(angle: float) -> None:
    assert all(math.isnan(value) for value in sin_cos(angle))


@PROPERTY
@given(st.floats(-22.0, 22.0))
@example(0.0)
@example(5e-324)
@example(0.625)
@example(math.nextafter(0.625, 0.0))
@example(19.06)
@example(20.0)
def test_tanh_is_within_two_ulp(x: float) -> None:
    assert ulps(tanh(x), mpmath.tanh(x)) <= 2.0


@PROPERTY
@given(EVERY)
def test_tanh_is_odd_and_bounded(x: float) -> None:
    assert tanh(-x) == -tanh(x)
    assert abs(tanh(x)) <= 1.0


@pytest.mark.parametrize('x', [0.0, -0.0, 1.0, -1.0, 699.9, -699.9])
def test_exp_selected_values_are_within_two_ulp(x: float) -> None:
    assert ulps(exp(x), mpmath.exp(x)) <= 2.0


@PROPERTY
@given(st.floats(-700.0, 700.0))
def test_exp_is_within_two_ulp(x: float) -> None:
    assert ulps(exp(x), mpmath.exp(x)) <= 2.0


def test_exp_at_its_limits_is_clamped() -> None:
    assert exp(0.0) == 1.0
    assert exp(math.inf) == exp(700.0)
    assert exp(-math.inf) == exp(-700.0) < 1e-300
    assert math.isnan(exp(math.nan))


def test_tanh_at_its_limits_is_one() -> None:
    assert (tanh(math.inf), tanh(-math.inf)) == (1.0, -1.0)
    assert (tanh(25.0), tanh(-1e308)) == (1.0, -1.0)
    assert math.isnan(tanh(math.nan))
    assert tanh(0.0) == tanh(-0.0) == 0.0


def test_portable_math_on_this_machine_equals_recorded_digests() -> None:
    # Arguments consist of integers and divisions, which are exact on all machines.
    arguments = [n / 64.0 for n in range(-4096, 4097)]
    arguments += [n / 3.0 for n in range(0, 3_000_000, 997)]
    values = [value for x in arguments for value in (*sin_cos(x), tanh(x / 7.0))]
    digest = hashlib.sha256(np.array(values, dtype='<f8').tobytes()).hexdigest()
    assert digest == 'e8960bc4e25ce7a7272869c5a4a705890f37f3dd7978ab8867979094b136203c'
    values = [exp(x / 7.0) for x in arguments]
    digest = hashlib.sha256(np.array(values, dtype='<f8').tobytes()).hexdigest()
    assert digest == '417a7e4f52165c60e2fc6ae106dab3da006591e99198bedb5f9b832e53bf75f6'
