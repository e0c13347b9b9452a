# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Priority of references: windows of a trajectory or a set-point, one at a time."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.reference.windows import ReferenceWindows
import numpy as np
import pytest

MS = 1_000_000
POINT = np.arange(4.0)


def add(windows: ReferenceWindows, first: int, count: int, value: float = 1.0) -> None:
    """Add samples 1 ms apart from a time in ms; x_E moves at 1 m/s."""
    samples = np.full((count, 12), value)
    samples[:, 0] = 1e-3 * (first + np.arange(count))
    samples[:, 4], samples[:, 8] = 1.0, 0.0
    windows.add(first * MS, 0.001, samples)


def test_reference_windows_set_point_during_trajectory_raises() -> None:
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    add(windows, 10, 10)
    # Inside a window, at its end, between two windows, and before the first state.
    for stamp_ns in (0, 5 * MS, 9 * MS, 9 * MS + MS // 2, 19 * MS, None):
        with pytest.raises(InputError, match='while a trajectory runs'):
            windows.set_point(POINT, stamp_ns)
    for stamp in range(20):
        sample = windows.at(stamp * MS)
        assert sample is not None
        assert sample[1] == 1.0
    assert windows.at(20 * MS) is None


def test_reference_windows_set_point_after_trajectory_holds() -> None:
    """The set-point applies from the first uncovered state; in lock-step that state waits."""
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    assert windows.at(10 * MS) is None
    windows.set_point(POINT, 10 * MS)
    for stamp in (10, 11, 1000):
        sample = windows.at(stamp * MS)
        assert sample is not None
        assert sample[:4].tolist() == POINT.tolist()


def test_reference_windows_trajectory_replaces_set_point() -> None:
    log_lines: list[str] = []
    windows = ReferenceWindows(4, log_lines.append)
    windows.set_point(POINT)
    add(windows, 5, 10)
    sample = windows.at(4 * MS)
    assert sample is not None
    assert sample[:4].tolist() == POINT.tolist()
    windows.set_point(POINT + 1.0, 4 * MS)
    assert log_lines == []
    sample = windows.at(5 * MS)
    assert sample is not None
    assert sample[1] == 1.0
    assert len(log_lines) == 1
    assert 'set-point' in log_lines[0]
    # The set-point does not return after the trajectory.
    assert windows.at(15 * MS) is None
    assert len(log_lines) == 1


def test_reference_windows_adjacent_windows_are_interpolated() -> None:
    """Hardware states lie off the grid, also between the last sample and the first."""
    windows = ReferenceWindows(4)
    add(windows, 0, 10)
    add(windows, 10, 10)
    for stamp in (8.5, 9.25, 9.5, 9.75, 10.5):
        sample = windows.at(round(stamp * MS))
        assert sample is not None, stamp
        assert sample[0] == pytest.approx(1e-3 * stamp, abs=1e-12)
        assert sample[4] == pytest.approx(1.0, abs=1e-9)
    # A gap between windows ends one trajectory and starts another.
    add(windows, 30, 10)
    assert windows.at(25 * MS) is None
    assert windows.at(19 * MS + MS // 2) is None


def test_reference_windows_newest_used_from_its_start() -> None:
    """A path that starts within a window replaces the rest of it, and holds before and after."""
    windows = ReferenceWindows(4)
    old, new = np.zeros((101, 12)), np.ones((21, 12))
    windows.add(0, 0.01, old)
    assert windows.at(100_000_000) is not None
    windows.add(400_000_000, 0.01, new)
    used = [windows.at(tick * 10_000_000) for tick in range(101)]
    values = [sample[0] for sample in used if sample is not None]
    assert values == [0.0] * 40 + [1.0] * 21 + [0.0] * 40
    # A plant that is set back.
    back = [windows.at(tick * 10_000_000) for tick in range(100, -1, -1)]
    assert [sample[0] for sample in back if sample is not None] == values[::-1]
