# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation of the friction of a robot's joints."""

from __future__ import annotations

from pathlib import Path

from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

FRICTION = (
    'robot.friction=parameters',
    'robot.viscous_friction=[0.1, 0.1, 2.0, 40.0, 1.0, 0.6, 0.3]',
    'robot.coulomb_friction=[0.1, 0.1, 2.0, 20.0, 1.0, 0.5, 0.2]',
    'controller.switching=implicit',
    'controller.observer_gain=0',
)
"""Twice the friction that the controller assumes."""


@pytest.mark.slow
def test_tree_friction_rasmc_adapts_to_friction(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, hand_at_start(), 12.0)
    reached = {}
    for law in ('smc', 'rasmc'):
        simulation = Simulation(load_scenario(str(path), (*FRICTION, f'controller.law={law}')))
        parts = list(simulation.run())
        error = np.concatenate([part.error for part in parts])[6000:, :3]
        reached[law] = np.sqrt((error**2).sum(axis=1).mean())
        estimate = np.concatenate([part.estimate for part in parts])[:, -14:]
        assert (estimate >= 0.0).all()
        assert (estimate[-1] == estimate[0]).all() == (law == 'smc')
    assert reached['rasmc'] < 0.7 * reached['smc']
