# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of a recording: the time up to which no message is missing."""

from __future__ import annotations

from masmc_ros.nodes.recorder import progress
from masmc_ros.nodes.recorder.progress import Coverage
import pytest


def recorded(last: int, *, frames: int, decimation: int = 1) -> Coverage:
    """Return the coverage of states and commands up to `last` and frames up to `frames`."""
    recording = Coverage()
    for stamp in range(last + 1):
        recording.add_state(stamp)
        recording.answered = stamp
        if stamp <= frames and stamp % decimation == 0:
            recording.add('tf', stamp)
    return recording


def test_coverage_is_that_of_the_most_delayed_topic() -> None:
    assert recorded(50, frames=50).reached() == 50
    assert recorded(50, frames=20).reached() == 21  # the next one may be in transit
    recording = recorded(50, frames=50)
    recording.answered = 30
    assert recording.reached() == 30


def test_coverage_decimated_topic_counts_from_its_next_due_time() -> None:
    assert recorded(59, frames=50, decimation=10).reached() == 59
    assert recorded(75, frames=50, decimation=10).reached() == 60


def test_coverage_silent_topic_is_ignored_after_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    assert recorded(50, frames=-1).reached() == 50
    recording = recorded(50, frames=20)
    recording.forget(['tf'])
    assert recording.reached() == 50
    clock = 100.0
    monkeypatch.setattr(progress.time, 'monotonic', lambda: clock)
    recording = recorded(50, frames=20)
    assert recording.reached() == 21
    clock += 3.5
    assert recording.reached() == 21
    clock += 1.0
    assert recording.reached() == 50
    recording.add('tf', 21)
    recording.add('tf', 22)
    assert recording.reached() == 23


def test_coverage_after_reset_starts_again() -> None:
    recording = recorded(50, frames=50)
    for stamp in range(11):
        recording.add_state(stamp)
        recording.answered = stamp
    assert recording.reached() == 0
    for stamp in range(11):
        recording.add('tf', stamp)
    assert recording.reached() == 10
