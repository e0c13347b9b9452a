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

"""Start of a run away from its reference."""

from __future__ import annotations

from core_loop import CoreLoop
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from processes import PAPER
import pytest

AWAY = ['plant.initial_pose=[-0.5, -0.4, 1.57]', 'controller.law=smc', 'duration=3.0']


@pytest.mark.parametrize('approaches', [False, True])
def test_lockstep_start_approaches_if_asked_and_as_offline(approaches: bool) -> None:
    values = load_scenario(str(PAPER), [*AWAY, f'controller.approach_on_start={approaches}'])
    offline = np.concatenate([block.torque for block in Simulation(values).run()])
    loop = CoreLoop(values)
    live = loop.run(3.0)['torque']
    assert live.tobytes() == offline[: len(live)].tobytes()
    first = np.abs(offline[:100]).max()
    assert (first < 30.0) == approaches, first
