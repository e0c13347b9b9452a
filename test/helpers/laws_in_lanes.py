# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of single runs with lanes, for every law; prints the signals that differ.

It is meant for NUMBA_DISABLE_JIT=1, because compiling lanes of all laws takes minutes.
"""

from __future__ import annotations

from pathlib import Path

from masmc_ros.compare.trials import drawn_robot
from masmc_ros.law.registry import LAWS, SWITCHING
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
LANES = 3


def combinations() -> list[tuple[str, str]]:
    """Return every law with every switching term that it can use."""
    return [
        (name, switching)
        for name, law in LAWS.items()
        for switching in (SWITCHING if law.uses_switching else ('tanh',))
    ]


def differing(law: str, switching: str) -> list[str]:
    """Return the signals in which a lane differs from the single run, with torque-rate limits."""
    settings = (
        'duration=0.008',
        f'controller.law={law}',
        f'controller.switching={switching}',
        'controller.observer_gain=0.5',
        'controller.torque_rate_limit=[2000.0, 0.0, 5000.0, 0.0]',
        'plant.velocity_noise=0.01',
    )
    scenario = load_scenario(PAPER, settings)
    runs = [drawn_robot(scenario, TWO_LINK, seed) for seed in range(LANES)]
    (signals,) = BatchSimulation(runs).run()
    single_runs = [next(Simulation(run).run()) for run in runs]
    return [
        f'{law} {switching}: {name}, lane {lane}'
        for lane, run in enumerate(single_runs)
        for name in ('position', 'raw_torque', 'torque', 'estimate', 'surface')
        if not np.array_equal(signals[name][:, :, lane], getattr(run, name))
    ]


if __name__ == '__main__':
    print('\n'.join(line for pair in combinations() for line in differing(*pair)), end='')
