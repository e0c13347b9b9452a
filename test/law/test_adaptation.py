# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robust adaptation: leakage, e-modification, dead zone, freezing and projection."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from helpers.robots import between, PROPERTY
from helpers.scenario import axes, Scenario, whole
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.law.parts.adaptation import (
    beyond_dead_zone,
    dissipative_step,
    pulled_estimate,
)
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.shared_formulas import gradient_step
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'

THETA = between(-10.0, 10.0)
PERIOD = between(1e-4, 0.1)
RATE = between(0.0, 1e9)


@PROPERTY
@given(THETA, THETA, between(-100.0, 100.0), between(1e-2, 100.0), PERIOD, RATE)
def test_estimate_step_has_explicit_gradient_implicit_leakage(
    estimate: float, nominal: float, gradient: float, gamma: float, period: float, rate: float
) -> None:
    """theta+ = theta - T g / gamma - T rate (theta+ - theta_0)."""
    after_gradient = gradient_step(estimate, gradient, gamma, period)
    next_estimate = pulled_estimate(after_gradient, nominal, period, rate)
    pull = period * rate * (next_estimate - nominal)
    size = abs(estimate) + abs(nominal) + abs(period * gradient / gamma) + 1.0
    expected = estimate - period * gradient / gamma - pull
    assert next_estimate == pytest.approx(expected, abs=1e-13 * size * (1.0 + period * rate))


@PROPERTY
@given(THETA, THETA, PERIOD, RATE)
def test_leakage_any_rate_does_not_overshoot(
    estimate: float, nominal: float, period: float, rate: float
) -> None:
    next_estimate = pulled_estimate(estimate, nominal, period, rate)
    low, high = sorted((estimate, nominal))
    rounding = 1e-15 * (abs(low) + abs(high))
    assert low - rounding <= next_estimate <= high + rounding


@PROPERTY
@given(between(0.0, 10.0), between(0.0, 10.0))
def test_dead_zone_keeps_the_part_beyond_its_width(distance: float, width: float) -> None:
    # As a field of the settings: in plain Python, a division of floats by zero is an error.
    share = beyond_dead_zone(distance, np.float64(width))
    if width == 0.0:
        assert share == 1.0
    else:
        assert share * distance == pytest.approx(max(0.0, distance - width), abs=1e-14)


VECTOR = st.lists(between(-10.0, 10.0), min_size=3, max_size=3).map(tuple)


@PROPERTY
@given(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, between(0.0, 1.0))
def test_dissipative_step_takes_limited_power(
    estimate: Any, moved: Any, gradient: Any, surface: Any, force: Any, gain: float
) -> None:
    """The step has the same direction, and is unmodified if its power is within the bound."""
    memory = SimpleNamespace(estimate=estimate, reaching=force, disturbance=(0.0, 1.0, -2.0))
    tick = SimpleNamespace(surface=surface, velocity=(0.0, 0.0, 0.0))
    arguments: Any = SimpleNamespace(observer_gain=gain), tick, memory
    bounded = np.array(dissipative_step(*arguments, gradient, moved))
    power = np.dot(gradient, np.subtract(estimate, moved))
    dissipated = -np.dot(surface, np.add(force, memory.disturbance))
    most = max(0.0, 0.25 * (1.0 - gain) ** 2 * dissipated)
    if power < most - 1e-9:
        assert tuple(bounded) == moved
    assert np.dot(gradient, estimate - bounded) <= most + 1e-9
    part = min(1.0, most / power) if power > 0.0 else 1.0
    assert bounded == pytest.approx(estimate + part * np.subtract(moved, estimate), abs=1e-6)


@PROPERTY
@given(between(0.0, 1.0), between(0.0, 1.0), between(0.01, 100.0), between(1e-3, 0.1))
def test_adaptation_within_bound_does_not_oscillate(
    gain: float, part: float, inertia: float, period: float
) -> None:
    """Eigenvalues of s, d and theta of one axis, with the implicit law on the surface."""
    a = part * (1.0 - gain) ** 2 / 4.0
    observer = np.array([gain * inertia / period, 1.0, 0.0])
    force = np.array([-inertia / period, 0.0, 1.0]) - observer
    adapted = np.array([-a * inertia / period, 0.0, 1.0])
    step = np.array([np.array([1.0, 0.0, 0.0]) + period / inertia * force, observer, adapted])
    poles = np.linalg.eigvals(step)
    # s has the sum of d and theta; their difference is no state of the loop and stays.
    rest = np.delete(poles, np.argmin(abs(poles - 1.0)))
    expected = np.roots([1.0, gain - 1.0, a])
    assert sorted(rest.real) == pytest.approx(sorted(expected.real), abs=1e-6)
    assert np.abs(poles.imag).max() < 1e-6
    assert np.abs(rest).max() <= 1.0 + 1e-9


