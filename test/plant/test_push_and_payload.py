# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Payload and push of a running plant: their effect, their end, and their recomputation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from helpers.core_loop import node_values
from helpers.live_run import live_run
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.write.simulated import SimulationLog
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change
from masmc_ros.loop.timing import Timing
from masmc_ros.plant.lockstep import LockStep
from masmc_ros.plant.plant_core import CommandPart, Commands, EndPush, Publish
from masmc_ros.report.measure.adaptation import adaptation
from masmc_ros.scenario.scenario import logged_scenario
import numpy as np
import pytest

PERIOD, TICKS, MASS = 0.002, 500, 2.0
CHANGES = (
    Change(100, {PUSH.name: (0.0, 0.0, 5.0, 0.0)}, node='plant'),
    Change(200, {PUSH.name: (0.0,) * 4}, node='plant'),
    Change(200, {'k_s1': (50.0,) * 4}),
    Change(300, {PAYLOAD_MASS.name: MASS}, node='plant'),
)


def values_of(**plant: Any) -> Scenario:
    """Return the scenario of a short run."""
    shared = {'control_period': PERIOD, 'duration': TICKS * PERIOD, 'pacing': 'lockstep'}
    return node_values(shared, plant=plant).with_nodes({'recorder': {'compression': 'zstd'}})


def states(simulation: Simulation) -> np.ndarray:
    """Return the positions of all ticks."""
    return np.vstack([block.position for block in simulation.run(170)])


def test_changed_plant_recomputed_from_its_log(tmp_path: Path) -> None:
    values, path = values_of(), tmp_path / 'run.mcap'
    simulation = Simulation(values, CHANGES)
    with SimulationLog(path, simulation, values, {}) as log:
        for block in simulation.run():
            log.write(block)
    run = read_run(path)
    # The log has all blocks, also of a simulation that is run again.
    np.testing.assert_array_equal(run.position, states(simulation))
    scenario, changes = logged_scenario(run)
    assert tuple(changes) == CHANGES
    np.testing.assert_array_equal(run.position, states(Simulation(scenario, changes)))

    unchanged = states(Simulation(values))
    differs = (run.position != unchanged).any(axis=1)
    assert differs.argmax() == 101
    adapted = adaptation(run)
    assert adapted is not None
    robot = plant_of(values['plant'], PERIOD).robot
    assert adapted.values[0] == pytest.approx(robot.theta[0] + MASS)


def test_plant_of_nodes_changes_like_simulation() -> None:
    values = values_of(**{PAYLOAD_MASS.name: 1.0, 'payload.time': 0.1})
    simulation = Simulation(values, CHANGES)
    blocks = list(simulation.run(170))
    torque = np.vstack([block.torque for block in blocks])
    position = np.vstack([block.position for block in blocks])
    plant, active = plant_of(values['plant'], PERIOD), dict(values['plant'])
    for tick in range(TICKS):
        for change in CHANGES:
            if change.tick == tick and change.node == 'plant':
                active |= change.values
                plant.check_change(active)
                plant.change(active)
        plant.advance(torque[tick])
        np.testing.assert_array_equal(plant.position, position[tick + 1])


def test_core_ends_push_after_its_duration() -> None:
    values = values_of(**{'push.duration': 5 * PERIOD})['plant']
    timing, part = Timing.from_values(values), CommandPart('part', 4)
    core = LockStep(plant_of(values, PERIOD), timing, values, Commands([part]))
    core.start(0.0)

    def step() -> list[type]:
        return [type(a) for a in core.on_command(part, np.zeros(4), core.stamp, 0.0)]

    step()
    values[PUSH.name] = (1.0, 0.0, 0.0, 0.0)
    core.on_parameters((PUSH.name,), 0.0)
    assert [step() for _ in range(4)] == [[Publish]] * 4
    assert step() == [Publish, EndPush]
    values[PUSH.name] = (0.0,) * 4
    core.on_parameters((PUSH.name,), 0.0)
    assert [step() for _ in range(5)] == [[Publish]] * 5
    values[PUSH.name] = (1.0, 0.0, 0.0, 0.0)
    core.on_parameters((PUSH.name,), 0.0)
    assert [type(action) for action in core.on_reset(0.0)] == [EndPush, Publish]


def test_push_at_start_rejected() -> None:
    with pytest.raises(InputError, match=r'push\.torque = \[1\.0, .* expected 0 at the start'):
        Simulation(values_of(**{PUSH.name: (1.0, 0.0, 0.0, 0.0)}))


@pytest.mark.slow
def test_changed_plant_node_recomputed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with live_run(tmp_path, pacing='lockstep', **{'plant__push.duration': 0.1}) as run:
        run.wait_for_progress()
        run.tester.change('plant', **{PUSH.name: [0.0, 0.0, 3.0, 0.0]})
        run.wait_for_progress()
        run.tester.change('plant', **{PAYLOAD_MASS.name: 0.5})
        run.wait_for_progress()
        run.end()
        log = run.log
    changes = [c for c in read_run(log).changes if c.node == '/plant']
    assert [c.changed for c in changes] == [(PUSH.name,), (PUSH.name,), (PAYLOAD_MASS.name,)]
    assert changes[1].tick - changes[0].tick == 50
    assert main(['simulate', str(log)]) == 0
    assert 'are bitwise identical' in capsys.readouterr().out.partition('recomputed: all')[2]
