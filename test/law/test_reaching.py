# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Explicit reaching terms, surface, reference state and update law of single axes."""

from __future__ import annotations

from fractions import Fraction
import math

from helpers.robots import between, PROPERTY
from helpers.scenario import PAPER_LAWS, Scenario, whole
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.law.parts.surface import reference_acceleration, reference_velocity, sliding_surface
from masmc_ros.law.reaching.reaching import reaching_force
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.reaching.sigmoid import sigmoid
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.reaching.tanh import smooth
from masmc_ros.law.registry import LAWS, REACHING, SWITCHING
from masmc_ros.robot.shared_formulas import gradient_step
import pytest

SIGN, SATURATION, TANH, SIGMOID = 'sign', 'saturation', 'tanh', 'sigmoid'
SMOOTH = (SATURATION, TANH, SIGMOID)
EXPLICIT = (SIGN, *SMOOTH)
TERMS = {
    SIGN: lambda s, delta: sign(s),
    SATURATION: saturation,
    TANH: smooth,
    SIGMOID: sigmoid,
}

SURFACE = between(-50.0, 50.0)
GAIN = between(0.0, 500.0)
LAYER = between(1e-3, 10.0)
KINDS = st.sampled_from(EXPLICIT)


def explicit_reaching(kind: str, s: float, k_s1: float, k_s2: float, delta: float) -> float:
    """Return the reaching force of one axis."""
    return reaching_force(s, k_s1, k_s2, TERMS[kind](s, delta))


def switched(kind: str, s: float, delta: float) -> float:
    """Return the switching function alone: -u at K_s1 = 0 and K_s2 = 1."""
    return -explicit_reaching(kind, s, 0.0, 1.0, delta)


def test_laws_and_terms_registered_under_their_names() -> None:
    assert (*EXPLICIT, 'implicit') == SWITCHING
    assert {name: term.name for name, term in REACHING.items()} == {n: n for n in SWITCHING}
    assert {name: law.name for name, law in LAWS.items()} == {n: n for n in LAWS}
    assert {*PAPER_LAWS} <= {*LAWS}


@PROPERTY
@given(KINDS, SURFACE, GAIN, GAIN, LAYER)
def test_reaching_force_is_sum_of_both_terms(
    kind: str, s: float, k_s1: float, k_s2: float, delta: float
) -> None:
    expected = -k_s1 * s - k_s2 * switched(kind, s, delta)
    assert explicit_reaching(kind, s, k_s1, k_s2, delta) == pytest.approx(expected, rel=1e-15)


@PROPERTY
@given(KINDS, SURFACE, GAIN, GAIN, LAYER)
def test_reaching_force_is_exactly_odd_and_opposes_s(
    kind: str, s: float, k_s1: float, k_s2: float, delta: float
) -> None:
    u = explicit_reaching(kind, s, k_s1, k_s2, delta)
    assert explicit_reaching(kind, -s, k_s1, k_s2, delta) == -u
    assert u * s <= 0.0


@PROPERTY
@given(KINDS, SURFACE, LAYER)
def test_switching_function_stays_within_one(kind: str, s: float, delta: float) -> None:
    assert abs(switched(kind, s, delta)) <= 1.0


@PROPERTY
@given(KINDS, SURFACE, SURFACE, LAYER)
def test_switching_function_does_not_decrease(
    kind: str, s: float, other: float, delta: float
) -> None:
    low, high = sorted((s, other))
    # At the joint of the two branches of tanh, rounding may swap neighbours.
    assert switched(kind, low, delta) <= switched(kind, high, delta) + 4e-16


@PROPERTY
@given(st.sampled_from(SMOOTH), SURFACE.filter(lambda s: abs(s) > 1e-6))
def test_switching_function_thin_layer_is_sign(kind: str, s: float) -> None:
    assert switched(kind, s, 1e-16) == pytest.approx(math.copysign(1.0, s), abs=1e-9)


@PROPERTY
@given(st.sampled_from(SMOOTH), between(-1.0, 1.0), LAYER)
def test_switching_function_slope_inside_layer_is_one_over_delta(
    kind: str, ratio: float, delta: float
) -> None:
    s = 1e-6 * ratio * delta
    assert switched(kind, s, delta) == pytest.approx(s / delta, rel=2e-6)


@PROPERTY
@given(SURFACE, LAYER)
def test_switching_functions_equal_their_definitions(s: float, delta: float) -> None:
    assert switched(SIGN, s, delta) == (s > 0) - (s < 0)
    assert switched(SATURATION, s, delta) == max(-1.0, min(1.0, s / delta))
    assert switched(TANH, s, delta) == pytest.approx(math.tanh(s / delta), rel=1e-15)
    assert switched(SIGMOID, s, delta) == s / (abs(s) + delta)


@pytest.mark.parametrize('kind', EXPLICIT)
def test_reaching_force_on_surface_is_zero(kind: str) -> None:
    assert explicit_reaching(kind, 0.0, 100.0, 100.0, 0.2) == 0.0


@pytest.mark.parametrize('kind', EXPLICIT)
def test_reaching_force_nan_surface_is_nan(kind: str) -> None:
    assert math.isnan(explicit_reaching(kind, math.nan, 100.0, 100.0, 0.2))


@PROPERTY
@given(SURFACE, SURFACE, SURFACE, SURFACE, SURFACE, between(0.0, 20.0))
def test_surface_is_velocity_minus_reference_velocity(
    x: float, x_dot: float, x_d: float, x_dot_d: float, x_ddot_d: float, sigma: float
) -> None:
    """The surface is xdot - xdot_r of (14); its derivative follows."""
    error, rate = x - x_d, x_dot - x_dot_d
    s = sliding_surface(error, rate, sigma)
    assert s == pytest.approx(x_dot - reference_velocity(x_dot_d, error, sigma), abs=1e-11)
    # sdot = xddot - xddot_r for any xddot; at xddot = xddot_d it is sigma edot.
    difference = x_ddot_d - reference_acceleration(x_ddot_d, rate, sigma)
    assert difference == pytest.approx(sliding_surface(rate, 0.0, sigma), abs=1e-11)


@PROPERTY
@given(between(-100.0, 100.0), between(-1e4, 1e4), between(1e-3, 1e3), between(1e-4, 0.1))
def test_gradient_step_is_one_euler_step(
    estimate: float, gradient: float, gamma: float, period: float
) -> None:
    exact = Fraction(estimate) - Fraction(period) * Fraction(gradient) / Fraction(gamma)
    next_estimate = gradient_step(estimate, gradient, gamma, period)
    size = abs(estimate) + abs(period * gradient / gamma)
    assert abs(Fraction(next_estimate) - exact) <= Fraction(1e-15 * size + 1e-300)


def test_smc_run_keeps_estimate() -> None:
    run = whole(Scenario('smc', 'tanh', ticks=51))
    assert (run.estimate == run.estimate[0]).all()
