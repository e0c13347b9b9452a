# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Waypoints: passed at their times, smooth in between, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from helpers.robots import between, DEFAULT, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.reference.trajectory import parameters, Trajectory
from masmc_ros.reference.waypoints import Waypoints
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.polynomial.polynomial import polyder, polyval, polyvander
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

LONGEST, SHORTEST = 3.0, 0.2
FARTHEST = 2.0
PERIOD = 0.001
ROBOT = robot_of({f'robot.{name}': value for name, value in DEFAULT.items()})
VALUES = {p.name: p.default for p in parameters(TWO_LINK)} | {'type': 'waypoints'}
BACK = {
    'waypoints.times': (0.5, 2.0, 3.0),
    'waypoints.points': (0.3, 0.5, 0.0, 0.0, 0.6, 0.7, 0.2, 0.1, 0.3, 0.5, 0.0, 0.0),
}


@dataclass(frozen=True)
class Way:
    """Points (n, axes), their times (n), and the option to stop at every point."""

    times: Array
    points: Array
    stops: bool

    @property
    def reference(self) -> Waypoints:
        """Return the trajectory."""
        values = {'times': self.times, 'points': self.points.ravel(), 'stops': self.stops}
        return Waypoints(values)


@st.composite
def ways(draw: st.DrawFn, stops: bool | None = None) -> Way:
    count, axes = draw(st.integers(1, 7)), draw(st.integers(1, 4))
    steps = [draw(between(SHORTEST, LONGEST)) for _ in range(count)]
    times = np.cumsum(steps) - draw(st.sampled_from((0.0, steps[0])))
    numbers = [draw(between(-FARTHEST, FARTHEST)) for _ in range(count * axes)]
    at_rest = draw(st.booleans()) if stops is None else stops
    return Way(times, np.array(numbers).reshape(count, axes), at_rest)


