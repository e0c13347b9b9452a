# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of the approaches of all mechanisms: the start, and polynomials in time."""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.hermite import quintic, Sample
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import RobotLane

SHORTEST = 0.5
"""Shortest duration of an approach in s, and the time in which a moving robot is braked."""

_LEAD = 2.0
"""Longest time in s in which the velocity of the reference is reached."""


@formula
def task_state(robot: RobotLane, position: Array, rates: Array) -> tuple[Numbers, Numbers]:
    """Return x in m and xdot in m/s of a robot with these positions and joint velocities."""
    model = mechanism.model_of(robot)
    at = to_vector(position, robot.position)
    bend = mechanism.posture(model, at)
    v = mechanism.motion(model, to_vector(rates, robot.rates))
    return mechanism.task_position(model, bend, at), mechanism.task_velocity(model, bend, v)


@formula
def decayed(
    distance: float, rate: float, change: float, duration: float, part: float
) -> Sample:
    """
    Return the remaining distance and its derivatives at `part` (0 to 1) of `duration` s.

    The distance decays over the whole duration. The velocity and acceleration of the reference,
    from which a robot at rest differs, are reached within 2 s: over a longer time, a polynomial
    that starts with them leads far away.
    """
    lead = min(duration, _LEAD)
    led = min(part * duration / lead, 1.0)
    x, v, a = quintic((distance, 0.0, 0.0), (0.0, 0.0, 0.0), duration, part)
    dx, dv, da = quintic((0.0, rate, change), (0.0, 0.0, 0.0), lead, led)
    return x + dx, v + dv, a + da


@formula
def returned(speed: float, duration: float, part: float) -> Sample:
    """Return the displacement of a coordinate that brakes and returns, and its derivatives."""
    braked = min(part * duration / SHORTEST, 1.0)
    return quintic((0.0, speed, 0.0), (0.0, 0.0, 0.0), SHORTEST, braked)
