# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Motion from the current position of the robot to the reference, without a jump.

A controller that starts far from its reference would respond to the distance at once, with all
its gains. It follows a sample instead that starts at the robot and joins the reference smoothly:
the distance between the two is a polynomial of degree five in time that ends at zero with its
first and second derivatives. A moving robot is braked within half a second.

A mechanism whose reach a straight line could leave has separate kernels, `approach_start` and
`approach_sample`, with the arguments of those below.
"""

from __future__ import annotations

from collections.abc import Callable

from masmc_ros.aliases import Array, Records
from masmc_ros.jit.compiled import bound, formula, kernel
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.numerics.scalars import clipped
from masmc_ros.robot.approach_blend import decayed, returned, SHORTEST, task_state
from masmc_ros.robot.declaration import formulas_of_tag
from masmc_ros.robot.robot import Robot
import numpy as np

PEAK = 15.0 / 8.0
"""Peak velocity of a quintic from rest to rest, in multiples of distance / time."""

CONTINUOUS = 0.05
"""Time in s; steps smaller than the approach speed times this value count as continuous."""

_of_record = interface(by_tag('mechanism', formulas_of_tag), kernel)


@_of_record
def approach_start(
    body: Records,
    position: Array,
    rates: Array,
    reference: Array,
    speed: float,
    distance: Array,
    motion: Array,
    start: Array,
) -> float:
    """
    Write the reference (3 axes) minus the robot at rest, and the robot's velocity (axes, m/s).

    `speed` limits the velocity on each axis. `start` (axes) is x. Returns the largest distance.
    """
    robot = lane_of(body[0], 0)
    x, x_dot = task_state(robot, position, rates)
    check_workspace(robot)
    for i in range(len(distance)):
        distance[i] = reference[i]
    way = 0.0
    for i in range(len(x)):
        distance[i] = reference[i] - x[i]
        motion[i] = clipped(x_dot[i], speed)
        start[i] = x[i]
        way = max(way, abs(distance[i]))
    return way


@_of_record
def approach_sample(
    body: Records,
    reference: Array,
    distance: Array,
    motion: Array,
    start: Array,
    duration: float,
    part: float,
    out: Array,
) -> None:
    """Write the reference minus the remaining distance, plus the remaining motion (3 axes)."""
    n = len(motion)
    for i in range(n):
        position, velocity, acceleration = decayed(
            distance[i], distance[n + i], distance[2 * n + i], duration, part
        )
        way, speed, change = returned(motion[i], duration, part)
        out[i] = reference[i] - (position - way)
        out[n + i] = reference[n + i] - (velocity - speed)
        out[2 * n + i] = reference[2 * n + i] - (acceleration - change)


@formula
def duration_of(way: float, speed: float) -> float:
    """Return the duration in s of an approach over a way in m at a speed in m/s."""
    return max(SHORTEST, PEAK * way / speed)


@kernel
def steps(before: Array, current: Array, time: float, limit: float, speed: float) -> bool:
    """Return True if a reference does not continue the one `time` s earlier."""
    is_step = False
    n = len(current) // 3
    for i in range(n):
        expected = before[i] + 0.5 * time * (before[n + i] + current[n + i])
        is_step |= not abs(current[i] - expected) <= limit
        is_step |= not abs(current[n + i] - before[n + i]) <= speed
    return is_step


class Approach:
    """
    Motion from the robot position to the reference, with bounded speed.

    A new approach starts on request and, if the reference is watched, when it
    steps: by more than 0.05 s of `speed` in position, or by more than `speed` in velocity.

    Attributes
    ----------
    is_on
        True until the followed samples have joined the reference.

    """

    def __init__(self, robot: Robot, speed: float) -> None:
        """Initialise the approach; `speed` is the maximum per task axis in m/s, 0 jumps."""
        self._body = robot.body
        axes = len(robot.mechanism.axes)
        self._speed = speed
        self._distance = np.zeros(3 * axes)
        self._motion, self._start = np.zeros((2, axes))
        self._out = np.zeros(3 * axes)
        self._before: Array | None = None
        self._steps: Callable[..., bool] | None = None
        self._stamp = 0
        self._start_stamp = 0
        self._duration = SHORTEST
        self._is_due = False
        self.is_on = False

    def start(self) -> None:
        """Start from the robot position at the next tick."""
        self._is_due = self.is_on = self._speed > 0.0

    def watch(self, stamp: int, reference: Array) -> None:
        """Start an approach if the reference steps; call with every sample and its stamp in ns."""
        before, elapsed = self._before, (stamp - self._stamp) * 1e-9
        self._before, self._stamp = reference, stamp
        if before is not None and before is not reference:
            arguments = before, reference, elapsed, self._speed * CONTINUOUS, self._speed
            # Without a check of types at each tick.
            self._steps = self._steps or bound(steps, *arguments)
            if self._steps(*arguments):
                self.start()

    def follow(self, stamp: int, position: Array, rates: Array, reference: Array) -> Array:
        """
        Return the sample to follow at a stamp in ns, which is the reference after joining it.

        `position` is in the order of joint_states, `rates` are those of the driven joints in
        rad/s, and `reference` has 3 axes.
        """
        if self._is_due:
            self._is_due = False
            self._start_stamp = stamp
            way = approach_start(
                self._body,
                position,
                rates,
                reference,
                self._speed,
                self._distance,
                self._motion,
                self._start,
            )
            self._duration = duration_of(way, self._speed)
        if not self.is_on:
            return reference
        part = (stamp - self._start_stamp) * 1e-9 / self._duration
        if not 0.0 <= part < 1.0:
            self.is_on = False
            return reference
        approach_sample(
            self._body,
            reference,
            self._distance,
            self._motion,
            self._start,
            self._duration,
            part,
            self._out,
        )
        return self._out
