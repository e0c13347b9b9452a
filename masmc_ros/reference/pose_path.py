# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Paths through poses of the base or of the end effector, at certain times or within speeds.

Both are paths of minimum jerk (`waypoints.py`). That of the base is a path of its three joints,
that of the end effector one of the task axes of its frame, while the other axes stay or, for a
robot with a carrier, the base follows (`following_base.py`).

The path of a base by a velocity command ends by itself.
The base changes smoothly from its velocity to that of the command, keeps it for a time, and stops.
The next command replaces the path before it ends, so a robot without commands stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.reference.following_base import follow_tip
from masmc_ros.reference.jerk_limited import jerk_limited_knots, shared_limits
from masmc_ros.reference.joint_path import JointPoints, JointState, places_between
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots, stopped
from masmc_ros.reference.rotations import check_unit, continued_vectors
from masmc_ros.robot.approach_blend import SHORTEST
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np

_PLANE = 3
"""Coordinates of a planar base: x, y and its heading."""

HEADING = 2
"""Index of the heading among the positions of a robot with a planar base."""

_SPACE = 3
"""Coordinates of a position, and of a rotation vector."""

_SAME = 1e-6
"""Time in s between two points at the largest speeds below which they are one."""


class Speeds(NamedTuple):
    """Limits of a path without times."""

    linear: float
    """Speed in m/s."""
    angular: float
    """Turn rate in rad/s."""
    acceleration: float = 0.0
    """Acceleration in m/s2 on the way to a goal."""
    jerk: float = 0.0
    """Jerk in m/s3 on the way to a goal; 0: minimum jerk, without limits of acceleration."""

    def limits(self, way: Array, rotations: Sequence[slice]) -> Array:
        """
        Return the limits (3, n) of velocity, acceleration and jerk of coordinates.

        Parameters
        ----------
        way
            Displacement (n) to the goal.
        rotations
            Coordinates that are angles. A radian may change as fast as `linear / angular` m.

        """
        limits = np.zeros((3, len(way)))
        is_angle = np.zeros(len(way), dtype=np.bool_)
        for rotation in rotations:
            is_angle[rotation] = True
        for columns, scale in ((~is_angle, 1.0), (is_angle, self.angular / self.linear)):
            if columns.any():
                for row, limit in enumerate((self.linear, self.acceleration, self.jerk)):
                    limits[row, columns] = shared_limits(way[columns], scale * limit)
        return limits


