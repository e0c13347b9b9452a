# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path of joints and base through points at certain times, checked against the robot's limits.

The interpolation follows joint_trajectory_controller: polynomials of degree three with velocities,
of degree five with accelerations. With positions only the path has minimum jerk (`waypoints.py`),
because the steps of velocity of straight lines are no reference for a robot.

Positions, velocities and accelerations are in m and rad; vectors of joints have the order of a
joint state.

Its task coordinates are the forward kinematics and its two derivatives. At each time the joints
move on the parabola q + s q' + s^2 q'' / 2. The task coordinates of five of its points give the
first and second derivative by s at s = 0, with an error of the fourth order: about 1e-10. This
serves every mechanism, also those of other packages, whose formulas have no second derivative of
the coordinates.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from masmc_ros.aliases import Array, Indices
from masmc_ros.errors import InputError
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots, stopped
from masmc_ros.reference.rotations import all_continued, continued_near
from masmc_ros.robot.declaration import Coordinate, Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np

_PER_SEGMENT = 10
"""Number of places between two points at which limits are checked."""

_BLOCK = 20_000
"""Number of places that are checked at once."""

_MARGIN = 1e-6
"""Share of a limit by which rounding may exceed it."""

_AT_REST = 1e-6
"""Largest velocity of the last point."""


@dataclass(frozen=True)
class JointPoints:
    """
    Points of a path of some joints.

    Attributes
    ----------
    columns
        Indices (k) of the joints among the positions of a joint state.
    times
        Times (n) in s from the start of the path, ascending, from 0 on.
    positions
        Positions (n, k).
    velocities, accelerations
        As `positions`; None if the interpolation determines them.

    """

    columns: Indices
    times: Array
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None

    def check(self) -> None:
        """Raise InputError for numbers that are not finite, and for times that do not ascend."""
        times = self.times
        wrong = ~np.isfinite(self.positions).all(axis=1)
        for derivatives in (self.velocities, self.accelerations):
            if derivatives is not None:
                wrong |= ~np.isfinite(derivatives).all(axis=1)
        if wrong.any():
            raise InputError(
                f'point {int(np.argmax(wrong)) + 1} has a number that is not finite; expected '
                'numbers everywhere'
            )
        if times[0] < 0.0:
            raise InputError(f'point 1 is at {times[0]:g} s; expected times from 0 s on')
        is_back = np.diff(times) <= 0.0
        if is_back.any():
            point = int(np.argmax(is_back))
            raise InputError(
                f'point {point + 2} at {times[point + 1]:.9g} s follows {times[point]:.9g} s; '
                'expected times that ascend'
            )
        if self.velocities is not None and np.abs(self.velocities[-1]).max() > _AT_REST:
            raise InputError(
                f'the last point moves ({np.abs(self.velocities[-1]).max():g} rad/s or m/s); '
                'expected zero velocities there, since the robot holds it'
            )


class JointState(NamedTuple):
    """Positions, velocities and accelerations (positions) of all joints at one time."""

    position: Array
    velocity: Array
    acceleration: Array

    @classmethod
    def at_rest(cls, position: Array) -> JointState:
        """Return the state of a robot at rest at positions (positions)."""
        return cls(position, np.zeros_like(position), np.zeros_like(position))


