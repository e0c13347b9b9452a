# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Base of a tree that follows a path of its end effector.

The carrier is the point of the base that `reference/following_base.py` moves. The base turns so
the end effector stays in the direction that it has in `robot.posture`. The carrier of a base on
two wheels is the point of the axle straight behind the end effector. As it moves along the line to
the end effector only, such a base drives forwards or backwards, and never has to move sideways.

An omnidirectional base, whose carrier is its origin, can turn with the end effector instead if the
task has the orientation: then its wrist needs to turn little. Its place for the posture moves with
the end effector, and the base follows this place on a short rope.

The comfortable reach is the range of distances around that of the posture in which the arm alone
can hold the end effector, far from singularities and from the ends of its joints. It is determined
at the height and orientation of the posture.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.robot.declaration import Point
from masmc_ros.robot.tree.assembly import BASES, Frame, TreeRobot
from masmc_ros.robot.tree.postures import frame_of, least_pivot, placed, task_jacobian
from masmc_ros.robot.tree.task.outputs import Task
from masmc_ros.robot.tree.task.task import POSE
import numpy as np

_HEADING = 5
"""Index of the rotation about the vertical among them."""

_NEAREST = 0.1
"""Smallest distance in m of the end effector from the carrier that determines a heading."""

_STEP = 0.01
"""Step in m of the search for the comfortable reach."""

_FARTHEST = 1.0
"""Longest search in m."""

_SHARE = 0.3
"""Share of the posture's measure of singularity from which on a distance is comfortable."""

_SWEEPS = 4
"""Corrections of the arm in each step."""

_CLOSE = 1e-3
"""Largest distance in m, and angle in rad, of the end effector from its aim in a step."""

_PLACING = 50
"""Corrections of the heading for a given point of the base."""


Trail = Callable[[Array, Array | None, float, float], Array]


class Followed(NamedTuple):
    """Base axes of a task, and the posture in which the end effector is comfortable."""

    carrier: Point
    """Axes of the base in the task."""
    entries: tuple[int, ...]
    """Entries of these axes among the coordinates of their frame."""
    offset: Array
    """Origin (2) of this frame in that of the base, m."""
    turn: float
    """Heading of this frame in that of the base, rad."""
    centre: Array
    """Carrier (2) in the frame of the base, m."""
    distance: float
    """Distance in m of the end effector from the carrier in the posture."""
    bearing: float
    """Direction of the end effector from the carrier in the posture, rad, in the base."""
    rotation: Array | None
    """Rotation (3, 3) of the end effector in the posture if the task has it."""
    is_differential: bool

    def place(self, before: Array, tip: Array) -> Array:
        """
        Return the carrier (2) of a sample of the reference.

        Parameters
        ----------
        before
            Task coordinates (axes).
        tip
            Position (2) of the end effector in m.

        """
        own = before[self.carrier.axes]
        if self.entries == (_HEADING,):
            place: Array = tip - self._ahead(own - self.turn)[0]
            return place
        point = own[:2]
        if len(self.entries) > 2:
            return self._carrier(point, own[2] - self.turn)
        # A point of the base without its heading: the end effector has its usual direction.
        place = point
        for _ in range(_PLACING):
            way = tip - place
            place = self._carrier(point, math.atan2(way[1], way[0]) - self.bearing)
        return place

    def axes(
        self, path: Array, before: Array | None, trail: Trail, reach: tuple[float, float]
    ) -> Array:
        """
        Return the axes (n, size) of the base.

        Parameters
        ----------
        path
            Task coordinates (n, axes); those of the base are ignored.
        before
            Task coordinates (axes) at the start, whose heading turns into the planned one along
            the path; None for no start.
        trail
            Function that returns the places (n, 2) of a point that follows a path.
        reach
            Least and largest comfortable distance in m.

        """
        tips = path[:, :2]
        start = None if before is None else self.place(before, before[:2])
        if self.rotation is not None and not self.is_differential:
            yaw = np.unwrap(self._turned(path))
            behind = tips - self._ahead(yaw)
            start = behind[0] if start is None else start
            places = trail(behind, start, 0.0, reach[1] - self.distance)
        else:
            if self.rotation is not None and start is None:
                start = tips[0] - self._ahead(self._turned(path[:1]))[0]
            places = trail(tips, start, *reach)
            way = tips - places
            yaw = np.unwrap(np.arctan2(way[:, 1], way[:, 0])) - self.bearing
        if before is not None and _HEADING in self.entries:
            turned = before[self.carrier.first + len(self.entries) - 1] - self.turn
            # Whole turns are kept.
            yaw += 2.0 * math.pi * np.round((turned - yaw[0]) / (2.0 * math.pi))
            yaw += (turned - yaw[0]) * np.linspace(1.0, 0.0, len(yaw))
        s, c = np.sin(yaw), np.cos(yaw)
        x, y = self.offset - self.centre
        columns = {
            0: places[:, 0] + c * x - s * y,
            1: places[:, 1] + s * x + c * y,
            _HEADING: yaw + self.turn,
        }
        return np.column_stack([columns[entry] for entry in self.entries])

    def _turned(self, path: Array) -> Array:
        """Return the headings (n) at which the end effector has its orientation of the posture."""
        assert self.rotation is not None
        turned = _rotations(path[:, 3:POSE]) @ self.rotation.T
        angles: Array = np.arctan2(
            turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1]
        )
        return angles

    def _ahead(self, yaw: Array) -> Array:
        """Return the ways (n, 2) from the carrier to the end effector at headings (n)."""
        angle = yaw + self.bearing
        return self.distance * np.column_stack([np.cos(angle), np.sin(angle)])

    def _carrier(self, point: Array, yaw: float) -> Array:
        """Return the carrier (2) of a point of the base."""
        x, y = self.offset - self.centre
        s, c = math.sin(yaw), math.cos(yaw)
        return point - np.array([c * x - s * y, s * x + c * y])


