# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Measurement of the plant's state: encoders, odometry, noisy rates and delay.

The encoders quantise the joint angles. The measured base pose is odometry from the quantised
angles, and exact without quantisation. Rates have noise; those of the base are computed from the
joint rates, so all measurements are consistent. Without measured velocities they are zero. Finally
all values are delayed by whole ticks.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.arrays import read_part, write_part
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.portable_random import gaussian
from masmc_ros.numerics.scalars import minus, zero
from masmc_ros.numerics.tuples import elementwise, from_index, head, joined, tail
from masmc_ros.plant_model.delays import newest, OF_MEASUREMENT
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
def measured(plant: Any, memory: Any, tick: int) -> tuple[Numbers, Numbers]:
    """Return measured positions and velocities, before the delay."""
    model = mechanism.model_of(plant)
    position, rates = memory.position, memory.rates
    resolution, pose = plant.resolution, memory.odometry
    angles = elementwise(quantised, tail(position, rates), resolution)
    counts = mechanism.counts_turns(model, resolution)
    if (tick == 0) | (not counts):
        pose = head(position, pose)
    else:
        turned = elementwise(minus, angles, memory.counted)
        pose = mechanism.dead_reckoned(model, pose, turned)
    memory.odometry = pose
    memory.counted = angles
    noise = from_index(_noise, rates, (plant.seed, tick))
    rates = elementwise(_noisy, rates, plant.noise, noise)
    seen = joined(pose, angles)
    posture = mechanism.posture(model, seen)
    velocity = mechanism.position_rates(model, posture, rates)
    is_blind = plant.lacks_velocity != 0
    return seen, elementwise(zero, velocity) if is_blind else velocity


@formula
def measure(plant: Any, memory: Any, delayed: Any, tick: int, signals: Any) -> None:
    """
    Write the measurement of the true state in `memory` at a tick into `signals`.

    `delayed` (maximum delay + 1, positions, velocities and commands) contains the latest
    measurements, that of tick k in row k mod (delay + 1).
    """
    position, velocity = measured(plant, memory, tick)
    delay = plant.delay
    rows = delay + 1
    n = len(position)
    write_part(delayed, tick % rows, 0, position)
    write_part(delayed, tick % rows, n, velocity)
    # The first measurement is used until the delay has passed.
    last = 0 if tick == 0 else memory.shown
    shown = newest(plant.seed, tick, OF_MEASUREMENT, delay, plant.delay_span, last)
    memory.shown = shown
    signals.age = tick - shown
    signals.position = read_part(delayed, shown % rows, 0, position)
    signals.velocity = read_part(delayed, shown % rows, n, velocity)
