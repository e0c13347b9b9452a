# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Activation after a pause: the approach keeps the robot within its reach and limits."""

from __future__ import annotations

import math
from typing import Any

from helpers.core_loop import CoreLoop, node_values
from hypothesis import assume, given, HealthCheck, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.reference_window import ReferenceWindow
import numpy as np
import pytest

WHEEL_SPEED, ARM_SPEED = 30.0, 12.0
"""Bounds in rad/s: 1.5 m/s for a wheel of 0.0508 m, and ten times the paper's motion."""

SHORTEST, LONGEST, MARGIN = 0.152, 0.876, 0.02
"""Distances in m between E and F of the folded and of the stretched arm, and a margin."""

pauses = st.floats(-1.0, math.log10(600.0)).map(lambda exponent: 10.0**exponent)


def worst_speeds(signals: dict[str, np.ndarray]) -> tuple[float, float]:
    rates = np.abs(signals['velocity'][:, 3:])
    return float(rates[:, :2].max()), float(rates[:, 2:].max())


def check(loop: CoreLoop, seconds: float) -> None:
    signals = loop.run(seconds)
    wheels, arm = worst_speeds(signals)
    assert wheels < WHEEL_SPEED, (loop.now, loop.reports[-3:])
    assert arm < ARM_SPEED, (loop.now, loop.reports[-3:])
    torque = np.nan_to_num(signals['torque'])
    assert (np.abs(torque) <= [8.0, 8.0, 20.0, 10.0]).all()


def pause_and_continue(
    loop: CoreLoop, off_at: float, pause: float, after: float, *, may_fail: bool = False
) -> None:
    check(loop, off_at)
    loop.perform(loop.core.on_enable(loop.now, enabled=False))
    check(loop, pause)
    loop.perform(loop.core.on_enable(loop.now, enabled=True))
    check(loop, after)
    is_safe = may_fail and loop.state.startswith('fault: run-away')
    assert loop.state == 'active' or is_safe, loop.reports


@pytest.mark.parametrize('pause', [0.1, 2.0, 20.0, 40.0])
def test_enable_after_pause_reaches_reference(pause: float) -> None:
    loop = CoreLoop(node_values())
    pause_and_continue(loop, 5.0, pause, 5.0)
    # The approach to half of the reference has 0.25 m/s; then the law determines the error.
    while loop.core.drive.approach.is_on:
        check(loop, 1.0)
    check(loop, 5.0)
    assert np.abs(loop.controller.error).max() < 0.01


def test_enable_after_ten_minutes_stays_bounded() -> None:
    pause_and_continue(CoreLoop(node_values()), 5.0, 600.0, 30.0)


@pytest.mark.parametrize(
    ('offset', 'amplitude', 'frequency', 'phase', 'y'),
    [(-0.25, 0.125, 0.875, (0.0, 4.0), 2.5), (0.234375, 0.25, 1.0, (2.0, 4.0), 1.5)],
)
def test_controller_start_with_stretched_arm_stays_active(
    offset: float, amplitude: float, frequency: float, phase: tuple[float, float], y: float
) -> None:
    """The elbow is bent far enough to remain bent during the approach."""
    values = node_values(
        trajectory={
            'line_sine.offset': [offset, 0.0, 0.0, 0.0],
            'line_sine.slope': [0.0, 0.0, 0.0, 0.0],
            'line_sine.amplitude': [0.0, 0.25, 0.0, amplitude],
            'line_sine.frequency': [0.0, frequency, 0.0, 1.0],
            'line_sine.phase': [0.0, phase[0], 0.0, phase[1]],
        },
        plant={'initial_joints': [0.0, 0.0, 0.0, 0.0], 'initial_pose': [0.0, y, 0.0]},
    )
    pause_and_continue(CoreLoop(values), 2.0, 1.0, 8.0)


def scenario_of(data: st.DataObject) -> dict[str, dict[str, Any]]:
    """Draw a random position of the robot and a path within the reach of its arm."""

    def numbers(low: float, high: float, count: int) -> list[float]:
        return data.draw(st.lists(st.floats(low, high), min_size=count, max_size=count))

    speed = numbers(-0.2, 0.2, 2)
    return {
        'trajectory': {
            'line_sine.offset': [*numbers(-0.6, 0.6, 2), 0.0, 0.0],
            'line_sine.slope': [*speed, *speed],
            'line_sine.amplitude': numbers(0.0, 0.3, 4),
            'line_sine.frequency': numbers(0.0, 1.0, 4),
            'line_sine.phase': numbers(0.0, 6.0, 4),
        },
        'plant': {
            'initial_joints': [0.0, 0.0, *numbers(-3.0, 3.0, 2)],
            'initial_pose': numbers(-3.0, 3.0, 3),
        },
    }


def check_any_pause(data: st.DataObject, pause: float) -> None:
    loop = CoreLoop(node_values(**scenario_of(data)))
    try:
        samples = loop.trajectory.sample(0, round((pause + 60.0) / loop.period))
    except InputError:
        assume(False)
    reach = np.linalg.norm(samples[:, 0:2] - samples[:, 2:4], axis=1)
    # No law in task space holds a stretched or a folded arm: its safe stop must be bounded.
    is_singular = reach.min() < SHORTEST + MARGIN or reach.max() > LONGEST - MARGIN
    pause_and_continue(
        loop, data.draw(st.floats(0.1, 30.0)), pause, 30.0, may_fail=bool(is_singular)
    )


@settings(max_examples=4, suppress_health_check=list(HealthCheck))
@given(st.data(), st.floats(0.1, 20.0))
def test_enable_at_random_position_after_pause_stays_bounded(
    data: st.DataObject, pause: float
) -> None:
    check_any_pause(data, pause)


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(st.data(), pauses)
def test_enable_after_random_long_pause_stays_bounded(data: st.DataObject, pause: float) -> None:
    check_any_pause(data, pause)


def test_reference_out_of_reach_rejected_position_held() -> None:
    loop = CoreLoop(node_values())
    check(loop, 2.0)
    far = np.zeros((200, 3, 4))
    far[:, 0, 0] = 2.0
    with pytest.raises(InputError, match='cannot be reached'):
        loop.core.on_reference(
            ReferenceWindow(loop.timing.stamp(loop.tick), loop.period, far), loop.now
        )
    # No other reference arrives: the last position is held.
    signals = loop.run(10.0, has_reference=False)
    assert loop.state == 'active'
    assert np.abs(signals['velocity'][-1, 3:]).max() < 1.0