def with_(scenario: Scenario, **fields: object) -> Scenario:
    """Return the scenario with further fields of the settings."""
    return replace(scenario, extra=scenario.extra + tuple(fields.items()))


BASE = Scenario('rasmc', 'tanh', ticks=2001)


def test_leakage_scales_estimate_step() -> None:
    """One tick from the same state without and with leakage: (theta - theta_0) / (1 + T rate)."""
    rate = 3.0
    plain, leaking = whole(BASE), whole(with_(BASE, leakage=rate))
    step = plain.estimate[1] - plain.estimate[0]
    expected = plain.estimate[0] + step / (1.0 + BASE.period * rate)
    assert leaking.estimate[1] == pytest.approx(expected, rel=1e-15)
    assert (leaking.estimate[1] != plain.estimate[1]).any()


def test_e_modification_leakage_is_proportional_to_s() -> None:
    nu = 50.0
    plain, leaking = whole(BASE), whole(with_(BASE, e_modification=nu))
    rate = nu * float(np.linalg.norm(plain.surface[0]))
    step = plain.estimate[1] - plain.estimate[0]
    expected = plain.estimate[0] + step / (1.0 + BASE.period * rate)
    assert rate > 1.0
    assert leaking.estimate[1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize('modification', [0.0, 20.0])
def test_dead_zone_s_within_width_keeps_estimate(modification: float) -> None:
    width = 0.065
    run = whole(with_(BASE, dead_zone=width, e_modification=modification))
    inside = np.linalg.norm(run.surface, axis=1)[:-1] <= width
    moved = (np.diff(run.estimate, axis=0) != 0.0).any(axis=1)
    assert 100 < inside.sum() < 1900
    assert (moved == ~inside).all()


def test_freezing_torque_saturated_keeps_estimate() -> None:
    limits = with_(BASE, torque_limit=axes(2.5, 2.5, 6.0, 4.0))
    frozen, free = whole(with_(limits, freeze_when_saturated=1)), whole(limits)
    limited = (frozen.raw_torque != frozen.torque).any(axis=1)[:-1]
    moved = (np.diff(frozen.estimate, axis=0) != 0.0).any(axis=1)
    assert 100 < limited.sum() < 1900
    assert (moved == ~limited).all()
    assert (np.diff(free.estimate, axis=0) != 0.0).any(axis=1).all()


def test_freezing_torque_saturated_leakage_continues() -> None:
    """An estimate that saturates the torque does not stay indefinitely."""
    simulation = Simulation(load_scenario(str(PAPER)))
    controller, plant = simulation.controller, simulation.plant
    reference = simulation.trajectory.sample(0, 1)[0]
    for _ in range(10):
        controller.tick(plant.position, plant.velocity, reference)
    deviation = controller.estimate - controller.nominal
    assert deviation.any()
    controller.change(
        {'torque_limit': (1e-3,) * 4, 'leakage': 5.0, 'freeze_when_saturated': True}
    )
    controller.tick(plant.position, plant.velocity, reference)
    remaining = controller.estimate - controller.nominal
    assert remaining == pytest.approx(deviation / (1.0 + 5.0 * controller.period), rel=1e-9)


def test_smc_adaptation_settings_keep_estimate() -> None:
    everything = with_(
        BASE, leakage=1.0, e_modification=1.0, dead_zone=0.01, projection_lower=0.5
    )
    run = whole(replace(everything, law='smc', extra=(*everything.extra, ('projection_upper', 2))))
    assert (run.estimate == run.estimate[0]).all()


@pytest.mark.parametrize('gamma', [1e-6, 1e-4, 1e-2, 1.0])
def test_adaptation_all_settings_keep_estimate_within_bounds(gamma: float) -> None:
    """The bounds hold for fast adaptation; without projection the two fastest diverge in 10 ms."""
    scenario = with_(
        replace(BASE, gamma=np.full(7, gamma), ticks=5001),
        leakage=0.5,
        e_modification=0.5,
        dead_zone=0.01,
        freeze_when_saturated=1,
        projection_lower=0.2,
        projection_upper=5.0,
        torque_limit=axes(8.0, 8.0, 20.0, 10.0),
    )
    run = whole(scenario)
    nominal = run.estimate[0]
    assert (run.estimate >= 0.2 * nominal - 1e-15).all()
    assert (run.estimate <= 5.0 * nominal + 1e-15).all()
    assert np.isfinite(run.position[:-1]).all()
    assert math.isfinite(float(np.abs(run.error).max()))
