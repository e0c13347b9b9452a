# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path of a base by a velocity command, which ends by itself.

The base changes smoothly from its velocity to that of the command, keeps it for a time, and stops.
The next command replaces the path before it ends, so a robot without commands stops.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.reference.joint_path import JointPoints, JointState
from masmc_ros.reference.pose_path import HEADING
from masmc_ros.robot.declaration import Mechanism
import numpy as np

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
