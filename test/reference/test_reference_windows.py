# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Who owns the reference: windows of a trajectory, or a set-point, one at a time."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.reference.windows import ReferenceWindows
import numpy as np
import pytest

MS = 1_000_000
POINT = np.arange(4.0)


def add(windows: ReferenceWindows, first: int, count: int, value: float = 1.0) -> None:
    """Add samples 1 ms apart from a time in ms on; x_E moves by 1 m/s."""
    samples = np.full((count, 12), value)
    samples[:, 0] = 1e-3 * (first + np.arange(count))
    samples[:, 4], samples[:, 8] = 1.0, 0.0
    windows.add(first * MS, 0.001, samples)


def test_a_set_point_beside_a_trajectory_is_refused() -> None:
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    add(windows, 10, 10)
    # In the middle, at an end, between two windows, and before the first state has come.
    for now in (0, 5 * MS, 9 * MS, 9 * MS + MS // 2, 19 * MS, None):
        with pytest.raises(InputError, match='beside a trajectory'):
            windows.set_point(POINT, now)
    for stamp in range(20):
        found = windows.at(stamp * MS)
        assert found is not None
        assert found[1] == 1.0
    assert windows.at(20 * MS) is None


def test_after_a_trajectory_has_ended_a_set_point_holds() -> None:
    """At the very first state that nothing covers: in lock-step it waits for an answer."""
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    assert windows.at(10 * MS) is None
    windows.set_point(POINT, 10 * MS)
    for stamp in (10, 11, 1000):
        found = windows.at(stamp * MS)
        assert found is not None
        assert found[:4].tolist() == POINT.tolist()


def test_a_trajectory_that_begins_takes_over_from_a_set_point_and_tells() -> None:
    told: list[str] = []
    windows = ReferenceWindows(4, told.append)
    windows.set_point(POINT)
    add(windows, 5, 10)
    found = windows.at(4 * MS)
    assert found is not None
    assert found[:4].tolist() == POINT.tolist()
    windows.set_point(POINT + 1.0, 4 * MS)
    assert told == []
    found = windows.at(5 * MS)
    assert found is not None
    assert found[1] == 1.0
    assert len(told) == 1
    assert 'set-point' in told[0]
    # It does not come back after the trajectory.
    assert windows.at(15 * MS) is None
    assert len(told) == 1


def test_between_two_windows_the_path_goes_on() -> None:
    """States of hardware lie off the grid, also between the last sample and the first."""
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    add(windows, 10, 10)
    for stamp in (8.5, 9.25, 9.5, 9.75, 10.5):
        found = windows.at(round(stamp * MS))
        assert found is not None, stamp
        assert found[0] == pytest.approx(1e-3 * stamp, abs=1e-12)
        assert found[4] == pytest.approx(1.0, abs=1e-9)
    # Windows that lie apart are an end and a beginning.
    add(windows, 30, 10)
    assert windows.at(25 * MS) is None
    assert windows.at(19 * MS + MS // 2) is None
