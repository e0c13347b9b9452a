# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Motion to a set-point within limits of velocity, acceleration and jerk, from any state.

ruckig computes it (Berscheid and Kroeger 2021, "Jerk-limited Real-time Trajectory Generation with
Arbitrary Target States"). The motion of each coordinate consists of polynomials of degree three.
Between the times at which one of them starts, all are reproduced by polynomials of degree five, so
this package samples them without ruckig.
"""

from __future__ import annotations

from itertools import accumulate
from types import ModuleType
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, remedy
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.reference.minimum_jerk import sample_knots
from masmc_ros.reference.reference import Declared
from masmc_ros.reference.rotations import all_continued, orientation_of
from masmc_ros.robot.approach_blend import SHORTEST
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_SMALLEST_SHARE = 0.2
"""Smallest share of a limit that a coordinate gets which moves less than the others."""

_AT_GOAL = 1e-3
"""Duration in s below which a motion is at its goal, apart from rounding."""


def load_ruckig() -> ModuleType:
    """Return the module; raise UserError with the remedy if it is not installed."""
    try:
        import ruckig
    except ModuleNotFoundError as error:
        raise remedy(error) from None
    return ruckig


def shared_limits(way: Array, limit: float) -> Array:
    """
    Return limits (n) of coordinates, whose norm is a limit of all.

    Parameters
    ----------
    way
        Displacement (n) to the goal. Coordinates that move further get a larger share.
    limit
        Limit of the norm, of any quantity.

    """
    distance = float(np.linalg.norm(way))
    shares = np.full(len(way), 1.0)
    if distance > 0.0:
        shares = np.maximum(np.abs(way) / distance, _SMALLEST_SHARE)
    result: Array = limit * shares / np.linalg.norm(shares)
    return result


def jerk_limited_knots(start: Array, goal: Array, limits: Array) -> tuple[Array, Array]:
    """
    Return times (m) and knots (m, 3 n) of the fastest motion to a goal at rest.

    All coordinates arrive at the same time, on a straight line if the start permits it. A start
    beyond the limits returns into them first.

    Parameters
    ----------
    start
        Position, velocity and acceleration (3 n) of n coordinates.
    goal
        Position (n) of the goal.
    limits
        Largest velocity, acceleration and jerk of each coordinate, (3, n), all > 0.

    Raises
    ------
    InputError
        If there is no such motion.
    UserError
        If ruckig is not installed.

    """
    ruckig, count = load_ruckig(), len(goal)
    state = ruckig.InputParameter(count)
    position, velocity, acceleration = np.split(start, 3)
    state.current_position = position.tolist()
    state.current_velocity = velocity.tolist()
    state.current_acceleration = acceleration.tolist()
    state.target_position = goal.tolist()
    state.max_velocity, state.max_acceleration, state.max_jerk = limits.tolist()
    state.synchronization = ruckig.Synchronization.Phase
    trajectory = ruckig.Trajectory(count)
    result = ruckig.Ruckig(count).calculate(state, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise InputError(
            f'no motion from {position.tolist()} to {goal.tolist()} within the limits of '
            f'velocity, acceleration and jerk (ruckig: {result.name})'
        )
    rest = np.concatenate([goal, np.zeros(2 * count)])
    if trajectory.duration < _AT_GOAL:
        return np.array([0.0, SHORTEST]), np.vstack([start, rest])
    starts = {0.0, trajectory.duration}
    for profile in trajectory.profiles[0]:
        starts.update(accumulate([profile.brake.duration, *profile.t]))
        starts.update(accumulate(profile.brake.t))
    times = np.array(sorted(time for time in starts if time <= trajectory.duration))
    # Two starts that differ by rounding only would give a polynomial of no length.
    times = times[np.append(np.diff(times) > 1e-9, True)]
    times[0] = 0.0
    knots = np.array([np.concatenate(trajectory.at_time(time)) for time in times.tolist()])
    # ruckig misses the goal by up to 1e-8. The polynomial of degree five that leads from zero to
    # this error is removed; a last knot at the goal alone would step in the jerk.
    missed = np.vstack([np.zeros(3 * count), knots[-1]])
    missed[1, :count] -= goal
    knots -= sample_knots(times[[0, -1]], missed, times)
    knots[0], knots[-1] = start, rest
    return times, knots


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    start = mechanism.default('line_sine.offset', 'axes')
    axes = mechanism.axes
    units = [', '.join(dict.fromkeys(f'{axis.unit}{per}' for axis in axes))
             for per in ('', '/s', '/s²', '/s³')]  # fmt: skip

    def limit(name: str, default: float, description: str, unit: str) -> Parameter:
        return Parameter(
            f'set_point.{name}', default, description, unit=unit, length=len(axes),
            broadcast=True, minimum=0.0, exclusive_minimum=True,
        )  # fmt: skip

    return (
        Parameter(
            'set_point.start', start, 'Position before the motion', unit=units[0],
            length=len(axes),
        ),
        Parameter('set_point.goal', start, 'Set-point', unit=units[0], length=len(axes)),
        limit('speed', 0.25, 'Largest velocity of each axis', units[1]),
        limit('acceleration', 0.5, 'Largest acceleration of each axis', units[2]),
        limit('jerk', 2.0, 'Largest jerk of each axis', units[3]),
        Parameter(
            'set_point.delay', 0.0, 'Time at which the motion starts', unit='s', minimum=0.0
        ),
    )  # fmt: skip


class SetPoint:
    """Motion from rest to a set-point, the fastest one within limits of each axis."""

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values) -> None:
        """
        Initialise from checked values, with names without the prefix of the type.

        Raises UserError if ruckig is not installed.
        """
        start, goal = (np.array(values[name], dtype=np.float64) for name in ('start', 'goal'))
        limits = np.array([values[name] for name in ('speed', 'acceleration', 'jerk')])
        rest = np.zeros(len(start))
        times, self._knots = jerk_limited_knots(
            np.concatenate([start, rest, rest]), goal, limits
        )
        self._times = values['delay'] + times

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> SetPoint:
        """Return the motion; the rotation of the goal is the one next to that of the start."""
        rotation = orientation_of(mechanism)
        if rotation is None:
            return cls(values)
        goal = np.array(values['goal'])
        start = np.array(values['start'])[rotation.axes]
        goal[rotation.axes] = all_continued(goal[None, rotation.axes].copy(), start)[0]
        return cls({**values, 'goal': tuple(goal.tolist())})

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        samples: Array = sample_knots(self._times, self._knots, times)
        return samples
