# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs in real time, computed again from what their log contains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from helpers.processes import PAPER
from masmc_ros.cli.main import main
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.loop.simulation import Responses, TimedSimulation
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.recomputed import logged_responses, Recomputed
from masmc_ros.scenario.scenario import logged_scenario
import numpy as np
import pytest


@pytest.fixture(scope='module')
def logged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Mapping[str, Values]]:
    log = tmp_path_factory.mktemp('timed') / 'run.mcap'
    settings = [
        'duration=2.0',
        'control_period=0.01',
        'controller.torque_limit=[8.0, 8.0, 20.0, 10.0]',
        'plant.torque_limit=[8.0, 8.0, 20.0, 10.0]',
        'controller.switching=implicit',
    ]
    words = [word for setting in settings for word in ('--set', setting)]
    assert main(['simulate', str(PAPER), '--output', str(log), *words]) == 0
    run = read_run(log)
    assert logged_responses(run, logged_scenario(run)[0]) is None
    run.parameters['controller']['pacing'] = 'realtime'
    return run, logged_scenario(run)[0]


def computed(values: Mapping[str, Values], responses: Responses) -> TickBlock:
    (block,) = TimedSimulation(values, (), None, responses).run()
    return block


@pytest.mark.parametrize('seed', range(3))
def test_skipped_states_and_late_commands_are_found(
    seed: int, logged: tuple[Run, Mapping[str, Values]]
) -> None:
    run, values = logged
    rng = np.random.default_rng(seed)
    count = len(run.times)
    answered = rng.random(count) > 0.1
    answered[0] = True
    latest = np.maximum.accumulate(np.where(answered, np.arange(count), -1))
    acting = latest.copy()
    for tick in np.flatnonzero(rng.random(count) < 0.05):
        acting[tick] = latest[max(0, latest[tick] - 1)]
    block = computed(values, Responses(answered, acting))
    stamps = np.rint(run.times * 1e9).astype(np.int64)
    known = replace(
        run,
        position=block.position,
        velocity=block.velocity,
        applied_effort=block.applied,
        torque=Series(stamps[answered], block.torque[answered]),
    )
    responses = logged_responses(known, values)
    assert responses is not None
    assert (responses.computed == answered).all()
    again = computed(values, responses)
    assert again.signals.tobytes() == block.signals.tobytes()
    comparison = Recomputed(known, responses)
    simulation = TimedSimulation(values, (), None, responses)
    parts = list(simulation.run(block=7))
    for part in parts:
        comparison.compare(part, simulation.timing)
    assert np.concatenate([part.signals for part in parts]).tobytes() == block.signals.tobytes()
    assert comparison.verdict(is_changed=False).startswith(
        f'recomputed: all {count} states and {int(answered.sum())} commands of '
    )
    # Without them the run is another one.
    every = Responses(np.ones(count, dtype=np.bool_), np.arange(count))
    assert (computed(values, every).position != block.position).any()


def test_lateness_that_is_not_logged_is_named(logged: tuple[Run, Mapping[str, Values]]) -> None:
    run, values = logged
    every = Responses(np.ones(len(run.times), dtype=np.bool_), np.arange(len(run.times)))
    comparison = Recomputed(replace(run, position=run.position + 1.0), every)
    comparison.compare(computed(values, every), TimedSimulation(values, (), None, every).timing)
    line = comparison.verdict(is_changed=False)
    assert 'first states at t = 0.000 s; in real time the log lacks when late commands' in line


@pytest.mark.parametrize(('first', 'identical', 'difference', 'text'), [
    (0, 80, 1.9, '110 missing in a gap, the longest of 1.110 s from t = 0.790 s'),
    (20, 0, 0.2, 'the states before its first one at t = 0.200 s'),
])
def test_run_is_recomputed_up_to_first_lost_states(
    first: int,
    identical: int,
    difference: float,
    text: str,
    logged: tuple[Run, Mapping[str, Values]],
) -> None:
    run, values = logged
    count = len(run.times)
    block = computed(values, Responses(np.ones(count, dtype=np.bool_), np.arange(count)))
    kept = np.r_[first:80, 190:count]
    lost = replace(
        run,
        times=run.times[kept],
        position=block.position[kept],
        velocity=block.velocity[kept],
        applied_effort=block.applied[kept],
        torque=Series(run.torque.stamps[kept], block.torque[kept]),
    )
    responses = logged_responses(lost, values)
    assert responses is not None
    comparison = Recomputed(lost, responses)
    simulation = TimedSimulation(values, (), None, responses)
    for part in simulation.run():
        comparison.compare(part, simulation.timing)
    counts = comparison.counts()
    assert counts['identical_states'] == identical
    assert counts['first_difference'] == pytest.approx(difference)
    line = comparison.verdict(is_changed=False)
    assert 'the log lacks' in line
    assert text in line
