# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's robot on waypoints and on an arc."""

from __future__ import annotations

import math
from pathlib import Path

from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

PAPER = str(Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml')
IMPLICIT = ('controller.switching=implicit', 'controller.observer_gain=0.5')
NEAR = 5e-5
"""Largest permitted distance of an axis from its reference in m, after the start."""
SETTLED = 6000
"""Ticks after which an initial error of up to 0.5 m has decayed to 3 um: exp(-sigma t)."""

TIMES = [0.0, 6.0, 8.5, 11.0]
POINTS = [
    [0.3, 0.5, 0.0, 0.0], [0.9, 0.9, 0.5, 0.4], [1.2, 0.6, 0.8, 0.2], [0.8, 0.1, 0.5, 0.3],
]  # fmt: skip


def axes_of_a_run(*settings: str) -> NDArray[np.float64]:
    """Return the true positions of E and F at every tick of 12 s, (n, 4)."""
    scenario = load_scenario(PAPER, (*IMPLICIT, 'duration=12.0', *settings))
    position = np.concatenate([part.true_position for part in Simulation(scenario).run()])
    return robot_of(scenario['plant']).task_positions(position)


@pytest.mark.parametrize('stops', ['false', 'true'])
def test_waypoints_paper_robot_passes_points_in_time(stops: str) -> None:
    numbers = [number for point in POINTS for number in point]
    positions = axes_of_a_run(
        'trajectory.type=waypoints', f'trajectory.waypoints.times={TIMES}',
        f'trajectory.waypoints.points={numbers}', f'trajectory.waypoints.stops={stops}',
    )  # fmt: skip
    for time, point in zip(TIMES[1:], POINTS[1:], strict=True):
        assert positions[round(1000 * time)] == pytest.approx(point, abs=NEAR)
    # The robot stays at the last point.
    assert positions[-1] == pytest.approx(POINTS[-1], abs=NEAR)


def test_arc_paper_robot_moves_end_effector_only() -> None:
    centre, angle = (0.3, 0.6), 1.5 * math.pi
    positions = axes_of_a_run(
        'trajectory.type=arc', 'trajectory.arc.start=[0.3, 0.4, 0.0, 0.0]',
        f'trajectory.arc.centre={list(centre)}', f'trajectory.arc.angle={angle}',
        'trajectory.arc.delay=4.0', 'trajectory.arc.duration=7.0',
    )  # fmt: skip
    settled = positions[SETTLED:]
    distance = np.hypot(settled[:, 0] - centre[0], settled[:, 1] - centre[1])
    assert distance == pytest.approx(0.2, abs=NEAR)
    assert np.abs(settled[:, 2:]).max() < NEAR
    assert settled[-1, :2] == pytest.approx([0.1, 0.6], abs=NEAR)