class JointPath:
    """
    Motion of all joints through points, from a start, with a hold after the last point.

    Attributes
    ----------
    end
        Time of the last point in s.

    """

    def __init__(self, points: JointPoints, start: JointState, heading: int | None) -> None:
        """
        Initialise the path.

        Parameters
        ----------
        points
            Checked points.
        start
            State of the joints at time 0. Joints without points hold its positions. A first point
            later than 0 is reached from it.
        heading
            Index of the heading of a mobile base among the positions, None without one. Its
            points mean angles modulo 2 pi: each is the one next to that before.

        """
        positions = points.positions
        if heading is not None and heading in points.columns:
            column = int(np.flatnonzero(points.columns == heading)[0])
            positions = positions.copy()
            angles = np.concatenate([[start.position[heading]], positions[:, column]])
            positions[:, column] = np.unwrap(angles)[1:]
        starts_later = points.times[0] > 0.0
        times = np.concatenate([[0.0], points.times]) if starts_later else points.times
        velocities, accelerations = points.velocities, points.accelerations
        if starts_later:
            at, rate, change = (values[points.columns] for values in start)
            positions = np.vstack([at, positions])
            velocities = None if velocities is None else np.vstack([rate, velocities])
            if accelerations is not None:
                accelerations = np.vstack([change, accelerations])
        knot_times, knots = _knots(times, positions, velocities, accelerations)
        count, width = len(start.position), len(points.columns)
        # A second knot at the end, at rest, holds the last point.
        self._times = np.append(knot_times, knot_times[-1])
        self._knots = np.zeros((len(self._times), 3 * count))
        self._knots[:, :count] = start.position
        self._knots[-1, points.columns] = positions[-1]
        for order in range(3):
            own = slice(order * width, (order + 1) * width)
            self._knots[:-1, order * count + points.columns] = knots[:, own]
        self._columns = points.columns
        self._start = start.position
        self.end = float(times[-1])

    @classmethod
    def braking(cls, state: JointState, duration: float) -> JointPath:
        """Return the motion that stops a state of the joints within a duration in s."""
        rest = stopped(*state, duration)
        points = JointPoints(
            np.arange(len(rest)), np.array([duration]), rest[None], np.zeros((1, len(rest))),
            np.zeros((1, len(rest))),
        )  # fmt: skip
        return cls(points, state, None)

    def sample(self, times: Array) -> Array:
        """Return (n, 3 positions) joint samples at times (n) in s from the start of the path."""
        samples: Array = sample_knots(self._times, self._knots, times)
        return samples

    def state(self, time: float) -> JointState:
        """Return the state of all joints at a time in s."""
        return JointState(*self.sample(np.array([time]))[0].reshape(3, -1))

    def grid(self) -> Array:
        """Return times (n) in s at which the path is checked: ten in each segment, and its end."""
        return places_between(self._times)

    def check_limits(self, mechanism: Mechanism, names: Sequence[str]) -> None:
        """
        Raise InputError if a joint leaves its range, or is faster than its limit.

        A joint that starts outside of its range may return into it.

        Parameters
        ----------
        mechanism
            Type of the robot.
        names
            Names (positions) of the joints, for messages.

        """
        base, columns = len(mechanism.base), self._columns
        free = np.full(base, np.inf)
        lower, upper = np.array(mechanism.position_limits).reshape(-1, 2).T
        start = self._start[columns]
        lower = np.minimum(np.concatenate([-free, lower])[columns], start)
        upper = np.maximum(np.concatenate([free, upper])[columns], start)
        speed = np.concatenate([free, mechanism.speed_limits])[columns]
        joints = [mechanism.positions[k] for k in columns]
        own_names = [names[k] for k in columns]
        count = len(self._start)
        fastest = _Worst()
        for times, samples in self._blocks():
            x, v = samples[:, columns], np.abs(samples[:, count + columns])
            beyond = np.maximum(lower - x, x - upper)
            row, joint = place = divmod(int(np.argmax(beyond)), len(columns))
            if beyond[place] > _MARGIN:
                raise InputError(
                    f'{own_names[joint]} is at {x[place]:.4g} {joints[joint].unit} at '
                    f'{times[row]:.3g} s of the path, {beyond[place]:.3g} {joints[joint].unit} '
                    f'outside of its range; expected {lower[joint]:.4g} to {upper[joint]:.4g}'
                )
            with np.errstate(divide='ignore', invalid='ignore'):
                share = np.where(v > 0.0, v / speed, 0.0)
            fastest.add(share, times, v)
        if fastest.share > 1.0 + _MARGIN:
            joint = fastest.joint
            raise InputError(
                f'{own_names[joint]} moves at {fastest.value:.4g} {_rate(joints[joint])} at '
                f'{fastest.time:.3g} s of the path, {100.0 * (fastest.share - 1.0):.3g} % above '
                f'its limit of {speed[joint]:.4g}; expected times longer by the factor '
                f'{np.ceil(1000.0 * fastest.share) / 1000.0:.3f}'
            )

    def _blocks(self) -> Iterator[tuple[Array, Array]]:
        times = self.grid()
        for first in range(0, len(times), _BLOCK):
            part = times[first:first + _BLOCK]
            yield part, self.sample(part)


class _Worst:
    """Largest share of a limit so far, with its place."""

    def __init__(self) -> None:
        self.share = self.time = self.value = 0.0
        self.joint = 0

    def add(self, share: Array, times: Array, values: Array) -> None:
        """Add shares and values (n, k) at times (n)."""
        row, joint = divmod(int(np.argmax(share)), share.shape[1])
        if share[row, joint] > self.share:
            self.share, self.time = float(share[row, joint]), float(times[row])
            self.value, self.joint = float(values[row, joint]), joint


def _rate(joint: Coordinate) -> str:
    return f'{joint.unit}/s'


def places_between(times: Array) -> Array:
    """Return ten times (k) in every segment between knots at times (n), and the last one."""
    known = np.unique(times)
    parts = np.arange(_PER_SEGMENT) / _PER_SEGMENT
    inner = known[:-1, None] + np.diff(known)[:, None] * parts
    return np.append(inner.reshape(-1), known[-1])


