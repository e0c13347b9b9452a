# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reference samples and states that apply at a time."""

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.log.read.timeline import last_pass, PassStart, sample_reference
from masmc_ros.messages.reference_window import ReferenceWindow
import numpy as np
import pytest

MS = 1_000_000


def window(first: int, count: int, value: float, period: int = 1) -> ReferenceWindow:
    """Return a window at rest at `value`; times in ms."""
    samples = np.zeros((count, 3, 4))
    samples[:, 0] = value
    return ReferenceWindow(first * MS, period / 1000, samples)


def set_point(value: float) -> ReferenceWindow:
    """Return a moving set-point."""
    samples = np.full((1, 3, 4), 7.0)
    samples[:, 0] = value
    return ReferenceWindow(None, 0.0, samples)


def positions(windows: list[tuple[int, ReferenceWindow]], times: list[float]) -> list[float]:
    """Return x_E at times in ms."""
    stamps = np.array([round(time * MS) for time in times], dtype=np.int64)
    return sample_reference(windows, stamps)[:, 0].tolist()


def test_sample_reference_newer_windows_replace_overlaps() -> None:
    windows = [(0, window(0, 10, 1.0)), (0, window(4, 3, 2.0)), (0, window(6, 2, 3.0))]
    assert positions(windows, list(range(10))) == [1, 1, 1, 1, 2, 2, 3, 3, 1, 1]


def test_sample_reference_newer_window_replaces_earlier_part() -> None:
    windows = [(0, window(5, 3, 1.0)), (0, window(8, 3, 2.0)), (0, window(3, 6, 3.0))]
    assert positions(windows, list(range(3, 11))) == [3, 3, 3, 3, 3, 3, 2, 2]


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(1, 12)), max_size=12))
def test_sample_reference_last_covering_window_applies(spans: list[tuple[int, int]]) -> None:
    windows = [
        (0, window(first, count, float(number))) for number, (first, count) in enumerate(spans)
    ]
    for time in range(45):
        covering = [n for n, (first, count) in enumerate(spans) if first <= time < first + count]
        if covering:
            assert positions(windows, [time]) == [covering[-1]]


def test_sample_reference_before_first_sample_is_nan() -> None:
    assert np.isnan(sample_reference([], np.array([0]))).all()
    reference = sample_reference([(0, window(5, 2, 1.0))], np.array([0, 4 * MS, 5 * MS]))
    assert np.isnan(reference[:2]).all()
    assert not np.isnan(reference[2]).any()


def test_sample_reference_past_the_end_holds_position() -> None:
    samples = np.full((3, 3, 4), 5.0)
    reference = sample_reference(
        [(0, ReferenceWindow(0, 0.001, samples))], np.array([2 * MS, 2 * MS + 1, 2 * MS + 2])
    )
    assert (reference[:2] == 5.0).all()
    assert (reference[2, :4] == 5.0).all()
    assert not reference[2, 4:].any()


def test_sample_reference_gap_between_windows_holds_position() -> None:
    windows = [(0, window(0, 3, 1.0)), (0, window(10, 3, 2.0))]
    assert positions(windows, [2, 5, 9.9, 10]) == [1, 1, 1, 2]


def test_sample_reference_set_point_holds_until_next_window() -> None:
    windows = [(0, window(0, 3, 1.0)), (5 * MS, set_point(2.0))]
    assert positions(windows, [2, 4, 5, 6, 100]) == [1, 1, 2, 2, 2]
    reference = sample_reference(windows, np.array([100 * MS]))
    assert (reference[0, 4:] == 7.0).all()
    windows.append((6 * MS, window(8, 3, 3.0)))
    windows.append((7 * MS, set_point(4.0)))
    assert positions(windows, [5, 6.5, 7, 8, 10, 50]) == [2, 2, 4, 3, 3, 3]


def test_sample_reference_set_point_during_trajectory_is_ignored() -> None:
    windows = [
        (0, window(0, 20, 1.0)), (5 * MS, set_point(2.0)), (6 * MS, window(20, 5, 3.0))
    ]
    assert positions(windows, [4, 5, 6, 20, 100]) == [1, 1, 1, 3, 3]