@dataclass(frozen=True)
class PosePoints:
    """
    Poses of a path.

    Attributes
    ----------
    of_base
        True for poses of the base, False for those of the end effector.
    positions
        Positions (n, 3) in m in the world frame.
    quaternions
        Orientations (n, 4) as x, y, z, w.
    times
        Times (n) in s from the start of the path, ascending, from 0 on; None for a path within
        speeds.

    """

    of_base: bool
    positions: Array
    quaternions: Array
    times: Array | None

    @property
    def _is_goal(self) -> bool:
        return self.times is None and len(self.positions) == 1

    def check(self, mechanism: Mechanism) -> None:
        """Raise InputError for wrong numbers, and for a robot without this frame."""
        if self.of_base and not mechanism.is_planar:
            raise InputError(
                'the robot has no base that moves in the plane; expected poses of the end effector'
            )
        if not (self.of_base or mechanism.places):
            axes = ', '.join(axis.name for axis in mechanism.axes)
            raise InputError(
                f'the task has no position of an end effector, its axes are {axes}; expected a '
                'message on trajectory/joint_trajectory'
            )
        wrong = ~np.isfinite(self.positions).all(axis=1)
        if wrong.any():
            raise InputError(
                f'pose {int(np.argmax(wrong)) + 1} has a number that is not finite; expected '
                'numbers everywhere'
            )
        check_unit(self.quaternions, 'pose')
        if self.times is not None:
            is_back = np.diff(self.times) <= 0.0
            if is_back.any():
                pose = int(np.argmax(is_back))
                raise InputError(
                    f'pose {pose + 2} is stamped {self.times[pose + 1]:.9g} s after the first '
                    f'one, pose {pose + 1} {self.times[pose]:.9g} s; expected stamps that ascend, '
                    'or equal ones for a path within path_speed and path_turn_rate'
                )

    def joint_points(self, start: JointState, speeds: Speeds) -> JointPoints:
        """
        Return a path of the base as one of its joints.

        Parameters
        ----------
        start
            State of the joints at the start.
        speeds
            Largest speeds of a path without times.

        """
        x, y, z, w = self.quaternions.T
        heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        poses = np.column_stack([self.positions[:, :HEADING], heading])
        position = start.position
        poses[:, HEADING] = np.unwrap(np.append(position[HEADING], heading))[1:]
        times = self.times
        if self._is_goal and speeds.jerk > 0.0:
            limits = speeds.limits(poses[0] - position[:_PLANE], [slice(HEADING, _PLANE)])
            before = np.concatenate([values[:_PLANE] for values in start])
            times, knots = jerk_limited_knots(before, poses[0], limits)
            return JointPoints(np.arange(_PLANE), times, *np.split(knots, 3, axis=1))
        if times is None:
            largest = [
                (slice(0, HEADING), speeds.linear),
                (slice(HEADING, _PLANE), speeds.angular),
            ]
            times, poses = _timed(np.vstack([position[:_PLANE], poses]), largest)
            times, poses = times[1:], poses[1:]
        return JointPoints(np.arange(_PLANE), times, poses)

    def task_path(
        self, robot: Robot, before: Array, speeds: Speeds, *, base_follows: bool = False
    ) -> TaskPath:
        """
        Return a path of the end effector in task coordinates.

        Parameters
        ----------
        robot
            Robot.
        before
            Sample (3 axes) of the reference at the start.
        speeds
            Largest speeds of a path without times.
        base_follows
            True to plan the path of the robot's carrier, if it has one; otherwise it stays.

        """
        path = self._tip_path(robot.mechanism, before, speeds)
        if not base_follows or robot.mechanism.carrier is None:
            return path
        return path.with_base(robot, before[:len(robot.mechanism.axes)])

    def _tip_path(self, mechanism: Mechanism, before: Array, speeds: Speeds) -> TaskPath:
        place = mechanism.places[0]
        start, velocity, acceleration = np.split(before, 3)
        knots = np.repeat(start[None], 1 + len(self.positions), axis=0)
        knots[1:, place.axes] = self.positions[:, :place.size]
        limits = [(place.axes, speeds.linear)]
        for point in mechanism.points:
            if point.is_rotation and point.first == place.first + place.size:
                limits.append((point.axes, speeds.angular))
                if point.size == _SPACE:
                    knots[1:, point.axes] = continued_vectors(
                        self.quaternions, knots[0, point.axes], 'pose'
                    )
        if self._is_goal and speeds.jerk > 0.0:
            goal = stopped(start, velocity, acceleration, SHORTEST)
            for columns, _ in limits:
                goal[columns] = knots[1, columns]
            rotations = [point.axes for point in mechanism.points if point.is_rotation]
            bounds = speeds.limits(goal - start, rotations)
            return TaskPath.through(*jerk_limited_knots(before, goal, bounds))
        if self.times is None:
            return TaskPath(*_timed(knots, limits))
        if self.times[0] > 0.0:
            return TaskPath(np.append(0.0, self.times), knots)
        return TaskPath(self.times, knots[1:])


