# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Task coordinates of a path of joints: forward kinematics and its two derivatives.

At each time the joints move on the parabola q + s q' + s^2 q'' / 2. The task coordinates of five
of its points give the first and second derivative by s at s = 0, with an error of the fourth
order: about 1e-10. This serves every mechanism, also those of other packages, whose formulas have
no second derivative of the coordinates.
"""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.reference.joint_path import JointPath
from masmc_ros.reference.rotations import all_continued, continued_near
from masmc_ros.robot.robot import Robot
import numpy as np

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
