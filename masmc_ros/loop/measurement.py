# SPDX-License-Identifier: Apache-2.0
"""How the plant's state is measured: encoders, odometry, noisy rates, delay.

The encoders quantise the four joint angles. The pose of the base is what a robot without
other sensors has: odometry from the quantised wheel angles, exact where they are. Rates carry
noise; those of the base are the wheels' through the kinematics, so that everything measured
agrees with itself. At last all is delayed by whole ticks.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula
from masmc_ros.loop.arrays import as_geometry
from masmc_ros.portable_math import sin_cos
from masmc_ros.portable_random import gaussian
from masmc_ros.robot import AXES
from masmc_ros.robot.geometry import quasi_velocity

# Adding and subtracting 1.5 * 2**52 rounds a double below 2**51 to the nearest integer.
_ROUND = 6755399441055744.0
_LARGEST_COUNT = 2251799813685248.0

_BASE = 3
"""Entries of positions and velocities that are the base's."""


@formula
def quantised(angle: float, resolution: float) -> float:
    """Return the multiple of the resolution nearest to an angle, both in rad; 0 is exact."""
    count = angle / resolution
    rounded = ((count + _ROUND) - _ROUND) * resolution
    return rounded if resolution > 0.0 and abs(count) < _LARGEST_COUNT else angle


@formula
def begin_odometry(plant: Any, memory: Any) -> None:
    """Let odometry start at the true pose."""
    for i in range(_BASE):
        memory['odometry'][i] = memory['position'][i]
    for i in range(2):
        memory['wheels'][i] = quantised(memory['position'][_BASE + i], plant['resolution'][i])


@formula
def count_wheels(plant: Any, memory: Any) -> None:
    """Move odometry on by what the wheels' encoders have counted since the last tick.

    Exact for the mean of the headings at both ends, which is that of an arc to second order.
    """
    resolution, wheels, pose = plant['resolution'], memory['wheels'], memory['odometry']
    right = quantised(memory['position'][_BASE], resolution[0])
    left = quantised(memory['position'][_BASE + 1], resolution[1])
    along, turn, _, _ = quasi_velocity(
        as_geometry(plant['geometry']), right - wheels[0], left - wheels[1], 0.0, 0.0
    )
    s, c = sin_cos(pose[2] + 0.5 * turn)
    pose[0] += along * c
    pose[1] += along * s
    pose[2] += turn
    wheels[0] = right
    wheels[1] = left


@formula
def measure(
    plant: Any, memory: Any, delayed: Any, tick: int, position: Any, velocity: Any
) -> None:
    """Write what is measured of the true state in `memory` (positions and velocities, 7).

    `delayed` (delay + 1, 14) holds the latest measurements, tick k in row k mod (delay + 1).
    """
    true_position, true_velocity = memory['position'], memory['velocity']
    counts = plant['resolution'][0] > 0.0 or plant['resolution'][1] > 0.0
    if tick == 0:
        begin_odometry(plant, memory)
    elif counts:
        count_wheels(plant, memory)
    rows = plant['delay'] + 1
    fresh = delayed[tick % rows]
    for i in range(_BASE):
        fresh[i] = memory['odometry'][i] if counts else true_position[i]
    for i in range(AXES):
        fresh[_BASE + i] = quantised(true_position[_BASE + i], plant['resolution'][i])
        rate = true_velocity[_BASE + i]
        if plant['noise'][i] > 0.0:
            rate += plant['noise'][i] * gaussian(plant['seed'], tick, i)
        fresh[7 + _BASE + i] = rate
    s, c = sin_cos(fresh[2])
    u, w, _, _ = quasi_velocity(as_geometry(plant['geometry']), fresh[10], fresh[11], 0.0, 0.0)
    fresh[7] = u * c
    fresh[8] = u * s
    fresh[9] = w
    # Until the first measurement has come through, it is what there is.
    seen = delayed[(tick - plant['delay']) % rows if tick > plant['delay'] else 0]
    for i in range(7):
        position[i] = seen[i]
        velocity[i] = seen[7 + i]