class TaskPath:
    """
    Path through points in task coordinates, from rest to rest; a `sample` as every `Reference`.

    Attributes
    ----------
    end
        Time of the last point in s.

    """

    def __init__(self, times: Array, points: Array) -> None:
        """Initialise from times (n) in s and points (n, axes)."""
        self._times = np.ascontiguousarray(times, dtype=np.float64)
        self._knots = np.hstack([points, np.zeros((len(points), 2 * points.shape[1]))])
        smooth_knots(self._times, self._knots)
        self.end = float(times[-1])

    @classmethod
    def braking(cls, sample: Array, duration: float) -> TaskPath:
        """Return the motion that stops a sample (3 axes) of a reference in a duration in s."""
        position, velocity, acceleration = np.split(sample, 3)
        rest = stopped(position, velocity, acceleration, duration)
        end = np.concatenate([rest, np.zeros(len(velocity) + len(acceleration))])
        return cls.through(np.array([0.0, duration]), np.vstack([sample, end]))

    def with_base(self, robot: Robot, start: Array) -> TaskPath:
        """Return the path with that of the carrier from task coordinates (axes) on."""
        return self.through(*follow_tip(robot, self._times, self._knots, start))

    @classmethod
    def through(cls, times: Array, knots: Array) -> TaskPath:
        """Return the path through knots (n, 3 axes), with derivatives, at times (n) in s."""
        path = cls(times[:1], knots[:1, :knots.shape[1] // 3])
        path._times, path._knots, path.end = times, knots, float(times[-1])
        return path

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s from the start of the path."""
        samples: Array = sample_knots(self._times, self._knots, times)
        return samples


def _timed(points: Array, limits: Sequence[tuple[slice, float]]) -> tuple[Array, Array]:
    """
    Return times (m) and the points (m, k) of a path of minimum jerk within speeds.

    Parameters
    ----------
    points
        Points (n, k), first the start; those that repeat the one before are omitted.
    limits
        Columns of coordinates, and the largest norm of their velocities.

    """
    steps = np.max([
        np.linalg.norm(np.diff(points[:, columns], axis=0), axis=1) / limit
        for columns, limit in limits
    ], axis=0)  # fmt: skip
    is_new = steps > _SAME
    if not is_new.any():
        return np.array([0.0, SHORTEST]), points[[0, -1]]
    points = points[np.append(True, is_new)]
    times = np.append(0.0, np.cumsum(steps[is_new]))
    path = TaskPath(times, points)
    velocities = path.sample(places_between(times))[:, points.shape[1]:2 * points.shape[1]]
    peaks = [
        np.linalg.norm(velocities[:, columns], axis=1).max() / limit for columns, limit in limits
    ]
    return times * max(*peaks, SHORTEST / times[-1]), points


_CHANGE = 0.4
"""Time in s in which the velocity of a command is reached."""

_VALID = 0.6
"""Time in s after which the base brakes without another command."""

_BRAKING = 0.6
"""Time in s in which the base stops."""

_STEP = 0.02
"""Time in s between two points of the path."""

_FINE = 20
"""Steps of the integration in the time between two points."""

_SIDEWAYS = 1
"""Place of the sideways velocity in a twist."""


class TwistPoints(NamedTuple):
    """Command of a base: velocities forward and to the left in m/s, and yaw rate in rad/s."""

    forward: float
    left: float
    turn: float

    def check(self, mechanism: Mechanism) -> None:
        """Raise InputError for numbers that are not finite, and for a base without this motion."""
        if not mechanism.is_planar:
            raise InputError('the robot has no base that moves in the plane')
        if not np.isfinite(self).all():
            raise InputError('a number is not finite; expected numbers everywhere')
        if self.left and all(velocity.place != _SIDEWAYS for velocity in mechanism.twist):
            raise InputError(
                f'linear.y = {self.left:g}: the base cannot move sideways; expected 0'
            )

    def joint_points(self, start: JointState) -> JointPoints:
        """Return the path of the joints of the base from a state of all joints."""
        heading = start.position[HEADING]
        c, s = np.cos(heading), np.sin(heading)
        x_rate, y_rate, turn = start.velocity[:HEADING + 1]
        x_change, y_change, turn_change = start.acceleration[:HEADING + 1]
        forward, left = c * x_rate + s * y_rate, c * y_rate - s * x_rate
        before = np.array([forward, left, turn])
        change = np.array([
            c * x_change + s * y_change + turn * left,
            c * y_change - s * x_change - turn * forward,
            turn_change,
        ])
        count = round((_VALID + _BRAKING) / _STEP)
        fine: Array = np.arange(_FINE * count + 1, dtype=np.float64) * (_STEP / _FINE)
        twist, change = _twists(before, change, np.array(self), fine)
        poses = np.zeros((len(fine), HEADING + 1))
        poses[:, HEADING] = heading + _integrated(twist[:, HEADING])
        c, s = np.cos(poses[:, HEADING]), np.sin(poses[:, HEADING])
        forward, left, turn = twist.T
        x_rates, y_rates = c * forward - s * left, s * forward + c * left
        poses[:, 0] = start.position[0] + _integrated(x_rates)
        poses[:, 1] = start.position[1] + _integrated(y_rates)
        rates = np.column_stack([x_rates, y_rates, turn])
        changes = np.column_stack([
            c * change[:, 0] - s * change[:, 1] - turn * y_rates,
            s * change[:, 0] + c * change[:, 1] + turn * x_rates,
            change[:, 2],
        ])
        rows = slice(_FINE, None, _FINE)
        return JointPoints(
            np.arange(HEADING + 1), fine[rows], poses[rows], rates[rows], changes[rows]
        )


def _twists(
    before: Array, change: Array, command: Array, times: Array
) -> tuple[Array, Array]:
    """
    Return velocities (n, 3) of the base in its frame, and their derivatives.

    Parameters
    ----------
    before, change
        Velocity (3) and its derivative at time 0. Both are continued, so that repeated commands
        reach their velocity.
    command
        Velocity (3) of the command.
    times
        Times (n) in s.

    """
    p = np.clip(times / _CHANGE, 0.0, 1.0)[:, None]
    rise, rise_rate = _step(p)
    fall, fall_rate = _step(np.clip((times - _VALID) / _BRAKING, 0.0, 1.0)[:, None])
    lead, lead_rate = p * (1.0 - p) ** 2, (1.0 - p) * (1.0 - 3.0 * p)
    values = before + rise * (command - before) + _CHANGE * lead * change - fall * command
    rates = rise_rate / _CHANGE * (command - before) + lead_rate * change
    rates -= fall_rate / _BRAKING * command
    return values, rates


def _step(part: Array) -> tuple[Array, Array]:
    """Return a smooth step from 0 to 1 over `part` from 0 to 1, and its derivative."""
    return part * part * (3.0 - 2.0 * part), 6.0 * part * (1.0 - part)


def _integrated(rates: Array) -> Array:
    """Return the integral of rates (n) from the first on, by the trapezoidal rule."""
    steps = 0.5 * (_STEP / _FINE) * (rates[1:] + rates[:-1])
    total: Array = np.append(0.0, np.cumsum(steps))
    return total
