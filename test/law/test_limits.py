# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of the commanded torque, and anti-windup of adaptation and disturbance estimate."""

from __future__ import annotations

from dataclasses import replace
import importlib
from pathlib import Path

from helpers.robots import Array, between, PROPERTY
from helpers.scenario import axes, Scenario, whole
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.law.registry import SWITCHING
from masmc_ros.loop.simulation import Simulation
from masmc_ros.numerics.scalars import limited
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')

TORQUE = between(-50.0, 50.0)
LIMIT = st.one_of(st.just(0.0), between(0.01, 40.0))
RATE = st.one_of(st.just(0.0), between(0.1, 1e4))


def with_limits(scenario: Scenario, torque: Array, rate: Array) -> Scenario:
    """Return the scenario with limits in N·m and N·m/s."""
    limits = (('torque_limit', torque), ('torque_rate_limit', rate))
    return replace(scenario, extra=scenario.extra + limits)


@PROPERTY
@given(TORQUE, TORQUE, LIMIT, RATE, between(1e-4, 0.1))
def test_limits_any_torque_bounded_or_passed_unmodified(
    value: float, previous: float, limit: float, rate: float, period: float
) -> None:
    torque = limited(value, previous, limit, rate, period)
    assert limit == 0.0 or abs(torque) <= limit
    low, high = sorted((previous, value))
    inside = limit == 0.0 or abs(previous) <= limit
    if inside:
        assert low <= torque <= high or abs(torque) == limit
        assert rate == 0.0 or abs(torque - previous) <= rate * period * (1 + 1e-12) + 1e-14
    if (limit == 0.0 or abs(value) <= limit) and (
        rate == 0.0 or abs(value - previous) <= rate * period * (1 - 1e-12)
    ):
        assert torque == value


def test_limits_nan_torque_stays_nan() -> None:
    assert np.isnan(limited(np.nan, 1.0, 2.0, 3.0, 0.1))


@pytest.mark.parametrize('switching', SWITCHING)
def test_limits_run_stays_within_them(switching: str) -> None:
    limit, rate = axes(1.0, 0.0, 4.0, 1.5), axes(0.0, 300.0, 500.0, 200.0)
    start = Scenario('rasmc', switching, 0.5, ticks=2001)
    run = whole(with_limits(start, limit, rate))
    steps = np.abs(np.diff(run.torque, axis=0, prepend=0.0)) / start.period
    for i in range(4):
        if limit[i]:
            assert np.abs(run.torque[:, i]).max() == limit[i]
        if rate[i]:
            assert steps[:, i].max() == pytest.approx(rate[i], rel=1e-9)
    assert (run.raw_torque != run.torque).any(axis=0).all()


@pytest.mark.parametrize('switching', SWITCHING)
def test_limits_out_of_reach_leave_run_identical(switching: str) -> None:
    start = Scenario('rasmc', switching, 0.5, ticks=1001)
    free, wide = whole(start), whole(with_limits(start, np.full(4, 1e6), np.full(4, 1e9)))
    assert (free.torque == wide.torque).all()
    assert (free.estimate == wide.estimate).all()
    assert (free.torque == free.raw_torque).all()


def exact(**changes: object) -> Scenario:
    """Return the implicit law with the true model, away from its path at the start."""
    joints = axes(0.0, 0.0, 0.5, -1.2)
    return replace(
        Scenario('smc', 'implicit', 0.5, model_scale=1.0, joints=joints, ticks=8001), **changes
    )


def test_disturbance_estimate_ignores_limited_torque() -> None:
    """Undisturbed, the error after saturation equals that of a law without an estimate."""
    still = exact(amplitude=np.zeros(4))
    limit = axes(1.0, 1.0, 2.0, 0.7)
    with_estimate = whole(with_limits(still, limit, np.zeros(4)))
    without = whole(with_limits(replace(still, observer_gain=0.0), limit, np.zeros(4)))
    limited_ticks = (with_estimate.raw_torque != with_estimate.torque).any(axis=1)
    assert limited_ticks.sum() > 200
    # Equal torques during saturation, up to the prediction error of one period.
    last = int(np.flatnonzero(limited_ticks)[-1])
    difference = np.abs(with_estimate.raw_torque - without.raw_torque)[: last // 2]
    assert difference.max() < 0.05 * np.abs(without.raw_torque).max()


def test_disturbance_estimate_after_saturation_converges() -> None:
    disturbed = exact(
        amplitude=axes(0.3, 0.3, 1.0, 0.4), frequency=np.zeros(4), phase=np.full(4, np.pi / 2)
    )
    run = whole(with_limits(disturbed, axes(1.5, 1.5, 4.0, 1.5), axes(0.0, 0.0, 100.0, 100.0)))
    assert (run.raw_torque != run.torque).any(axis=1).sum() > 200
    assert np.abs(run.surface[-1000:]).max() < 1e-4


PLUGGED_IN = '''
import numpy as np


class Push:
    """Request the same torque at every tick; store the last commanded one."""

    parameters = ()
    commanded = []

    def step(self, tick):
        self.commanded.append(tick.commanded)
        return np.array([5.0, -5.0, 1.0, 0.5]), tick.estimate
'''


def test_plugged_in_law_torque_is_limited_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'pushing.py').write_text(PLUGGED_IN)
    package = tmp_path / 'pushing-1.0.dist-info'
    package.mkdir()
    (package / 'METADATA').write_text('Metadata-Version: 2.1\nName: pushing\nVersion: 1.0\n')
    (package / 'entry_points.txt').write_text('[masmc_ros.laws]\npush = pushing:Push\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    limits = 'controller.torque_limit=[2.0, 3.0, 0.0, 0.0]', 'controller.torque_rate_limit=800'
    settings = 'controller.law=push', 'duration=0.01', *limits
    (run,) = Simulation(load_scenario(PAPER, settings)).run()
    commanded = importlib.import_module('pushing').Push.commanded
    assert (run.raw_torque == [5.0, -5.0, 1.0, 0.5]).all()
    steps = 0.8 * np.arange(1, 12)[:, None]
    expected = np.sign(run.raw_torque) * np.minimum(steps, [2.0, 3.0, 1.0, 0.5])
    assert run.torque == pytest.approx(expected, abs=1e-12)
    assert (np.array(commanded)[1:] == run.torque[:-1]).all()