@given(
    st.lists(st.floats(-3, 3), min_size=6, max_size=6),
    st.integers(1, 40),
    st.floats(0.05, 0.95),
)
def test_sample_reference_quintic_is_interpolated_exactly(
    coefficients: list[float], period_ms: int, part: float
) -> None:
    """Position, velocity and acceleration of any polynomial of degree five."""
    path = np.polynomial.Polynomial(coefficients)
    derivatives = [path, path.deriv(), path.deriv(2)]
    period = period_ms / 1000
    knots = np.arange(4) * period
    samples = np.stack([f(knots) for f in derivatives], axis=1)[:, :, None]
    windows = [(0, ReferenceWindow(0, period, np.repeat(samples, 4, axis=2)))]
    before = samples.copy()
    stamps = np.rint((np.arange(3) + part) * period * 1e9).astype(np.int64)
    reference = sample_reference(windows, stamps).reshape(3, 3, 4)
    expected = np.stack([f(stamps / 1e9) for f in derivatives], axis=1)
    scale = 1.0 / period ** np.arange(3)
    assert reference[:, :, 2] == pytest.approx(expected, abs=1e-12 * scale.max())
    assert np.array_equal(samples, before)


def test_sample_reference_contiguous_windows_are_joined() -> None:
    windows = [(0, window(0, 3, 1.0)), (0, window(3, 3, 2.0))]
    [reference] = positions(windows, [2.5])
    assert reference == pytest.approx(1.5)


def test_last_pass_reset_drops_earlier_states() -> None:
    stamps = np.array([0, 1, 2, 3, 0, 1, 2])
    assert last_pass(stamps).tolist() == [4, 5, 6]
    assert last_pass(np.array([0, 1, 2, 1, 2])).tolist() == [0, 3, 4]
    assert last_pass(np.array([], dtype=np.int64)).tolist() == []


@given(st.lists(st.integers(0, 20)))
def test_last_pass_stamps_ascend_and_last_is_kept(stamps: list[int]) -> None:
    array = np.array(stamps, dtype=np.int64)
    remaining = last_pass(array)
    assert (np.diff(array[remaining]) > 0).all()
    assert list(remaining[-1:]) == list(range(len(stamps)))[-1:]
    for index in set(range(len(stamps))) - set(remaining.tolist()):
        assert min(stamps[index + 1:]) <= stamps[index]


@given(st.integers(20, 60), st.integers(1, 60), st.lists(st.integers(0, 120)), st.integers(0, 6))
def test_last_pass_late_responses_belong_to_their_state(
    before: int, after: int, answered: list[int], late: int
) -> None:
    """Responses precede their states or follow them by a few messages."""
    ticks = [*range(before), *range(after)]
    selected = sorted({k for k in answered if k < len(ticks)})
    for shift in (-late, late):
        # A message consists of its place in the log, its kind and the index of its state.
        messages = [(k + 0.5, False, k) for k in range(len(ticks))]
        messages += [(k + 0.5 + shift + 0.25, True, k) for k in selected]
        messages.sort()
        orders = [place for place, (_, is_answer, _) in enumerate(messages) if not is_answer]
        last_start = PassStart(orders, np.array(ticks, np.int64) * MS)
        for place, (_, is_answer, k) in enumerate(messages):
            if is_answer:
                stamp = ticks[k] * MS
                assert last_start.is_over(place, stamp) == (k >= before)
                [is_valid] = last_start.are_valid(np.array([place]), np.array([stamp]))
                assert is_valid == (k >= before)


def test_last_pass_without_stamp_uses_place_in_log() -> None:
    last_start = PassStart([2, 4, 6, 8], np.array([0, 5, 0, 5]) * MS)
    is_over = [last_start.is_over(place) for place in (0, 3, 5, 7, 9)]
    assert is_over == [False, False, False, True, True]
    assert PassStart().is_over(0, 5 * MS)
    assert PassStart([2, 4], np.array([0, 5]) * MS).is_over(0)
