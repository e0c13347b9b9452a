# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""How far a recorder says that it is: not beyond what may still be missing."""

from __future__ import annotations

from masmc_ros.nodes.recorder import coverage
from masmc_ros.nodes.recorder.coverage import Coverage
import pytest


def recorded(last: int, *, frames: int, decimation: int = 1) -> Coverage:
    """Return the coverage of states and commands up to a stamp, frames up to another."""
    found = Coverage()
    for stamp in range(last + 1):
        found.add_state(stamp)
        found.answered = stamp
        if stamp <= frames and stamp % decimation == 0:
            found.add('tf', stamp)
    return found


def test_the_one_furthest_behind_counts() -> None:
    assert recorded(50, frames=50).reached() == 50
    assert recorded(50, frames=20).reached() == 21  # the next one may be under way
    found = recorded(50, frames=50)
    found.answered = 30
    assert found.reached() == 30


def test_a_topic_is_not_behind_before_its_next_message_is_due() -> None:
    assert recorded(59, frames=50, decimation=10).reached() == 59
    assert recorded(75, frames=50, decimation=10).reached() == 60


def test_what_never_came_or_comes_no_more_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    assert recorded(50, frames=-1).reached() == 50
    found = recorded(50, frames=20)
    found.forget(['tf'])
    assert found.reached() == 50
    now = 100.0
    monkeypatch.setattr(coverage.time, 'monotonic', lambda: now)
    found = recorded(50, frames=20)
    assert found.reached() == 21
    now += 3.5
    assert found.reached() == 21
    now += 1.0
    assert found.reached() == 50
    found.add('tf', 21)
    found.add('tf', 22)
    assert found.reached() == 23


def test_after_a_robot_is_set_back_everything_is_expected_anew() -> None:
    found = recorded(50, frames=50)
    for stamp in range(11):
        found.add_state(stamp)
        found.answered = stamp
    assert found.reached() == 0
    for stamp in range(11):
        found.add('tf', stamp)
    assert found.reached() == 10
