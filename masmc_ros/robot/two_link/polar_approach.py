# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Approach of the planar robot to its reference, within the reach of its arm.

A straight line of both task points can lead out of the reach of the arm, if the reference moves
during the approach. Therefore the end effector is described by distance rho and direction psi
from the base F of the arm:

    x_E = x_F + rho (cos psi, sin psi),   |L_1 - L_2| <= rho <= L_1 + L_2.

rho is a convex combination of its value at the start and the value of the reference, so it stays
in reach. The differences of psi and x_F decay as those of other robots do.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array, Joints, Records
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.numerics.hermite import quintic
from masmc_ros.numerics.portable_math import angle_of, sin_cos
from masmc_ros.numerics.scalars import clipped, nearest
from masmc_ros.robot.approach_blend import decayed, returned, task_state
from masmc_ros.robot.formula_types import RobotLane
from masmc_ros.robot.two_link.geometry import model_of

_STRETCHED, _BENT = 0.4, 0.8
"""Angles in rad from a stretched or folded elbow: too close to it, and regular."""

_AHEAD = 0.25
"""Time in s for which a moving elbow has to stay away from it."""

_SMALLEST = 1e-9
"""Distance in m below which a direction is undefined."""

_PEAK = 0.1
"""Time in s by which a braked velocity displaces the reference at most."""


@formula
def _polar(
    x: float, y: float, vx: float, vy: float, ax: float, ay: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return rho, rho', rho'', cos psi, sin psi, psi', psi'' of a vector from F to E."""
    rho = max(math.sqrt(x * x + y * y), _SMALLEST)
    c, s = x / rho, y / rho
    rate = c * vx + s * vy
    turn = (c * vy - s * vx) / rho
    change = c * ax + s * ay + rho * turn * turn
    turn_rate = (c * ay - s * ax - 2.0 * rate * turn) / rho
    return rho, rate, change, c, s, turn, turn_rate


@formula
def _arm_of(row: Array) -> tuple[float, float, float, float, float, float, float]:
    """Return `_polar` of a sample (12): position, velocity and acceleration of E and F."""
    return _polar(
        row[0] - row[2],
        row[1] - row[3],
        row[4] - row[6],
        row[5] - row[7],
        row[8] - row[10],
        row[9] - row[11],
    )


@kernel
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
    Write the distance to the reference, the motion of the robot, and its start.

    `distance` (12) and `motion` (4) are those of rho, psi, x_F and y_F; `start` (4) is x. Returns
    the longest way of the end effector on an axis in m.
    """
    robot = lane_of(body[0], 0)
    model = model_of(robot)
    x, x_dot = task_state(robot, position, rates)
    rho, rate, _, c, s, turn, _ = _polar(
        x[0] - x[2], x[1] - x[3], x_dot[0] - x_dot[2], x_dot[1] - x_dot[3], 0.0, 0.0
    )
    goal, goal_rate, goal_change, goal_c, goal_s, goal_turn, goal_turn_rate = _arm_of(reference)
    sine = c * goal_s - s * goal_c
    angle = angle_of(abs(sine), c * goal_c + s * goal_s)
    distance[0], distance[4], distance[8] = goal - rho, goal_rate, goal_change
    distance[1] = angle if sine >= 0.0 else -angle
    distance[5], distance[9] = goal_turn, goal_turn_rate
    platform_way = 0.0
    for i in range(2, 4):
        distance[i] = reference[i] - x[i]
        distance[4 + i], distance[8 + i] = reference[4 + i], reference[8 + i]
        motion[i] = clipped(x_dot[i], speed)
        platform_way = max(platform_way, abs(distance[i]))
    shortest, longest = abs(model.link_1 - model.link_2), model.link_1 + model.link_2
    room = (longest - rho if rate > 0.0 else rho - shortest) / _PEAK
    motion[0] = clipped(clipped(rate, speed), max(room, _SMALLEST))
    motion[1] = clipped(turn, speed / rho)
    for i in range(4):
        start[i] = x[i]
    # The end effector moves with the platform and by the arm.
    return platform_way + abs(distance[0]) + max(rho, goal) * angle


@kernel
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
    """Write what is followed (12) at `part` (0 to 1) of an approach of so many s."""
    model = model_of(lane_of(body[0], 0))
    rho, rate, change, c, s, turn, turn_rate = _arm_of(reference)
    at_start = math.sqrt((start[0] - start[2]) ** 2 + (start[1] - start[3]) ** 2)
    # A blend without velocity and acceleration at both ends.
    w, w_rate, w_change = quintic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), duration, part)
    back, back_rate, back_change = returned(motion[0], duration, part)
    away = rho - at_start
    r = at_start + w * away + back
    r_rate = w * rate + w_rate * away + back_rate
    r_change = w * change + 2.0 * w_rate * rate + w_change * away + back_change
    shortest, longest = abs(model.link_1 - model.link_2), model.link_1 + model.link_2
    r = min(max(r, shortest), longest)
    left, left_rate, left_change = decayed(distance[1], distance[5], distance[9], duration, part)
    back, back_rate, back_change = returned(motion[1], duration, part)
    sine, cosine = sin_cos(back - left)
    c, s = c * cosine - s * sine, s * cosine + c * sine
    turn += back_rate - left_rate
    turn_rate += back_change - left_change
    along = r_change - r * turn * turn
    across = 2.0 * r_rate * turn + r * turn_rate
    for i in range(2, 4):
        left, left_rate, left_change = decayed(
            distance[i], distance[4 + i], distance[8 + i], duration, part
        )
        back, back_rate, back_change = returned(motion[i], duration, part)
        out[i] = reference[i] - (left - back)
        out[4 + i] = reference[4 + i] - (left_rate - back_rate)
        out[8 + i] = reference[8 + i] - (left_change - back_change)
    out[0], out[1] = out[2] + r * c, out[3] + r * s
    out[4] = out[6] + r_rate * c - r * turn * s
    out[5] = out[7] + r_rate * s + r * turn * c
    out[8] = out[10] + along * c - across * s
    out[9] = out[11] + along * s + across * c


@formula
def unfolded(body: RobotLane, angles: Joints, rates: Joints) -> tuple[bool, Joints]:
    """
    Return whether the arm is stretched or folded, and joint angles (4) with a bent elbow.

    A law in task space cannot start with a stretched or folded arm that moves. It cannot start
    either if the joint velocities (4) in rad/s stretch or fold the arm within a quarter of a
    second.
    """
    singular = nearest(angles[3] / math.pi) * math.pi
    angle = angles[3] - singular
    side = math.copysign(1.0, angle)
    soon = side * (angle + _AHEAD * rates[3])
    is_bent = side * angle >= _STRETCHED and _STRETCHED <= soon <= math.pi - _STRETCHED
    bent = singular + side * max(_BENT, side * angle)
    return not is_bent, (angles[0], angles[1], angles[2], bent)
