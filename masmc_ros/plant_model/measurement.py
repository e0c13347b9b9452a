# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Measurement of the plant's state: encoders, odometry, noisy rates and delay.

The encoders quantise the joint angles. The measured base pose is odometry from the quantised
angles, and exact without quantisation. Rates have noise; those of the base are computed from the
joint rates, so all measurements are consistent. Finally all values are delayed by whole ticks.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.arrays import read_row, write_row
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.portable_random import gaussian
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import elementwise, from_index, head, joined, tail
from masmc_ros.robot import mechanism

# Adding and subtracting 1.5 * 2**52 rounds a double below 2**51 to the nearest integer.
_ROUND = 6755399441055744.0
_LARGEST_COUNT = 2251799813685248.0


@formula
def quantised(angle: float, resolution: float) -> float:
    """Return the multiple of the resolution nearest to an angle, both in rad; 0 is exact."""
    count = angle / resolution
    rounded = ((count + _ROUND) - _ROUND) * resolution
    return rounded if resolution > 0.0 and abs(count) < _LARGEST_COUNT else angle


@formula
def _noise(seed_and_tick: tuple[Any, Any], joint: int) -> float:
    """Return a standard normal number of a seed, a tick and a joint."""
    return gaussian(seed_and_tick[0], seed_and_tick[1], joint)


@formula
def _noisy(rate: float, deviation: float, noise: float) -> float:
    """Return a rate as it is measured, rad/s."""
    return rate + deviation * noise if deviation > 0.0 else rate


@formula
def measured(plant: Any, memory: Any, tick: int, lane: int) -> tuple[Numbers, Numbers]:
    """Return measured positions and velocities, before the delay."""
    model = mechanism.model_of(plant, lane)
    position, rates = get(memory, 'position', lane), get(memory, 'rates', lane)
    resolution, pose = get(plant, 'resolution', lane), get(memory, 'odometry', lane)
    angles = elementwise(quantised, tail(position, rates), resolution)
    counts = mechanism.counts_turns(model, resolution)
    if (tick == 0) | (not counts):
        pose = head(position, pose)
    else:
        turned = elementwise(minus, angles, get(memory, 'counted', lane))
        pose = mechanism.dead_reckoned(model, pose, turned)
    put(memory, 'odometry', lane, pose)
    put(memory, 'counted', lane, angles)
    noise = from_index(_noise, rates, (get(plant, 'seed', lane), tick))
    rates = elementwise(_noisy, rates, get(plant, 'noise', lane), noise)
    seen = joined(pose, angles)
    posture = mechanism.posture(model, seen)
    return seen, mechanism.position_rates(model, posture, rates)


@formula
def measure(plant: Any, memory: Any, delayed: Any, tick: int, signals: Any, lane: int) -> None:
    """
    Write the measurement of the true state in `memory` at a tick into `signals`.

    `delayed` (maximum delay + 1, positions and velocities, lanes) contains the latest
    measurements, that of tick k in row k mod (delay + 1).
    """
    position, velocity = measured(plant, memory, tick, lane)
    delay = get(plant, 'delay', lane)
    rows = delay + 1
    n = len(position)
    write_row(delayed, tick % rows, 0, lane, position)
    write_row(delayed, tick % rows, n, lane, velocity)
    # The first measurement is used until the delay has passed.
    row = (tick - delay) % rows if tick > delay else 0
    put(signals, 'position', lane, read_row(delayed, row, 0, lane, position))
    put(signals, 'velocity', lane, read_row(delayed, row, n, lane, velocity))
