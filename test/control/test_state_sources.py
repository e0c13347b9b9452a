# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Detection of states from two robots, for random motions."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.control.gates import StateSources
import numpy as np

PERIOD = 0.01
MS = 1_000_000
FEW = settings(max_examples=60, deadline=None)


def feed(sources: StateSources, tick: int, position: float, velocity: float) -> bool:
    """Add a state of two joints; return True if the states are mixed."""
    numbers = np.array([position, 0.0]), np.array([velocity, 0.0])
    sources.add(10 * MS * tick, *numbers, tick * PERIOD)
    return sources.are_mixed


@FEW
@given(st.floats(0.1, 20.0), st.floats(0.1, 3.0), st.integers(0, 400), st.integers(1, 30))
def test_state_sources_moving_robot_restarts_one_source(
    frequency: float, amplitude: float, restart: int, lost: int
) -> None:
    """Fast motion, a restart at another position and lost states are one robot."""
    sources = StateSources(2)
    for tick in range(500):
        if restart < tick < restart + lost:
            continue
        time = PERIOD * (tick if tick < restart else tick - restart)
        phase = frequency * time
        velocity = amplitude * frequency * float(np.cos(phase))
        assert not feed(sources, tick, amplitude * float(np.sin(phase)), velocity)


@FEW
@given(st.floats(0.05, 3.0), st.integers(1, 10))
def test_state_sources_zeros_beside_robot_mixed(offset: float, every: int) -> None:
    """Zeros at any rate above 1/s are found with the second jump, and forgotten after 3 s."""
    sources = StateSources(2)
    for tick in range(2 * every + 2):
        is_other = tick % (every + 1) == every
        mixed = feed(sources, tick, 0.0 if is_other else offset, 0.0)
        assert mixed == (tick > every)
    assert feed(sources, tick + 290, 0.0 if is_other else offset, 0.0)
    assert not feed(sources, tick + 320, 0.0 if is_other else offset, 0.0)
