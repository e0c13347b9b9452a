# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Some ticks of laws, effects and supervision in plain Python; prints those that fail.

The arguments are names of parameter files in config/. It is meant for NUMBA_DISABLE_JIT=1. Each
run has several effects, because loading a robot takes longer than its ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import sys
import traceback

from helpers.core_loop import CoreLoop
from masmc_ros.law.registry import LAWS, SWITCHING
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

CONFIG = Path(__file__).parents[2] / 'config'
ACTIONS = {'paper': 'gravity', 'ur5': 'hold', 'tiago': 'gravity', 'franka_on_omni': 'hold'}
"""Fault actions by robot."""

IMPERFECT = (
    'plant.friction=0.8',
    'plant.stiction.torque=1.0',
    'plant.motor_lag=0.005',
    'plant.joint_stiffness=2000.0',
    'plant.joint_damping=5.0',
    'plant.velocity_noise=0.02',
    'plant.encoder_resolution=0.0001',
    'plant.measurement_delay=0.001',
    'plant.command_delay=0.001',
    'plant.delay_jitter=0.5',
    'plant.measurement_loss=0.2',
    'plant.command_loss=0.2',
    'plant.payload.mass=1.0',
    'controller.torque_limit=20.0',
    'controller.torque_rate_limit=5000.0',
)
ESTIMATED = (
    'controller.law=smc',
    'controller.velocity_source=estimated',
    'plant.measures_velocity=false',
    'controller.slip_backoff=0.1',
    'controller.payload.mass=1.0',
)
COMPENSATED = (
    'controller.law=rasmc',
    'controller.latency=0.001',
    'controller.motor_lag=0.005',
    'controller.observer_gain=0.5',
)
PROJECTED = (
    'controller.law=rasmc',
    'controller.gamma=0.0001',
    'controller.projection.lower=0.9',
    'controller.projection.upper=1.1',
    'controller.e_modification=0.1',
    'controller.dead_zone=0.001',
    'controller.approach_on_start=true',
)
BASE = 'plant.base_lag=0.05', 'controller.base_lag=0.05', *COMPENSATED


def interface(name: str) -> tuple[str, str]:
    """Return the settings of a command interface."""
    return f'plant.command_interface={name}', f'controller.command_interface={name}'


def cases(robot: str) -> list[tuple[str, ...]]:
    """Return the settings of simulations of a robot."""
    runs = [(*IMPERFECT, *ESTIMATED), COMPENSATED, PROJECTED, interface('velocity')]
    if robot != 'paper':
        runs.append(('controller.joint_limits=enforce',))
    if robot != 'ur5':
        runs.append((*interface('hybrid'), *BASE))
    # Parallel runs of the paper's robot have all laws, see laws_in_lanes.py.
    if robot == 'ur5':
        runs += [
            (f'controller.law={name}',) for name, law in LAWS.items()
            if law.most_parameters is None
        ]
    if robot == 'tiago':
        runs += [('controller.law=smc', f'controller.switching={name}') for name in SWITCHING]
    return runs


def simulate(robot: str, settings: tuple[str, ...]) -> None:
    """Compute three ticks, and check that their results are finite."""
    scenario = load_scenario(str(CONFIG / f'{robot}.yaml'), (*settings, 'duration=0.002'))
    for block in Simulation(scenario).run():
        assert np.isfinite(block.position).all()
        assert np.isfinite(block.applied).all()


def in_lanes(robot: str, settings: tuple[str, ...]) -> None:
    """Compute two parallel runs."""
    scenario = load_scenario(str(CONFIG / f'{robot}.yaml'), (*settings, 'duration=0.002'))
    for block in BatchSimulation([scenario, scenario]).run():
        assert np.isfinite(block['position']).all()


STATES = (
    'active', 'inactive: disabled', 'active', 'inactive: hand guiding', 'active',
    'fault: emergency stop', 'inactive: a fault was cleared',
)  # fmt: skip
"""States of `supervise`."""


def supervise(robot: str, action: str) -> None:
    """Compute ticks of law, approach, hand guiding and safe stop, with a missing state."""
    pacing = (f'{node}.pacing=realtime' for node in ('plant', 'controller', 'trajectory'))
    settings = (*pacing, f'controller.fault_action={action}')
    loop = CoreLoop(load_scenario(str(CONFIG / f'{robot}.yaml'), settings), ahead=0.01)
    loop.run(2 * loop.period)
    core = loop.core
    for event in (
        lambda: core.on_enable(loop.now, enabled=False),
        lambda: core.on_enable(loop.now, enabled=True),
        lambda: core.on_guide(loop.now, enabled=True),
        lambda: core.on_guide(loop.now, enabled=False),
        lambda: core.on_stop(loop.now),
        lambda: core.on_clear(loop.now),
    ):
        loop.perform(event())
        loop.run(2 * loop.period)
    loop.run(loop.period, has_state=False)
    assert np.isfinite(loop.plant.true_position).all()
    assert tuple(text for _, text in loop.reports) == STATES


def attempt(compute: Callable[..., None], *case: object) -> None:
    """Compute a case, and print its error if it fails."""
    try:
        compute(*case)
    except Exception:
        print(compute.__name__, *case, traceback.format_exc())


if __name__ == '__main__':
    with np.errstate(all='ignore'):
        for robot in sys.argv[1:]:
            for settings in cases(robot):
                attempt(simulate, robot, settings)
            if robot == 'tiago':
                attempt(in_lanes, robot, IMPERFECT)
            attempt(supervise, robot, ACTIONS[robot])
