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
second: to go on with that for longer could lead beyond the arm's reach.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import kernel
from masmc_ros.numerics.limits import clipped
from masmc_ros.reference.hermite import quintic
from masmc_ros.robot.two_link.geometry import Geometry, posture, quasi_velocity
from masmc_ros.robot.two_link.kinematics import task_position, task_velocity
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
    geometry: Any, position: Any, rates: Any, reference: Any, speed: float, out: Any, motion: Any
) -> None:
    """
    Write the reference (12) minus the robot at rest, and how the robot moves (4, m/s).

    On no axis is that more than `speed`.
    """
    lengths = Geometry(geometry[0], geometry[1], geometry[2], geometry[3], geometry[4])
    bend = posture(position[2], position[5], position[6])
    x = task_position(lengths, bend, position[0], position[1])
    out[0] = reference[0] - x[0]
    out[1] = reference[1] - x[1]
    out[2] = reference[2] - x[2]
    out[3] = reference[3] - x[3]
    for i in range(4, 12):
        out[i] = reference[i]
    v = quasi_velocity(lengths, rates[0], rates[1], rates[2], rates[3])
    x_dot = task_velocity(lengths, bend, v[0], v[1], v[2], v[3])
    motion[0] = clipped(x_dot[0], speed)
    motion[1] = clipped(x_dot[1], speed)
    motion[2] = clipped(x_dot[2], speed)
    motion[3] = clipped(x_dot[3], speed)


@kernel
def _less(
    reference: Any, distance: Any, motion: Any, duration: float, part: float, out: Any
) -> None:
    """Write the reference (12) less what of the distance is left, plus what of the motion is."""
    braked = min(part * duration / SHORTEST, 1.0)
    for i in range(4):
        position, velocity, acceleration = quintic(
            (distance[i], distance[4 + i], distance[8 + i]), (0.0, 0.0, 0.0), duration, part
        )
        way, speed, change = quintic(
            (0.0, motion[i], 0.0), (0.0, 0.0, 0.0), SHORTEST, braked
        )
        out[i] = reference[i] - (position - way)
        out[4 + i] = reference[4 + i] - (velocity - speed)
        out[8 + i] = reference[8 + i] - (acceleration - change)


@kernel
def _steps(before: Any, now: Any, time: float, limit: float, speed: float) -> bool:
    """Tell whether a reference (12) does not go on from where it was `time` s before."""
    steps = False
    for i in range(4):
        expected = before[i] + 0.5 * time * (before[4 + i] + now[4 + i])
        steps |= not abs(now[i] - expected) <= limit
        steps |= not abs(now[4 + i] - before[4 + i]) <= speed
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

    def __init__(self, geometry: Array, speed: float) -> None:
        """Take the robot's lengths (5) and the largest speed per task axis in m/s; 0 jumps."""
        self._geometry = geometry
        self._speed = speed
        self._distance, self._motion = np.zeros(12), np.zeros(4)
        self._out = np.zeros(12)
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
        """Begin where the reference (12) steps; to be called with every one, stamps in ns."""
        before, elapsed = self._before, (stamp - self._stamp) * 1e-9
        self._before, self._stamp = reference, stamp
        if before is not None and before is not reference:
            limit = self._speed * _CONTINUOUS
            if _steps(before, reference, elapsed, limit, self._speed):
                self.begin()

    def follow(self, stamp: int, position: Array, rates: Array, reference: Array) -> Array:
        """
        Return the 12 numbers to follow at a stamp in ns; the reference itself once joined.

        `position` (7) in the order of joint_states, `rates` (4) of the driven joints in rad/s,
        `reference` (12).
        """
        if self._is_due:
            self._is_due = False
            self._begun = stamp
            _distance(
                self._geometry,
                position,
                rates,
                reference,
                self._speed,
                self._distance,
                self._motion,
            )
            farthest = float(np.abs(self._distance[:4]).max())
            self._duration = max(SHORTEST, _PEAK * farthest / self._speed)
        if not self.is_on:
            return reference
        part = (stamp - self._begun) * 1e-9 / self._duration
        if not 0.0 <= part < 1.0:
            self.is_on = False
            return reference
        _less(reference, self._distance, self._motion, self._duration, part, self._out)
        return self._out
