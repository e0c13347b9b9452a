# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A robot whose joints rub learns how much."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
from small_tree import hand_at_start, write_scenario

FRICTION = (
    'robot.friction=parameters',
    'robot.viscous_friction=[0.1, 0.1, 2.0, 40.0, 1.0, 0.6, 0.3]',
    'robot.coulomb_friction=[0.1, 0.1, 2.0, 20.0, 1.0, 0.5, 0.2]',
    'controller.switching=implicit',
    'controller.observer_gain=0',
)
"""Twice what the controller believes in."""


@pytest.mark.slow
def test_friction_is_learned(tmp_path: Path) -> None:
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
