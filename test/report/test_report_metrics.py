# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of runs with known results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from helpers.report_runs import (
    later,
    none,
    paper_like,
    PARAMETERS,
    run_of,
    telling,
    ticks,
    without_error,
)
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.log.write.simulated import SimulationLog
from masmc_ros.loop.simulation import Simulation
from masmc_ros.report.measure.metrics import metrics, total_variation
from masmc_ros.report.measure.table import text_table
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'


@given(st.floats(1e-6, 10.0), st.floats(1e-6, 10.0))
def test_metrics_errors_on_circles_have_their_radii(radius_e: float, radius_f: float) -> None:
    t = ticks()
    error = np.stack(
        [
            radius_e * np.cos(3 * t),
            radius_e * np.sin(3 * t),
            radius_f * np.cos(t),
            -radius_f * np.sin(t),
        ],
        axis=1,
    )
    result = metrics(run_of(error, t))
    assert result.of('end_effector').rms == pytest.approx(radius_e)
    assert result.of('end_effector').largest == pytest.approx(radius_e)
    assert result.of('platform').rms == pytest.approx(radius_f)
    assert result.of('platform').largest == pytest.approx(radius_f)


def test_metrics_whole_sine_periods_have_known_rms() -> None:
    t = ticks()
    error = np.zeros((len(t), 4))
    error[:, 1] = 0.03 * np.sin(2 * np.pi * t)
    error[:, 2] = 0.05
    result = metrics(run_of(error, t))
    assert result.of('end_effector').rms == pytest.approx(0.03 / np.sqrt(2))
    assert result.of('end_effector').largest == pytest.approx(0.03)
    assert result.of('platform').rms == pytest.approx(0.05)


@pytest.mark.parametrize(
    ('time', 'counts'), [(9.99, False), (10.0, True), (19.99, True), (20.0, False)]
)
def test_metrics_window_is_second_half_without_last_tick(time: float, counts: bool) -> None:
    t = ticks()
    error = np.zeros((len(t), 4))
    error[round(time / 0.01), 0] = 1.0
    result = metrics(run_of(error, t))
    assert (result.start, result.end) == (10.0, 20.0)
    assert result.of('end_effector').largest == float(counts)


def test_metrics_selected_window_applies() -> None:
    t = ticks()
    error = np.zeros((len(t), 4))
    error[t < 1.0] = 0.5
    first = metrics(run_of(error, t), window=(0.0, 1.0)).of('platform')
    assert first.rms == pytest.approx(np.sqrt(0.5))
    assert metrics(run_of(error, t), window=(1.0, 20.0)).of('platform').rms == 0.0


def test_metrics_real_time_stamps_change_nothing() -> None:
    run = paper_like()
    shifted = later(run, 1.7e9)
    result, right = metrics(shifted), metrics(run)
    assert result.of('end_effector').rms == pytest.approx(right.of('end_effector').rms, rel=1e-3)
    assert result.torque_variation == pytest.approx(right.torque_variation, rel=1e-3)
    assert result.end == pytest.approx(20.0, abs=1e-6)


def test_metrics_chattering_torque_has_known_variation() -> None:
    t = ticks()
    sign = np.where(np.arange(len(t)) % 2, 1.0, -1.0)
    torque = sign[:, None] * [1.0, 2.0, 3.0, 4.0]
    result = metrics(run_of(np.zeros((len(t), 4)), t, torque=torque))
    samples = 1000
    assert result.torque_rms == pytest.approx(np.sqrt(1 + 4 + 9 + 16))
    assert result.torque_variation == pytest.approx((samples - 1) * 2 * 10 / 10.0)


def test_metrics_constant_torque_has_zero_variation() -> None:
    t = ticks()
    torque = np.full((len(t), 4), 3.0)
    torque[t < 10.0] = 50.0
    result = metrics(run_of(np.zeros((len(t), 4)), t, torque=torque))
    assert result.torque_variation == 0.0
    assert result.torque_rms == pytest.approx(6.0)


@given(hnp.arrays(float, st.tuples(st.integers(2, 20), st.just(4)), elements=st.floats(-9, 9)))
def test_total_variation_is_at_least_end_to_end_difference(samples: np.ndarray) -> None:
    difference = np.abs(samples[-1] - samples[0]).sum()
    assert total_variation(samples) >= difference - 1e-9
    assert total_variation(samples[::-1]) == pytest.approx(total_variation(samples))
    # For ordered samples it equals this difference.
    ordered = np.sort(samples, axis=0)
    assert total_variation(ordered) == pytest.approx((ordered[-1] - ordered[0]).sum())


def test_metrics_log_without_commands_has_none() -> None:
    run = replace(paper_like(), torque=none(4))
    result = metrics(run)
    assert result.torque_rms is None
    assert result.torque_variation is None
    assert result.estimate_norm is None


def test_metrics_estimate_norm_uses_last_estimate() -> None:
    estimate = np.array([[9.0] * 7, [3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 12.0]])
    run = telling(paper_like(), estimate=(np.array([0.0, 1.0]), estimate))
    assert metrics(run).estimate_norm == pytest.approx(13.0)


