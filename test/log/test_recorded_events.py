# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Resets and activations in a log, with which a run can be repeated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.loop.controller_events import (
    ACTIVATED,
    ADAPTATION_RESET,
    DEACTIVATED,
    EVENTS,
    RESUMED,
)
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.messages.parameter_record import ParameterRecord, read_record
from masmc_ros.scenario.scenario import load_scenario, logged_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml')
FAST_ADAPTATION = (
    'duration=0.4',
    'controller.gamma=0.01',
    'controller.switching=implicit',
    'controller.observer_gain=0.5',
    'controller.torque_rate_limit=300',
)
"""Settings with fast changes of theta_hat and disturbance estimate, and with a rate limit."""


def run_with(*changes: Change, settings: tuple[str, ...] = ()) -> TickBlock:
    values = load_scenario(PAPER, ('controller.fault_action=void', *FAST_ADAPTATION, *settings))
    (run,) = Simulation(values, changes).run()
    return run


def test_controller_deactivated_is_void_then_restarts() -> None:
    run = run_with(Change(100, {}, DEACTIVATED), Change(180, {}, ACTIVATED))
    uninterrupted = run_with()
    inactive = slice(100, 180)
    assert (run.torque[:100] == uninterrupted.torque[:100]).all()
    assert not run.torque[inactive].any()
    assert not run.applied[101:181].any()
    assert (run.active == ((np.arange(401) < 100) | (np.arange(401) >= 180))).all()
    assert np.isnan(run.error[inactive]).all()
    nominal = run.estimate[0]
    assert (run.estimate[99] != nominal).any()
    assert (run.estimate[180] == nominal).all()
    # The rate limit counts from the last command, which was void.
    assert (np.abs(run.torque[180]) <= 0.3 + 1e-12).all()


def test_controller_resumed_keeps_estimate() -> None:
    run = run_with(Change(100, {}, DEACTIVATED), Change(180, {}, RESUMED))
    assert (run.estimate[180] == run.estimate[100]).all()
    assert (run.estimate[100] != run.estimate[0]).any()
    assert (np.abs(run.torque[180]) <= 0.3 + 1e-12).all()


@pytest.mark.parametrize('source', ['measured', 'estimated'])
def test_adaptation_reset_restores_nominal_estimate_only(source: str) -> None:
    settings = (
        f'controller.velocity_source={source}',
        'controller.torque_rate_limit=1000',
        'controller.gamma=1',
    )
    run = run_with(Change(200, {}, ADAPTATION_RESET), settings=settings)
    uninterrupted = run_with(settings=settings)
    assert (run.torque[:200] == uninterrupted.torque[:200]).all()
    assert (run.estimate[200] == run.estimate[0]).all()
    assert run.active.all()
    # Rate limit and velocities are not reset: the torque does not step.
    assert (np.abs(run.torque[200] - run.torque[199]) <= 1.0 + 1e-12).all()
    assert run.surface[200] == pytest.approx(uninterrupted.surface[200], abs=1e-12)


def logged(tmp_path: Path, *settings: str, changes: tuple[Change, ...] = ()) -> Path:
    """Simulate to a log with the contents that the nodes would record."""
    from masmc_ros.log.write.simulated import SimulationLog

    values = load_scenario(PAPER, (*FAST_ADAPTATION, *settings))
    simulation = Simulation(values, changes)
    path = tmp_path / 'run.mcap'
    with SimulationLog(path, simulation, values, {}) as log:
        for tick_block in simulation.run(block=150):
            log.write(tick_block)
    return path


def test_simulation_log_contains_events(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = (
        Change(50, {'k_s1': (80.0,) * 4}),
        Change(100, {}, DEACTIVATED),
        Change(180, {'torque_limit': (3.0, 3.0, 5.0, 2.0)}),
        Change(180, {}, ACTIVATED),
        Change(300, {}, ADAPTATION_RESET),
    )
    path = logged(tmp_path, changes=changes)
    run = read_run(path)
    assert [(record.tick, record.event) for record in run.changes] == [
        (change.tick, change.event) for change in changes
    ]
    error = run.telemetry['error'].values
    assert len(error) == 401 - 80
    assert np.isfinite(error).all()
    assert main(['simulate', str(path)]) == 0
    assert 'all 401 states and 401 commands' in capsys.readouterr().out
    assert from_metadata(run) == list(run.changes)


def from_metadata(run: Run) -> list[ParameterRecord]:
    """Return the changes in the metadata, as for a log without the topics."""
    from masmc_ros.log.read.parameter_history import _from_metadata
    from masmc_ros.log.read.scan import scan

    history = _from_metadata(scan(run.path))
    return [
        record._replace(parameters=mine.parameters)
        for record, mine in zip(history.changes, run.changes, strict=True)
    ]


def test_simulate_inactive_controller_is_activated_at_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    settings = ['--set', 'duration=0.1', '--set', 'controller.active_on_start=false']
    assert main(['simulate', PAPER, *settings, '--output', str(log)]) == 0
    run = read_run(log)
    assert run.torque.values.any(axis=1).all()
    assert [(record.tick, record.event) for record in run.changes] == [(0, ACTIVATED)]
    assert main(['simulate', str(log)]) == 0
    assert 'all 101 states and 101 commands' in capsys.readouterr().out


def test_logged_scenario_unknown_event_raises(tmp_path: Path) -> None:
    run = read_run(logged(tmp_path, changes=(Change(5, {}, ADAPTATION_RESET),)))
    strange = replace(run, changes=(run.changes[0]._replace(event='dreamt'),))
    with pytest.raises(InputError, match=r"event 'dreamt' of the controller at tick 5; expected"):
        logged_scenario(strange)


def test_scenario_path_starts_after_robot_raises(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'start_time = 5\.0: a simulated path starts with'):
        load_scenario(PAPER, ['trajectory.start_time=5.0'])
    load_scenario(PAPER, ['trajectory.start_time=-1.0'])
    run = read_run(logged(tmp_path))
    assert run.reference is not None
    late = run.reference.copy()
    late[run.times < 0.1] = np.nan
    with pytest.raises(InputError, match=r'its path starts at t = 0\.1 s; only a run'):
        logged_scenario(replace(run, reference=late))
    logged_scenario(run)


@pytest.mark.parametrize('event', EVENTS)
def test_parameter_record_with_event_is_restored(event: str) -> None:
    record = ParameterRecord('/controller', 5, 5_000_000, {'k_s1': 1.0}, (), event)
    assert read_record(record.to_text()) == record
    assert not record.is_start
    assert record.changes == {}


def test_parameter_record_without_event_is_read() -> None:
    text = '{"node": "/a", "tick": 0, "stamp": 0, "parameters": {}, "changed": []}'
    record: Any = read_record(text)
    assert record.event == ''
    assert record.is_start