def _knots(
    times: Array, positions: Array, velocities: Array | None, accelerations: Array | None
) -> tuple[Array, Array]:
    """
    Return times (m) and knots (m, 3 k) between which the path is of degree five.

    Parameters
    ----------
    times
        Times (n) of the points in s.
    positions
        Positions (n, k).
    velocities, accelerations
        As `positions`, or None.

    """
    nothing = np.zeros_like(positions)
    if velocities is None:
        knots = np.hstack([positions, nothing, nothing])
        smooth_knots(times, knots)
        return times, knots
    if accelerations is not None:
        return times, np.hstack([positions, velocities, accelerations])
    if len(times) == 1:
        return times, np.hstack([positions, velocities, nothing])
    # A cubic has other accelerations at its start than the one before at its end: two knots at
    # one time.
    step = np.diff(times)[:, None]
    slope = np.diff(positions, axis=0) / step
    starts = (6.0 * slope - 4.0 * velocities[:-1] - 2.0 * velocities[1:]) / step
    ends = (2.0 * velocities[:-1] + 4.0 * velocities[1:] - 6.0 * slope) / step
    knots = np.empty((2 * len(starts), 3 * positions.shape[1]))
    knots[0::2] = np.hstack([positions[:-1], velocities[:-1], starts])
    knots[1::2] = np.hstack([positions[1:], velocities[1:], ends])
    return np.repeat(times, 2)[1:-1], knots


_STEP = 4e-3
"""Distance in s of two points of the parabola: truncation and rounding are both about 1e-10."""

_PLACES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0


class JointTask:
    """Reference in task coordinates of a path of joints; a `sample` as of every `Reference`."""

    def __init__(self, path: JointPath, robot: Robot, start: Array) -> None:
        """
        Initialise the reference.

        Parameters
        ----------
        path
            Path of all joints.
        robot
            Robot with the kinematics.
        start
            Task coordinates (axes) at its start. Rotations continue these: of the vectors of one
            rotation each sample has the one next to that before.

        """
        self.path = path
        self.end = path.end
        self._robot, self._axes = robot, len(robot.mechanism.axes)
        names = [coordinate.name for coordinate in robot.mechanism.positions]
        self._direct = [
            (axis, names.index(quantity.name))
            for axis, quantity in enumerate(robot.mechanism.axes)
            if quantity.name in names
        ]
        self._rotations = [p.axes for p in robot.mechanism.points if p.is_rotation]
        if self._rotations:
            self._times = path.grid()
            self._known = self._continued(start)

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s from the start of the path."""
        joints = self.path.sample(times)
        count, axes = joints.shape[1] // 3, self._axes
        out = np.empty((len(times), 3 * axes))
        if len(self._direct) < axes:
            position, velocity, acceleration = np.split(joints, 3, axis=1)
            s = _STEP * _PLACES[:, None, None]
            moved = position + s * (velocity + 0.5 * s * acceleration)
            x = self._robot.task_positions(np.ascontiguousarray(moved.reshape(-1, count)))
            x = x.reshape(len(_PLACES), len(times), axes)
            for rotation in self._rotations:
                near = self._known[self._nearest(times), rotation]
                x[:, :, rotation] = continued_near(x[:, :, rotation], near)
            out[:, :axes] = x[2]
            # The differences from the middle lose fewer digits.
            x = x - x[2]
            out[:, axes:2 * axes] = np.tensordot(_FIRST, x, 1) / _STEP
            out[:, 2 * axes:] = np.tensordot(_SECOND, x, 1) / _STEP**2
        for axis, joint in self._direct:
            out[:, axis::axes] = joints[:, joint::count]
        return out

    def _nearest(self, times: Array) -> Array:
        """Return the indices (n) of the known times next to times (n)."""
        after = np.clip(np.searchsorted(self._times, times), 1, max(1, len(self._times) - 1))
        after = np.minimum(after, len(self._times) - 1)
        before = np.maximum(after - 1, 0)
        is_before = times - self._times[before] < self._times[after] - times
        return np.where(is_before, before, after)

    def _continued(self, start: Array) -> Array:
        """Return the task coordinates (m, axes) at the known times, rotations without a jump."""
        count = len(self.path.state(0.0).position)
        known = np.vstack([
            self._robot.task_positions(np.ascontiguousarray(self.path.sample(part)[:, :count]))
            for part in np.array_split(self._times, 1 + len(self._times) // 20_000)
        ])
        for rotation in self._rotations:
            known[:, rotation] = all_continued(known[:, rotation].copy(), start[rotation])
        return known