def test_metrics_single_state_has_no_window() -> None:
    result = metrics(run_of(np.zeros((1, 4)), np.zeros(1)))
    assert result.of('end_effector').rms is None
    assert result.of('platform').largest is None
    assert result.torque_rms is None
    assert result.of('end_effector').settling == 0.0


def logged_run(folder: Path, file: Path, *settings: str) -> Run:
    """Return a simulated run of a parameter file, read from its log."""
    path = folder / 'run.mcap'
    values = load_scenario(str(file), settings)
    simulation = Simulation(values)
    with SimulationLog(path, simulation, values, {file.name: file.read_bytes()}) as log:
        for tick_block in simulation.run():
            log.write(tick_block)
    return read_run(path)


@pytest.fixture(scope='module')
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return one second of the paper's experiment with a robot other than the default."""
    folder = tmp_path_factory.mktemp('log')
    return logged_run(folder, PAPER, 'duration=1.0', 'robot.link_2_length=0.4')


def test_tracking_error_from_states_equals_logged_error(simulated: Run) -> None:
    logged, computed = tracking(simulated), tracking(without_error(simulated))
    np.testing.assert_array_equal(logged.times, computed.times)
    np.testing.assert_allclose(computed.error, logged.error, rtol=0, atol=1e-13)
    # The robot moved; otherwise the agreement would prove nothing.
    assert np.ptp(logged.error, axis=0).min() > 1e-3


@pytest.mark.slow
def test_tracking_rotation_error_from_states_equals_logged_error(tmp_path: Path) -> None:
    """The error of a rotation is not the difference of two rotation vectors."""
    run = logged_run(tmp_path, PAPER.parent / 'ur5.yaml', 'duration=0.5', 'controller.law=pid')
    logged, computed = tracking(run), tracking(without_error(run))
    np.testing.assert_allclose(computed.error, logged.error, rtol=0, atol=1e-13)
    assert computed.actual is not None
    assert computed.desired is not None
    difference = computed.actual - computed.desired
    assert np.abs(difference - logged.error)[:, 3:].max() > 1e-6


@pytest.mark.parametrize('missing', ['reference', 'parameters'])
def test_tracking_missing_positions_follow_from_error(simulated: Run, missing: str) -> None:
    whole = tracking(simulated)
    assert whole.actual is not None
    assert whole.desired is not None
    lacking = (
        replace(simulated, reference=None)
        if missing == 'reference'
        else replace(simulated, parameters={})
    )
    result = tracking(lacking)
    assert result.actual is not None
    assert result.desired is not None
    np.testing.assert_allclose(result.actual, whole.actual, rtol=0, atol=1e-13)
    np.testing.assert_allclose(result.desired, whole.desired, rtol=0, atol=1e-13)


def test_tracking_states_before_reference_are_ignored() -> None:
    run = without_error(paper_like())
    assert run.reference is not None
    reference = run.reference.copy()
    reference[:300] = np.nan
    result = tracking(replace(run, reference=reference))
    assert result.times[0] == 3.0
    assert np.isfinite(result.error).all()


@pytest.mark.parametrize('change', [{'reference': None}, {'parameters': {}}])
def test_tracking_log_without_error_sources_is_empty(change: dict[str, Any]) -> None:
    run = replace(without_error(paper_like()), **change)
    tracked = tracking(run)
    assert tracked.times.shape == (0,)
    assert tracked.error.shape == (0, 4)
    assert (tracked.desired is None) == ('reference' in change)
    assert (tracked.actual is None) == ('parameters' in change)
    result = metrics(run)
    assert result.of('end_effector').rms is None
    assert result.of('platform').settling is None
    assert result.torque_rms is not None


def test_tracking_uses_lengths_of_plant_not_controller() -> None:
    run = without_error(paper_like())
    assumed = {**PARAMETERS, 'robot.link_2_length': 0.1}
    both = replace(run, parameters={'controller': assumed, 'plant': PARAMETERS})
    np.testing.assert_array_equal(tracking(both).error, tracking(run).error)


def test_metrics_run_that_ended_early_states_span(simulated: Run) -> None:
    times = simulated.times - simulated.times[0]
    window = (times[-1] / 4, times[-1])
    stop = times[-1] / 2
    tracked = tracking(simulated)
    ended = replace(
        tracked,
        times=tracked.times[tracked.times < stop],
        error=tracked.error[tracked.times < stop],
    )
    row = metrics(simulated, window=window, tracked=ended)
    assert row.errors is not None
    assert row.errors.last is not None
    assert row.errors.last == pytest.approx(stop, abs=0.002 * times[-1])
    assert row.errors.share == pytest.approx(1 / 3, abs=0.01)
    table = text_table({'smc': row})
    assert 'for 33% of the window' in table
    assert f'(only {window[0]:g}-{round(row.errors.last, 2):g})' in table
    assert 'smc' in (line := table.splitlines()[3])
    assert '(only' in line
    gap = (tracked.times < stop) | (tracked.times > 1.5 * stop)
    torn = replace(tracked, times=tracked.times[gap], error=tracked.error[gap])
    assert '(only 67%)' in text_table({'smc': metrics(simulated, window=window, tracked=torn)})
    complete = metrics(simulated, window=window, tracked=tracked)
    assert complete.errors is not None
    assert complete.errors.share == pytest.approx(1.0, abs=1e-3)
    assert 'only' not in text_table({'smc': complete})