def followed_base(robot: TreeRobot, task: Task, posture: Array) -> Followed | None:
    """
    Return the base that can follow the end effector of a task, None if it cannot.

    Parameters
    ----------
    robot
        Robot.
    task
        Task that starts with the position of the end effector. Its other axes contain the heading
        of the base, its pose, or x and y of a point of it.
    posture
        Posture (n) of the joints.

    """
    if robot.tree.base == BASES['fixed'] or not task.points or not task.points[0].is_place:
        return None
    frames = [robot.frames[link] for link in task.frames]
    own = [
        axis for axis, place in enumerate(task.places)
        if place < POSE * len(frames) and frames[place // POSE].body == 0
    ]
    entries = tuple(task.places[axis] % POSE for axis in own)
    if entries not in {(0, 1), (0, 1, _HEADING), (_HEADING,)} or 0 in own:
        return None
    frame = frames[task.places[own[0]] // POSE]
    is_one = len({task.places[axis] // POSE for axis in own}) == 1
    if not is_one or own != list(range(own[0], own[0] + len(own))) or frame.rotation[8] < 1.0:
        return None
    rotations, origins = frame_of(placed(robot, posture[None]), frames[0])
    tip = origins[0, :2]
    is_differential = robot.tree.base == BASES['differential']
    centre = np.array([0.0, tip[1]]) if is_differential else np.zeros(2)
    way = tip - centre
    distance = float(np.hypot(*way))
    if distance < _NEAREST:
        return None
    has_rotation = task.places[3:POSE] == tuple(range(3, POSE))
    return Followed(
        Point('', '', 'base', 'the base', own[0], len(own)),
        entries,
        np.array(frame.offset[:2]),
        math.atan2(frame.rotation[3], frame.rotation[0]),
        centre,
        distance,
        math.atan2(way[1], way[0]),
        rotations[0] if has_rotation else None,
        is_differential,
    )


def comfortable_reach(
    robot: TreeRobot, followed: Followed, frame: Frame, rows: tuple[int, ...], posture: Array,
    mobility: Callable[[Array], Array],
) -> tuple[float, float]:
    """
    Return the least and largest comfortable distance in m from the carrier.

    Parameters
    ----------
    robot, followed, posture
        Robot, its base, and the posture (n).
    frame, rows
        Frame of the end effector, and its coordinates in the task.
    mobility
        Function that returns the mobilities (1, n) of joints at positions (1, n).

    Raises
    ------
    InputError
        If the arm alone cannot move the end effector in the plane.

    """
    angle = followed.bearing
    direction = np.array([math.cos(angle), math.sin(angle), 0.0])
    arm = _Arm(robot, frame, rows, mobility)
    if not arm.pivot(posture) > 0.0:
        arm = _Arm(robot, frame, tuple(row for row in rows if row < 3), mobility)
    least = _SHARE * arm.pivot(posture)
    if not least > 0.0:
        raise InputError(
            'the arm alone cannot move its end effector at robot.posture, so the base cannot '
            'follow it; expected a path of all axes, or another robot.posture'
        )
    ways = [arm.way(posture, sign * direction, least) for sign in (-1.0, 1.0)]
    # In the middle between the posture and the last comfortable distance.
    span = 0.5 * min(*ways, followed.distance - 0.5 * _NEAREST)
    return followed.distance - span, followed.distance + span


class _Arm:
    """Arm without its base."""

    def __init__(
        self, robot: TreeRobot, frame: Frame, rows: tuple[int, ...],
        mobility: Callable[[Array], Array],
    ) -> None:
        self._robot, self._frame, self._rows, self._mobility = robot, frame, rows, mobility

    def pivot(self, posture: Array) -> float:
        """Return the measure of singularity; at most 0 if it is smaller than its rounding."""
        columns, shares = self._columns(posture)
        pivot = float(least_pivot(columns, shares)[0])
        return pivot if pivot > 1e-9 else 0.0

    def way(self, posture: Array, direction: Array, least: float) -> float:
        """Return the way in m that the end effector can be moved from a posture."""
        rotation, origin = self._pose(posture)
        length, arm = 0.0, posture.copy()
        while length < _FARTHEST:
            aim = origin + (length + _STEP) * direction
            for _ in range(_SWEEPS):
                off = self._error(arm, rotation, aim)
                columns, shares = self._columns(arm)
                pulled = shares[0][:, None] * columns[0].T
                arm = arm - pulled @ np.linalg.lstsq(columns[0] @ pulled, off, rcond=1e-9)[0]
            is_there = np.abs(self._error(arm, rotation, aim)).max() < _CLOSE
            if not is_there or self.pivot(arm) < least:
                break
            length += _STEP
        return length

    def _pose(self, posture: Array) -> tuple[Array, Array]:
        rotations, origins = frame_of(placed(self._robot, posture[None]), self._frame)
        return rotations[0], origins[0]

    def _error(self, posture: Array, rotation: Array, aim: Array) -> Array:
        own, origin = self._pose(posture)
        turned = 0.5 * np.cross(rotation, own, axis=0).sum(axis=1)
        return np.concatenate([origin - aim, turned])[list(self._rows)]

    def _columns(self, posture: Array) -> tuple[Array, Array]:
        """Return the Jacobian (1, rows, n) and the mobilities (1, n)."""
        base = self._robot.tree.base
        bodies = placed(self._robot, posture[None])
        columns = task_jacobian(self._robot, bodies, [self._frame], self._rows)[:, :, base:]
        return columns, self._mobility(posture[None])[:, base:]


def _rotations(vectors: Array) -> Array:
    """Return the matrices (n, 3, 3) of rotation vectors (n, 3)."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.where(angle > 0.0, angle, 1.0)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = axis
    cross[:, [1, 2, 0], [2, 0, 1]] = -axis
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    rotations: Array = np.eye(3) + s * cross + (1.0 - c) * (cross @ cross)
    return rotations