def parts(samples: Array) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations, (n, axes) each."""
    x, v, a = np.hsplit(samples, 3)
    return x, v, a


def pieces(way: Way) -> list[tuple[Array, float]]:
    """Return coefficients (6, axes) by powers of time and duration of every segment."""
    segments = []
    for first, end in pairwise(way.times):
        part = 0.5 * (1.0 - np.cos(np.pi * np.arange(6) / 5.0))
        x = parts(way.reference.sample(first + (end - first) * part))[0]
        powers = (end - first) ** np.arange(6.0)
        segments.append((np.linalg.solve(polyvander(part, 5), x) / powers[:, None], end - first))
    return segments


def jerk_integral(way: Way) -> Array:
    """Return the integral of the squared jerk of every axis, exact for degree five."""
    nodes, weights = leggauss(3)
    total = np.zeros(way.points.shape[1])
    for piece, length in pieces(way):
        jerk = polyval(0.5 * length * (nodes + 1.0), polyder(piece, 3))
        total += 0.5 * length * (jerk**2 @ weights)
    return total


@PROPERTY
@given(ways())
def test_waypoints_pass_points_in_time_and_rest_at_ends(way: Way) -> None:
    reference = way.reference
    assert parts(reference.sample(way.times))[0].tolist() == way.points.tolist()
    first, last = way.times[0], way.times[-1]
    for times, point in (
        ((0.0, 0.5 * first, first), way.points[0]),
        ((last, np.nextafter(last, np.inf), 1e6), way.points[-1]),
    ):
        x, v, a = parts(reference.sample(np.array(times)))
        assert (x == point).all()
        assert not v.any()
        assert not a.any()


@PROPERTY
@given(ways())
def test_waypoints_velocities_and_accelerations_are_derivatives(way: Way) -> None:
    for (piece, length), first in zip(pieces(way), way.times[:-1], strict=True):
        at = np.linspace(0.0, length, 9)[:-1]
        samples = parts(way.reference.sample(first + at))
        for order, (actual, size) in enumerate(zip(samples, (1e-10, 1e-8, 1e-6), strict=True)):
            expected = polyval(at, polyder(piece, order)).T
            assert actual == pytest.approx(expected, abs=size)


@PROPERTY
@given(ways(stops=False))
def test_waypoints_four_derivatives_are_continuous_at_points(way: Way) -> None:
    for (before, length), (after, _) in pairwise(pieces(way)):
        for order in range(5):
            left, right = polyval(length, polyder(before, order)), polyder(after, order)[0]
            assert left == pytest.approx(right, rel=1e-6, abs=1e-6 / SHORTEST**order)


@PROPERTY
@given(ways())
def test_waypoints_velocity_and_acceleration_are_continuous(way: Way) -> None:
    """The first and last points are included; before and after them the reference rests."""
    shortest = 1e-9
    before, after = way.times - shortest, way.times + shortest
    for one, other in zip(
        parts(way.reference.sample(before)), parts(way.reference.sample(after)), strict=True
    ):
        assert one == pytest.approx(other, abs=1e-3)


@PROPERTY
@given(ways(stops=True))
def test_waypoints_with_stops_rest_at_points_on_straight_lines(way: Way) -> None:
    _, v, a = parts(way.reference.sample(way.times))
    assert not v.any()
    assert not a.any()
    for k in range(len(way.times) - 1):
        at = np.linspace(way.times[k], way.times[k + 1], 9)
        x, _, _ = parts(way.reference.sample(at))
        part = (at - at[0]) / (at[-1] - at[0])
        done = 10.0 * part**3 - 15.0 * part**4 + 6.0 * part**5
        straight = way.points[k] + done[:, None] * (way.points[k + 1] - way.points[k])
        assert x == pytest.approx(straight, abs=1e-12)


@PROPERTY
@given(ways(stops=False))
def test_waypoints_jerk_integral_is_minimal(way: Way) -> None:
    """A path through the same points and a further deviating one has a larger jerk integral."""
    if len(way.times) < 2:
        return
    middle = 0.5 * (way.times[0] + way.times[1])
    point = parts(way.reference.sample(np.array([middle])))[0][0]
    times = np.insert(way.times, 1, middle)
    smallest = jerk_integral(way)
    # A further point on the path leaves the path unchanged; any other point changes it.
    same = Way(times, np.insert(way.points, 1, point, axis=0), stops=False)
    other = Way(times, np.insert(way.points, 1, point + 0.1, axis=0), stops=False)
    assert jerk_integral(same) == pytest.approx(smallest, rel=1e-6, abs=1e-4)
    assert (jerk_integral(other) > smallest).all()


@PROPERTY
@given(ways(), st.lists(between(-1.0, 25.0), min_size=1, max_size=20))
def test_waypoints_single_samples_equal_samples_of_block(way: Way, times: list[float]) -> None:
    at = np.array([*times, *way.times])
    whole = way.reference.sample(at)
    single = np.vstack([way.reference.sample(at[k:k + 1]) for k in range(len(at))])
    assert whole.tobytes() == single.tobytes()


@pytest.mark.parametrize('kind', ['waypoints', 'arc'])
def test_reference_windows_reproduce_trajectory_samples_exactly(kind: str) -> None:
    circle = {'arc.start': (0.3, 0.5, 0.0, 0.1), 'arc.centre': (0.3, 0.6), 'arc.duration': 3.0}
    trajectory = Trajectory({**VALUES, **BACK, **circle, 'type': kind}, PERIOD, ROBOT)
    count, length = 3500, 500
    whole = trajectory.sample(0, count)
    windows = ReferenceWindows(4)
    for first in range(0, count, length):
        samples = trajectory.sample(first, length)
        sent = ReferenceWindow(first * 1_000_000, PERIOD, samples).to_bytes()
        got = ReferenceWindow.from_bytes(sent)
        assert got is not None
        assert got.stamp_ns is not None
        windows.add(got.stamp_ns, got.period, got.samples.reshape(length, 12))
    for tick in range(count):
        at = windows.at(tick * 1_000_000)
        assert at is not None
        assert at.tobytes() == whole[tick].tobytes()
    # The same holds where windows meet: between ticks 499 and 500.
    finer = Trajectory({**VALUES, **BACK, **circle, 'type': kind}, 0.5 * PERIOD, ROBOT)
    for tick in (499, 1200):
        at = windows.at(tick * 1_000_000 + 500_000)
        assert at == pytest.approx(finer.sample(2 * tick + 1, 1)[0], abs=1e-9)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'times': ()}, 'a time for each point'),
        ({'times': (0.0, 2.0, 1.0)}, '1.0 follows 2.0; expected times that ascend'),
        ({'times': (0.0, 1.0, 1.0)}, '1.0 follows 1.0; expected times that ascend'),
        ({'times': (0.0, 1.0)}, '12 numbers; expected 8, for each of 2 times one of x_E, y_E'),
        ({'times': (0.0, 1.0, 2.0, 3.0)}, '12 numbers; expected 16'),
        ({'points': (0.3, 0.5, 0.0)}, '3 numbers; expected 12'),
    ],
)
def test_waypoints_invalid_times_or_points_raise(values: dict[str, object], words: str) -> None:
    given_ = {f'waypoints.{name}': value for name, value in values.items()}
    with pytest.raises(InputError, match=words):
        Trajectory({**VALUES, **BACK, **given_}, PERIOD, ROBOT)


def test_waypoints_default_holds_start_of_task() -> None:
    samples = Trajectory(VALUES, PERIOD, ROBOT).sample(0, 3)
    assert samples.tolist() == [[0.3, 0.5] + [0.0] * 10] * 3
