# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Start of a run at a distance from its reference."""

from __future__ import annotations

from helpers.core_loop import CoreLoop
from helpers.processes import PAPER
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

AWAY = ['plant.initial_pose=[-0.5, -0.4, 1.57]', 'controller.law=smc', 'duration=3.0']


@pytest.mark.parametrize('approaches', [False, True])
def test_lockstep_start_with_approach_equals_simulation(approaches: bool) -> None:
    values = load_scenario(str(PAPER), [*AWAY, f'controller.approach_on_start={approaches}'])
    offline = np.concatenate([block.torque for block in Simulation(values).run()])
    loop = CoreLoop(values)
    live = loop.run(3.0)['torque']
    assert live.tobytes() == offline[: len(live)].tobytes()
    first = np.abs(offline[:100]).max()
    assert (first < 30.0) == approaches, first
