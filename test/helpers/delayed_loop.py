# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Closed loop on a busy machine: the controller and the plant, each delayed at random.

It reproduces the nodes' real-time mode without the nodes. The plant wakes up late and computes
the ticks that are due with the current torque. The controller processes the latest state when
it is free, and its answer arrives late.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.drive import Drive
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.timing import LATE_TICKS
from masmc_ros.params.declaration import Values
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Delay = Callable[[], float]
"""Returns the delay of an event in s."""

_COMPUTING = 0.0003
"""Time in s from a state to its answer on a machine without other work."""


@dataclass
class DelayedRun:
    """
    Results of a run.

    Attributes
    ----------
    error
        x - x_d (n, 4) of the true state in m, by tick.
    largest_torque
        largest applied torques (4) in N·m.
    late
        number of ticks of the plant under a torque that answers an earlier state.
    overdue
        number of ticks that the plant computed one period or more after they were due.
    behind
        time in s by which the robot's time fell behind the real time.

    """

    error: Array
    largest_torque: Array
    late: int
    overdue: int
    behind: float

    def most(self, axes: list[int], start: int) -> float:
        """Return the largest distance in mm on two axes after a tick."""
        return float(1e3 * np.hypot(*self.error[start:, axes].T).max())


class _Answering:
    """Controller that answers the latest state when it is free."""

    def __init__(self, values: Values, reference: Array, delay: Delay) -> None:
        control = values['controller']
        period = control['control_period']
        self.controller = Controller(robot_of(control), period, control)
        approach = Approach(self.controller.robot, control['approach_speed'])
        self._drive = Drive(self.controller, approach, is_active=True, is_timed=True)
        self._reference, self._delay, self._period = reference, delay, period
        self._free = 0.0
        self._sent: list[tuple[float, int, Array]] = []

    def answer(self, sent: float, tick: int, position: Array, velocity: Array) -> None:
        """Answer the state of a tick that was sent at a time in s."""
        stamp = round(1e9 * tick * self._period)
        self._drive.skip_to(stamp)
        self._drive.compute(stamp, position, velocity, self._reference[tick].copy())
        self._free = max(self._free, sent) + _COMPUTING + self._delay()
        self._sent.append((self._free, tick, self.controller.torque.copy()))

    def is_free(self, now: float) -> bool:
        """Return True if the controller is free at a time in s."""
        return self._free <= now

    def latest(self, now: float) -> tuple[int, Array] | None:
        """Return tick and torque (4) of the latest new answer at a time in s, or None."""
        arrived = [(tick, torque) for time, tick, torque in self._sent if time <= now]
        self._sent = [answer for answer in self._sent if answer[0] > now]
        return arrived[-1] if arrived else None


def delayed_run(values: Values, seconds: float, plant_delay: Delay, delay: Delay) -> DelayedRun:
    """
    Run for a duration of the robot's time; both delays are drawn once per tick.

    Raises InputError if the robot's state is no longer finite.
    """
    period = values['plant']['control_period']
    plant = SimulatedRobot(robot_of(values['plant']), period, values['plant'])
    ticks = round(seconds / period)
    trajectory = Trajectory(values['trajectory'], period, robot_of(values['trajectory']))
    reference = trajectory.sample(0, ticks + 1)
    answering = _Answering(values, reference, delay)
    error, largest, held = np.empty((ticks, 4)), np.zeros(4), np.zeros(4)
    now = lost = 0.0
    wake = late = overdue = 0
    answered = -1
    state = (0.0, 0, plant.position.copy(), plant.velocity.copy())
    is_waiting = True
    while plant.tick < ticks:
        wake = max(wake, int(now / period)) + 1
        now = max(now, wake * period + plant_delay())
        if is_waiting and answering.is_free(now):
            answering.answer(*state)
            is_waiting = False
        newest = answering.latest(now)
        if newest is not None:
            answered, held = newest
        due = int((now - lost) / period + 1e-9)
        overdue += max(0, due - plant.tick - 1)
        if due - plant.tick > LATE_TICKS:
            lost += (due - plant.tick - 1) * period
            due = plant.tick + 1
        for _ in range(plant.tick, min(due, ticks)):
            late += answered < plant.tick
            plant.advance(held)
            place = plant.robot.task_positions(plant.true_position[None])[0]
            error[plant.tick - 1] = place - reference[plant.tick, :4]
            largest = np.maximum(largest, np.abs(plant.applied))
            state = (now, plant.tick, plant.position.copy(), plant.velocity.copy())
            is_waiting = True
    return DelayedRun(error, largest, late, overdue, lost)
