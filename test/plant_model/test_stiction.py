# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Stiction of one joint: energy of its bristles, Stribeck curve, gains."""

from __future__ import annotations

import math

from helpers.robots import between, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.plant_model.joint_effects import bristle_gains, stuck
import pytest

LEVELS = between(0.01, 20.0)


@PROPERTY
@given(
    LEVELS,
    between(0.005, 0.5),
    between(1e-3, 5.0),
    st.lists(between(-5.0, 5.0), min_size=5, max_size=40),
)
def test_stiction_removes_energy(
    level: float, velocity: float, inertia: float, rates: list[float]
) -> None:
    h = 5e-4
    stiffness, damping = bristle_gains(level, velocity, inertia, h)
    deflection, work = 0.0, 0.0
    for rate in rates:
        deflection, torque = stuck(deflection, rate, level, velocity, stiffness, damping, h)
        work += torque * rate * h
        stored = 0.5 * stiffness * deflection**2
        assert work + stored <= 1e-12 * (1.0 + abs(work))


@PROPERTY
@given(LEVELS, between(0.005, 0.5), between(-2.0, 2.0))
def test_stiction_constant_rate_equals_stribeck_curve(
    level: float, velocity: float, rate: float
) -> None:
    stiffness, damping = bristle_gains(level, velocity, 0.5, 5e-4)
    deflection, torque = 0.0, 0.0
    rate = math.copysign(max(abs(rate), 1e-3), rate)
    for _ in range(40_000):
        deflection, torque = stuck(deflection, rate, level, velocity, stiffness, damping, 5e-4)
    curve = level / (1.0 + (rate / velocity) ** 2)
    assert torque == pytest.approx(-math.copysign(curve, rate), rel=1e-3)


@pytest.mark.parametrize('inertia', [0.5, math.inf])
def test_stiction_of_level_zero_has_zero_gains(inertia: float) -> None:
    assert bristle_gains(0.0, 0.05, inertia, 5e-4) == (0.0, 0.0)
