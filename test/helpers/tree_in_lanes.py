# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of single runs of a tree with lanes; prints the signals that differ.

Without a parameter file and a duration it uses the small tree, for NUMBA_DISABLE_JIT=1.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Any

from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

OF_LANES = (
    (),
    ('controller.model_scale=0.7', 'controller.robot.damping=40.0'),
    ('plant.velocity_noise=0.01', 'plant.seed=5', 'controller.robot.posture_gain=1.0'),
    (
        'controller.robot.armature=0.02',
        'controller.robot.drift_rate=0.0',
        'controller.observer_gain=0.2',
    ),
)
"""Settings of each lane, with different gains, masses, noise and model parameters."""


def differing(runs: list[Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """Return the signals in which a lane differs from the single run."""
    parts = list(BatchSimulation(runs).run())
    single_runs = [list(Simulation(run).run()) for run in runs]
    differences = []
    for name in ('position', 'raw_torque', 'torque', 'estimate', 'surface', 'error'):
        lanes = np.concatenate([part[name] for part in parts])
        for lane, run in enumerate(single_runs):
            own = np.concatenate([getattr(part, name) for part in run])
            if not (np.isfinite(own).all() and np.array_equal(lanes[:, :, lane], own)):
                differences.append(f'{name}, lane {lane}')
    return differences


def main(file: str, duration: str) -> None:
    """Print the differences for a parameter file."""
    length = f'duration={duration}'
    runs = [load_scenario(file, (length, *settings)) for settings in OF_LANES]
    print('\n'.join(differing(runs)), end='')


if __name__ == '__main__':
    if len(sys.argv) > 1:
        main(sys.argv[1], sys.argv[2])
    else:
        with TemporaryDirectory() as folder:
            main(str(write_scenario(Path(folder), hand_at_start(), 1.0)), '0.01')
