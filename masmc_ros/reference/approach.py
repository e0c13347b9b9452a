# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
How the robot gets from where it is to the reference without a jump.

A controller that starts far from its reference would answer the distance at once, with all
its gains. What it follows instead begins where the robot is and joins the reference
smoothly: the distance between the two is a polynomial of degree five in time that ends at zero
with its first and second derivatives. A robot that moves is braked from its velocity in half a
second: to go on with that for longer could lead beyond the robot's reach.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.arrays import taken
from masmc_ros.numerics.compiled import kernel
from masmc_ros.numerics.limits import clipped
from masmc_ros.numerics.record import get
from masmc_ros.reference.hermite import quintic
from masmc_ros.robot import mechanism
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

SHORTEST = 0.5
"""Least time in s that an approach takes, and in which a robot that moves is braked."""

_PEAK = 15.0 / 8.0
"""Peak velocity of a quintic from rest to rest, in multiples of distance / time."""

_CONTINUOUS = 0.05
"""Time in s: steps of the reference shorter than the approach's speed times this are none."""

Array = NDArray[np.float64]


@kernel
def _distance(
    body: Any, position: Any, rates: Any, reference: Any, speed: float, out: Any, motion: Any
) -> None:
    """
    Write the reference (3 axes) minus the robot at rest, and how the robot moves (axes, m/s).

    On no axis is that more than `speed`.
    """
    robot = body[0]
    model = mechanism.model_of(robot, 0)
    at = taken(position, get(robot, 'position', 0))
    bend = mechanism.posture(model, at)
    x = mechanism.task_position(model, bend, at)
    v = mechanism.motion(model, taken(rates, get(robot, 'rates', 0)))
    x_dot = mechanism.task_velocity(model, bend, v)
    for i in range(len(out)):
        out[i] = reference[i]
    for i in range(len(x)):
        out[i] = reference[i] - x[i]
        motion[i] = clipped(x_dot[i], speed)


@kernel
def _less(
    reference: Any, distance: Any, motion: Any, duration: float, part: float, out: Any
) -> None:
    """Write the reference less what of the distance is left, plus what of the motion is."""
    braked = min(part * duration / SHORTEST, 1.0)
    n = len(motion)
    for i in range(n):
        position, velocity, acceleration = quintic(
            (distance[i], distance[n + i], distance[2 * n + i]), (0.0, 0.0, 0.0), duration, part
        )
        way, speed, change = quintic(
            (0.0, motion[i], 0.0), (0.0, 0.0, 0.0), SHORTEST, braked
        )
        out[i] = reference[i] - (position - way)
        out[n + i] = reference[n + i] - (velocity - speed)
        out[2 * n + i] = reference[2 * n + i] - (acceleration - change)


@kernel
def _steps(before: Any, now: Any, time: float, limit: float, speed: float) -> bool:
    """Tell whether a reference does not go on from where it was `time` s before."""
    steps = False
    n = len(now) // 3
    for i in range(n):
        expected = before[i] + 0.5 * time * (before[n + i] + now[n + i])
        steps |= not abs(now[i] - expected) <= limit
        steps |= not abs(now[n + i] - before[n + i]) <= speed
    return steps


class Approach:
    """
    Joins the reference from wherever the robot is, at a bounded speed.

    A new approach begins when one is asked for, and, where the reference is watched, when it
    steps: by more than 0.05 s of `speed` in position, or by more than `speed` in velocity.

    Attributes
    ----------
    is_on
        whether what is followed is still on its way to the reference, or will be.

    """

    def __init__(self, robot: Robot, speed: float) -> None:
        """Take the robot and the largest speed per task axis in m/s; 0 jumps."""
        self._body = robot.body
        axes = len(robot.mechanism.axes)
        self._speed = speed
        self._distance, self._motion = np.zeros(3 * axes), np.zeros(axes)
        self._out = np.zeros(3 * axes)
        self._before: Array | None = None
        self._stamp = 0
        self._begun = 0
        self._duration = SHORTEST
        self._is_due = False
        self.is_on = False

    def begin(self) -> None:
        """Start from wherever the robot is at the next tick."""
        self._is_due = self.is_on = self._speed > 0.0

    def watch(self, stamp: int, reference: Array) -> None:
        """Begin where the reference steps; to be called with every one, stamps in ns."""
        before, elapsed = self._before, (stamp - self._stamp) * 1e-9
        self._before, self._stamp = reference, stamp
        if before is not None and before is not reference:
            limit = self._speed * _CONTINUOUS
            if _steps(before, reference, elapsed, limit, self._speed):
                self.begin()

    def follow(self, stamp: int, position: Array, rates: Array, reference: Array) -> Array:
        """
        Return the sample to follow at a stamp in ns; the reference itself once joined.

        `position` in the order of joint_states, `rates` of the driven joints in rad/s,
        `reference` (3 axes).
        """
        if self._is_due:
            self._is_due = False
            self._begun = stamp
            _distance(
                self._body,
                position,
                rates,
                reference,
                self._speed,
                self._distance,
                self._motion,
            )
            farthest = float(np.abs(self._distance[:len(self._motion)]).max())
            self._duration = max(SHORTEST, _PEAK * farthest / self._speed)
        if not self.is_on:
            return reference
        part = (stamp - self._begun) * 1e-9 / self._duration
        if not 0.0 <= part < 1.0:
            self.is_on = False
            return reference
        _less(reference, self._distance, self._motion, self._duration, part, self._out)
        return self._out
