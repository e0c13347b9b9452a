# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figure eights and rounded polygons: derivatives, rest at both ends, and shape."""

from __future__ import annotations

from typing import Any

from helpers.robots import between, PROPERTY
from hypothesis import assume, given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.reference.figure_eight import FigureEight
from masmc_ros.reference.reference import Reference
from masmc_ros.reference.rounded_polygon import RoundedPolygon
from masmc_ros.reference.trajectory import parameters
from masmc_ros.robot.mechanisms import DEFAULT
import numpy as np
import pytest

H = 1e-5
VECTOR = st.tuples(*[between(-1.0, 1.0)] * 3)
SCHEDULE = {
    'laps': st.integers(1, 2),
    'delay': st.sampled_from((0.0, 0.7)),
    'duration': between(1.0, 6.0),
}


@st.composite
def eights(draw: st.DrawFn) -> tuple[Reference, float, float]:
    """Draw a figure eight, its delay and its duration."""
    values = {name: draw(VECTOR) for name in ('start', 'along', 'across')}
    values |= {name: draw(strategy) for name, strategy in SCHEDULE.items()}
    return FigureEight(values), values['delay'], values['duration']


@st.composite
def polygons(draw: st.DrawFn) -> tuple[Reference, float, float]:
    """Draw a polygon with sides of at least 0.3, its delay and its duration."""
    corners = np.array(draw(st.lists(VECTOR, min_size=2, max_size=5)))
    sides = np.roll(corners, -1, axis=0) - corners
    assume(np.linalg.norm(sides, axis=1).min() > 0.3)
    values: dict[str, Any] = {'corners': corners, 'rounding': draw(between(0.2, 0.5))}
    values |= {name: draw(strategy) for name, strategy in SCHEDULE.items()}
    return RoundedPolygon(values), values['delay'], values['duration']


@PROPERTY
@given(st.one_of(eights(), polygons()), between(-0.2, 1.2))
def test_closed_curve_derivatives_equal_differences(
    drawn: tuple[Reference, float, float], part: float
) -> None:
    curve, delay, duration = drawn
    time = delay + part * duration
    before, current, after = curve.sample(np.array([time - H, time, time + H]))
    # The third derivative steps at the ends of corners, so the change of the next derivative
    # bounds the error of a difference.
    velocity = (after[:3] - before[:3]) / (2.0 * H)
    acceleration = (after[3:6] - before[3:6]) / (2.0 * H)
    spread = np.abs(after[6:] - current[6:]) + np.abs(before[6:] - current[6:])
    size = 1.0 + np.abs(current).max()
    assert np.abs(velocity - current[3:6]).max() <= H * spread.max() + 1e-9 * size
    assert np.abs(acceleration - current[6:]).max() <= spread.max() + 1e-8 * size


@PROPERTY
@given(st.one_of(eights(), polygons()))
def test_closed_curve_acceleration_is_continuous(
    drawn: tuple[Reference, float, float]
) -> None:
    curve, delay, duration = drawn
    times = delay + duration * np.linspace(-0.01, 1.01, 16_001)
    acceleration = curve.sample(times)[:, 6:]
    # A step of it would stay the largest difference on a finer grid.
    coarse, fine = (np.abs(np.diff(a, axis=0)).max() for a in (acceleration[::4], acceleration))
    assert fine <= 0.5 * coarse + 1e-9


@PROPERTY
@given(st.one_of(eights(), polygons()))
def test_closed_curve_starts_and_ends_at_rest(drawn: tuple[Reference, float, float]) -> None:
    curve, delay, duration = drawn
    samples = curve.sample(np.array([0.0, delay, delay + duration + 1e-9, 1e6]))
    assert samples[:, :3] == pytest.approx(np.tile(samples[0, :3], (4, 1)), abs=1e-12)
    assert samples[0, :3].tobytes() == samples[1, :3].tobytes()
    assert not samples[:, 3:].any()


def test_figure_eight_has_two_lobes() -> None:
    values = {'start': (0.3, 0.5), 'along': (0.2, 0.0), 'across': (0.0, 0.1), 'laps': 1}
    curve = FigureEight({**values, 'delay': 0.0, 'duration': 8.0})
    samples = curve.sample(np.linspace(0.0, 8.0, 8001))
    x, y = samples[:, 0], samples[:, 1]
    assert (x.min(), x.max()) == pytest.approx((0.1, 0.5), abs=1e-6)
    assert (y.min(), y.max()) == pytest.approx((0.4, 0.6), abs=1e-6)
    assert samples[4000, :2] == pytest.approx([0.3, 0.5], abs=1e-12)


def test_rounded_polygon_cuts_corners_and_keeps_sides() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    values = {'corners': square, 'rounding': 0.2, 'laps': 2, 'delay': 0.0, 'duration': 10.0}
    samples = RoundedPolygon(values).sample(np.linspace(0.0, 10.0, 10_001))
    x, y = samples[:, :2].T
    assert samples[:, :2].min() > -1e-12
    assert samples[:, :2].max() < 1.0 + 1e-12
    on_side = np.minimum.reduce([abs(x), abs(x - 1.0), abs(y), abs(y - 1.0)]) < 1e-12
    near_corner = np.linalg.norm(samples[:, None, :2] - square, axis=2).min(axis=1) <= 0.2
    assert (on_side | near_corner).all()
    assert not (on_side & near_corner).all()


@pytest.mark.parametrize(
    ('corners', 'words'),
    [
        ((0.0,) * 8, 'corner 1 repeats'),
        ((0.0,) * 7, '7 numbers; expected at least two corners, for each one of x_E'),
        ((0.0,) * 4, '4 numbers'),
    ],
)
def test_rounded_polygon_invalid_corners_raise(corners: tuple[float, ...], words: str) -> None:
    block = 'rounded_polygon.'
    values = {
        p.name.removeprefix(block): p.default
        for p in parameters(DEFAULT)
        if p.name.startswith(block)
    }
    with pytest.raises(InputError, match=words):
        RoundedPolygon.of({**values, 'corners': corners}, DEFAULT)
