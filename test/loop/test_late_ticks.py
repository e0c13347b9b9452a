# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Real-time run on a busy machine: the bounds of docs/reference/real_time.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from helpers.delayed_loop import Delay, delayed_run, DelayedRun
from helpers.robots import DEFAULT, Machine
from helpers.scenario import Scenario
from masmc_ros.errors import InputError
from masmc_ros.loop.layer_bound import least_task_inertia, longest_hold, thinnest_layer
from masmc_ros.params.declaration import check_all, Values
from masmc_ros.robot.two_link.paper_robot import TORQUE_LIMIT, TWO_LINK
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
from test_stability_bounds import CHATTERING, SMOOTH, variation

CONFIG = Path(__file__).parents[2] / 'config'
NODES = ('plant', 'trajectory', 'controller')
END_EFFECTOR, PLATFORM = [0, 1], [2, 3]


def defaults() -> dict[str, Values]:
    """Return the parameters of nodes started without a file."""
    return {node: check_all(declared(node), {}) for node in NODES}


def up_to(seconds: float, seed: int, *, share: float = 1.0) -> Delay:
    """Return random delays of up to `seconds` for a share of the ticks."""
    random = np.random.default_rng(seed)
    return lambda: random.uniform(0.0, seconds) if random.random() < share else 0.0


def late(values: dict[str, Values], seconds: float, longest: float, seed: int) -> DelayedRun:
    """Run with delays of up to `longest` s of every plant tick and controller response."""
    return delayed_run(values, seconds, up_to(longest, seed), up_to(longest, seed + 1000))


@pytest.mark.parametrize('seed', range(4))
def test_defaults_ticks_10_ms_late_keep_accuracy(seed: int) -> None:
    """The errors over 60 s equal those of punctual ticks."""
    run = late(defaults(), 60.0, 0.010, seed)
    assert run.late > 500
    assert (run.largest_torque <= TORQUE_LIMIT).all()
    assert run.most(END_EFFECTOR, 1000) < 5.0
    assert run.most(PLATFORM, 1000) < 1.5


@pytest.mark.parametrize('longest', [0.03, 0.1])
def test_defaults_ticks_100_ms_late_stay_bounded(longest: float) -> None:
    """The plant's time falls behind real time."""
    run = late(defaults(), 60.0, longest, seed=1)
    assert run.late > 1000
    assert (run.largest_torque <= TORQUE_LIMIT).all()
    assert run.most(END_EFFECTOR, 1000) < 40.0
    assert run.most(PLATFORM, 1000) < 40.0


@pytest.mark.parametrize(
    ('share', 'longest', 'overdue', 'error'),
    [(0.01, 0.05, 0.02, 5.0), (0.10, 0.02, 0.05, 5.0), (0.05, 0.10, 0.18, 20.0)],
)
def test_late_ticks_errors_stay_within_documented_bounds(
    share: float, longest: float, overdue: float, error: float
) -> None:
    """The plant warns from the first of these shares; the largest errors grow with the share."""
    for seed in range(3):
        delays = (up_to(longest, seed + offset, share=share) for offset in (0, 1000))
        run = delayed_run(defaults(), 60.0, *delays)
        due = len(run.error) + run.behind / 0.01
        assert run.overdue / due == pytest.approx(overdue, rel=0.35)
        assert 3.8 < run.most(END_EFFECTOR, 1000) < error


def busy(values: dict[str, Values], seed: int) -> DelayedRun:
    """Run 20 s at 1 kHz while three responses in ten are late by up to 20 ms."""
    return delayed_run(values, 20.0, up_to(0.0003, seed), up_to(0.02, seed + 1000, share=0.3))


def test_late_ticks_paper_law_diverges_unless_limited() -> None:
    paper = load_scenario(str(CONFIG / 'paper.yaml'))
    with pytest.raises(InputError, match='diverged'):
        busy(paper, seed=0)
    robust_settings = load_scenario(str(CONFIG / 'realtime.yaml'))
    for node, names in (
        ('plant', ['torque_limit']),
        (
            'controller',
            [
                'torque_limit',
                'leakage',
                'projection.lower',
                'projection.upper',
                'freeze_when_saturated',
            ],
        ),
    ):
        paper[node].update({name: robust_settings[node][name] for name in names})
    run = busy(paper, seed=0)
    assert (run.largest_torque <= TORQUE_LIMIT).all()
    assert run.most(END_EFFECTOR, 10_000) < 300.0


def test_longest_hold_boundary_layer_is_onset_of_chatter() -> None:
    """The warning threshold of the controller is the period at which the law chatters."""
    inertia = 0.655  # minimum along the path, kg
    hold = longest_hold(inertia, 100.0, 100.0, 0.2)
    assert hold == pytest.approx(0.00218, rel=1e-2)
    assert thinnest_layer(inertia, 100.0, 100.0, hold) == pytest.approx(0.2)
    assert thinnest_layer(inertia, 100.0, 100.0, 0.014) == np.inf

    def held(seconds: float) -> Scenario:
        return Scenario(
            'smc',
            period=seconds,
            steps=round(seconds / 0.0005),
            ticks=round(20.0 / seconds) + 1,
        )

    assert variation(held(0.002)) < SMOOTH
    assert not variation(held(0.0025)) < CHATTERING


def test_minimum_task_inertia_default_robot_is_in_range() -> None:
    machine: Any = Machine(DEFAULT)
    position = np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi / 4, -np.pi / 2])
    theta, geometry = np.array(machine.theta), np.array(machine.geometry)
    smallest_inertia = least_task_inertia(TWO_LINK, theta, geometry, position)
    assert 0.6 < smallest_inertia < 1.0
