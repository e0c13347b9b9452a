# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Runs in parallel lanes: every lane is bitwise identical to a single run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers.child_environment import child_environment
from helpers.robots import DEFAULT, Machine, machines
from helpers.scenario import Scenario, whole, write_law, write_plant
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from masmc_ros.law.parts.velocity_estimator import ESTIMATED
from masmc_ros.law.registry import LAWS
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import closed_loop, plant_start
from masmc_ros.loop.simulated_robot import delay_line
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

LANES = 16
TICKS = 60


def parallel_runs(scenarios: Sequence[Scenario]) -> Any:
    """Return the signals of runs of one law, one run per lane."""
    first, lanes = scenarios[0], len(scenarios)
    law = LAWS[first.law]
    gains = records.law_settings(TWO_LINK, law, first.switching, lanes)
    memory = records.law_memory(TWO_LINK, law, lanes)
    plant, state = (
        records.plant_settings(TWO_LINK, lanes),
        records.plant_memory(TWO_LINK, lanes),
    )
    for lane, scenario in enumerate(scenarios):
        write_law(gains, memory, scenario, lane)
        write_plant(plant, state, scenario, lane)
    delayed = delay_line(plant, TWO_LINK)
    signals = records.signals(TWO_LINK, lanes)
    plant_start(plant, state, delayed, signals)
    history = np.zeros(first.ticks, signals.dtype)
    closed_loop(
        plant, state, delayed, gains, memory, signals, 0, True, first.reference, history
    )
    return history


def assert_equal_single_runs(scenarios: Sequence[Scenario]) -> None:
    """Assert that all signals of every lane equal those of a single run."""
    signals = parallel_runs(scenarios)
    for lane, scenario in enumerate(scenarios):
        alone = whole(scenario)
        for name in ('position', 'velocity', 'true_position', 'applied', 'raw_torque', 'torque',
                     'error', 'surface', 'estimate'):
            values = signals[name][:, :, lane]
            np.testing.assert_array_equal(
                values, getattr(alone, name)[: len(values)], err_msg=f'{name}, lane {lane}'
            )


def varied(seed: int, robot: Machine, law: str, switching: str, lane: int) -> Scenario:
    """Return a scenario in which every value that a lane can have depends on the lane."""
    rng = np.random.default_rng([seed, lane])
    angle = rng.uniform(0.3, 2.8) * rng.choice([-1.0, 1.0])
    scenario = Scenario(
        law,
        switching,
        rng.choice([0.0, 0.4]),
        rng.uniform(0.1, 0.5),
        rng.uniform(0.4, 1.5),
        robot,
        ticks=TICKS,
        k_s1=rng.uniform(10.0, 120.0, 4),
        k_s2=rng.choice([0.0, 50.0, 100.0], 4),
        sigma=rng.uniform(0.0, 4.0, 4),
        gamma=10.0 ** rng.uniform(-1.0, 2.0, 7),
        amplitude=rng.uniform(0.0, 3.0, 4),
        frequency=rng.uniform(0.0, 9.0, 4),
        phase=rng.uniform(-3.0, 3.0, 4),
        limit=rng.choice([0.0, 5.0], 4),
        pose=rng.uniform(-2.0, 2.0, 3),
        joints=np.array([*rng.uniform(-9.0, 9.0, 2), rng.uniform(-3.0, 3.0), angle]),
        rates=rng.uniform(-1.0, 1.0, 4),
    )
    if rng.random() < 0.5:
        measured: tuple[tuple[str, object], ...] = (
            ('resolution', rng.choice([0.0, 1e-3], 4)),
            ('noise', rng.choice([0.0, 0.05], 4)),
            ('delay', int(rng.integers(0, 4))),
            ('seed', int(rng.integers(0, 99))),
        )
        scenario = replace(scenario, measured=measured)
    if rng.random() < 0.5:
        extra: tuple[tuple[str, object], ...] = (
            ('torque_limit', rng.choice([0.0, 4.0], 4)),
            ('torque_rate_limit', rng.choice([0.0, 2e3], 4)),
            ('leakage', rng.choice([0.0, 0.1])),
            ('e_modification', rng.choice([0.0, 0.2])),
            ('dead_zone', rng.choice([0.0, 1e-2])),
            ('projection_lower', rng.choice([0.0, 0.5])),
            ('projection_upper', 2.0),
            ('freeze_when_saturated', int(rng.integers(0, 2))),
            ('velocity_source', ESTIMATED if rng.random() < 0.5 else 0),
            ('estimator_bandwidth', 800.0),
        )
        scenario = replace(scenario, extra=extra)
    return scenario


@pytest.mark.slow
@pytest.mark.parametrize('switching', ['tanh', 'implicit'])
@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
@given(st.integers(0, 2**32 - 1), st.lists(machines(), min_size=LANES, max_size=LANES))
def test_lanes_rasmc_equal_single_runs(
    switching: str, seed: int, robots: list[Machine]
) -> None:
    assert_equal_single_runs(
        [varied(seed, robot, 'rasmc', switching, lane) for lane, robot in enumerate(robots)]
    )


@pytest.mark.slow
@pytest.mark.parametrize('switching', ['sign', 'implicit'])
@pytest.mark.parametrize('law', ['smc'])
@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
@given(st.integers(0, 2**32 - 1), st.lists(machines(), min_size=LANES, max_size=LANES))
def test_lanes_smc_equal_single_runs(
    law: str, switching: str, seed: int, robots: list[Machine]
) -> None:
    assert_equal_single_runs(
        [varied(seed, robot, law, switching, lane) for lane, robot in enumerate(robots)]
    )


@pytest.mark.slow
@pytest.mark.parametrize('difference', [None, ('frequency', 4.0), ('phase', 1.0)])
def test_lanes_equal_disturbance_waves_equal_single_runs(
    difference: tuple[str, float] | None
) -> None:
    robot, frequency, phase = Machine(DEFAULT), np.array([3.0, 0.0, -1.5, 9.0]), np.zeros(4)
    scenarios = [
        replace(varied(3, robot, 'rasmc', 'tanh', lane), frequency=frequency, phase=phase)
        for lane in range(LANES)
    ]
    if difference is not None:
        name, value = difference
        changed = np.array(getattr(scenarios[-1], name))
        changed[-1] = value
        scenarios[-1] = replace(scenarios[-1], **{name: changed})
    assert_equal_single_runs(scenarios)


@pytest.mark.slow
def test_lanes_every_law_interpreted_equal_single_runs() -> None:
    done = subprocess.run(
        [sys.executable, Path(__file__).parents[1] / 'helpers' / 'laws_in_lanes.py'],
        env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=True,
    )
    assert done.stdout == ''
