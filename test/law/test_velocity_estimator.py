# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Joint velocities from joint angles: the observer alone, and in the loop against a filter."""

from __future__ import annotations

from dataclasses import replace
import importlib.util
from pathlib import Path
import sys
from types import ModuleType

from helpers.robots import Array, between, PROPERTY
from helpers.scenario import Scenario, whole
from hypothesis import given
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, followed, gains
import numpy as np
import pytest

PERIOD = 1e-3


def follow(angles: Array, accelerations: Array, bandwidth: float) -> Array:
    """Return estimated angle, velocity and disturbance after every sample (n, 3)."""
    state, states = (float(angles[0]), 0.0, 0.0), []
    gain = gains(bandwidth, PERIOD)
    for angle, acceleration in zip(angles[1:], accelerations[:-1], strict=True):
        state = followed(*state, float(acceleration), float(angle), PERIOD, gain)
        states.append(state)
    return np.array(states)


@PROPERTY
@given(between(-5.0, 5.0), between(-50.0, 50.0), between(-50.0, 50.0), between(200.0, 5000.0))
def test_observer_constant_push_has_no_error(
    rate: float, known: float, push: float, bandwidth: float
) -> None:
    """Under a constant disturbance the observer has no lag, for any unmodelled part."""
    t = PERIOD * np.arange(4000)
    angles = rate * t + 0.5 * (known + push) * t * t
    angle, estimated_rate, estimated_push = follow(angles, np.full(len(t), known), bandwidth)[-1]
    assert angle == pytest.approx(angles[-1], abs=1e-9 * (1.0 + abs(angles[-1])))
    assert estimated_rate == pytest.approx(rate + (known + push) * t[-1], abs=1e-6)
    assert estimated_push == pytest.approx(push, abs=1e-2)


@PROPERTY
@given(between(1.0, 1e6), between(1e-4, 0.1))
def test_observer_any_bandwidth_and_period_is_stable(bandwidth: float, period: float) -> None:
    g, h, k = gains(bandwidth, period)
    step = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    error = step - np.outer([g, h, k], step[0])
    assert np.abs(np.linalg.eigvals(error)).max() < 1.0


@PROPERTY
@given(between(200.0, 5000.0))
def test_observer_without_push_has_double_pole_at_bandwidth(bandwidth: float) -> None:
    g, h, _ = gains(bandwidth, PERIOD)
    error = np.array([[1.0 - g, 1.0 - g], [-h, 1.0 - h]])
    pole = 1.0 / (1.0 + bandwidth * PERIOD)
    assert np.poly(error) == pytest.approx([1.0, -2.0 * pole, pole * pole], abs=1e-12)


def estimated(bandwidth: float, base: Scenario) -> Scenario:
    """Return the scenario with joint velocities estimated from the angles."""
    extra = (('velocity_source', ESTIMATED), ('estimator_bandwidth', bandwidth))
    return replace(base, extra=base.extra + extra)


QUANTISED = Scenario(
    'smc',
    'implicit',
    0.5,
    measured=(('resolution', np.full(4, 1e-4)), ('noise', np.full(4, 0.01))),
)


def test_observer_measured_velocities_are_ignored() -> None:
    base = estimated(1000.0, replace(QUANTISED, ticks=501))
    noisier = replace(base, measured=(base.measured[0], ('noise', np.full(4, 1.0))))
    one, other = whole(base), whole(noisier)
    assert (one.velocity != other.velocity).any()
    assert (one.torque == other.torque).all()


def test_observer_exact_angles_keeps_tracking_accuracy() -> None:
    """The start from rest differs; afterwards the run equals one with measured velocities."""
    exact = Scenario('smc', 'implicit', 0.5)
    half = slice(10_000, 20_000)
    one, other = whole(exact), whole(estimated(1000.0, exact))
    rms = [float(np.sqrt((run.error[half] ** 2).mean())) for run in (one, other)]
    assert rms[1] == pytest.approx(rms[0], rel=0.1)


def _curve() -> ModuleType:
    path = Path(__file__).parents[2] / 'tools' / 'estimator_curve.py'
    spec = importlib.util.spec_from_file_location('estimator_curve', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_observer_outperforms_every_first_order_filter() -> None:
    """For every filter a bandwidth of the observer has less error and less variation."""
    curve = _curve()
    filtered = [curve.filtered(bandwidth) for bandwidth in (700.0, 1000.0, 2000.0, 5000.0)]
    estimates = [curve.estimated(bandwidth) for bandwidth in (500.0, 1000.0, 2000.0)]
    assert min(point.variation for point in filtered) > 20_000.0
    for filter_point in filtered:
        assert any(
            point.error < filter_point.error and point.variation < filter_point.variation
            for point in estimates
        )
