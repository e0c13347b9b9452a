# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Measurement of the plant's state: encoders, odometry, noisy rates and delay.

The encoders quantise the angles of joints, or of the rotors of elastic joints. The measured base
pose is odometry from the quantised angles, and exact without quantisation. Rates have noise; those
of the base are computed from the joint rates, so all measurements are consistent. Without measured
velocities they are zero. Finally all values are delayed by whole ticks, and some are lost.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Record
from masmc_ros.jit.arrays import read_part, write_part
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.tuples import elementwise, head, joined
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.portable_random import gaussian
from masmc_ros.numerics.scalars import minus, zero
from masmc_ros.plant_model.delays import is_lost, newest, OF_MEASUREMENT
from masmc_ros.plant_model.elastic import rotor_angles, rotor_rates
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings, Signals
from masmc_ros.robot import mechanism

# Adding and subtracting 1.5 * 2**52 rounds a double below 2**51 to the nearest integer.
_ROUND = 6755399441055744.0
_LARGEST_COUNT = 2251799813685248.0


@formula
def quantised(angle: float, resolution: float) -> float:
    """Return the multiple of the resolution nearest to an angle, both in rad; 0: the angle."""
    count = angle / resolution
    rounded = ((count + _ROUND) - _ROUND) * resolution
    return rounded if resolution > 0.0 and abs(count) < _LARGEST_COUNT else angle


@formula
def write_noise(plant: Record, memory: Record, tick: int) -> None:
    """
    Write the standard normal numbers of a tick into `memory`, in all lanes.

    The loop is separate, because lanes vectorise in short loops only.
    """
    standard_noise, seed = memory['standard_noise'], plant['seed']
    for joint in range(len(standard_noise)):
        for lane in range(lane_count(plant)):
            standard_noise[joint, lane] = gaussian(seed[lane], tick, joint)


@formula
def _noisy(rate: float, deviation: float, noise: float) -> float:
    """Return the measured rate in rad/s: with noise of a standard deviation."""
    return rate + deviation * noise if deviation > 0.0 else rate


@formula
def _chosen(is_first: bool, first: float, second: float) -> float:
    return first if is_first else second


@formula
def measure(plant: PlantSettings, memory: PlantMemory, tick: int, signals: Signals) -> None:
    """
    Write the measurement of the true state into `signals`, without delay.

    `memory` contains the noise. An exact measurement keeps the true state in `signals`. Both cases
    are computed and one is selected, because lanes vectorise without branches.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant, one lane.
    tick
        Current tick; odometry starts at tick 0.
    signals
        Signals of the tick with the true state; `position` and `velocity` are written.

    """
    place, model = mark(plant), mechanism.model_of(plant)
    position, resolution, pose = memory.position, plant.resolution, memory.odometry
    angles = elementwise(quantised, rotor_angles(plant, memory), resolution)
    counts = mechanism.counts_turns(model, resolution) & (tick != 0)
    turned = elementwise(minus, angles, memory.counted)
    counted = mechanism.dead_reckoned(model, pose, turned)
    pose = elementwise(_chosen, counts, counted, head(position, pose))
    memory.odometry = pose
    memory.counted = angles
    rates = rotor_rates(plant, memory)
    rates = elementwise(_noisy, rates, plant.noise, memory.standard_noise)
    seen = joined(pose, angles)
    posture = mechanism.posture(model, seen)
    velocity = mechanism.position_rates(model, posture, rates)
    is_blind, is_exact = plant.lacks_velocity != 0, plant.is_exact != 0
    velocity = elementwise(_chosen, is_blind, elementwise(zero, velocity), velocity)
    signals.position = elementwise(_chosen, is_exact, signals.position, seen)
    signals.velocity = elementwise(_chosen, is_exact, signals.velocity, velocity)
    free(plant, place)


@formula
def delay_measurement(
    plant: PlantSettings, memory: PlantMemory, delayed: Array, tick: int, signals: Signals
) -> None:
    """
    Replace the measurement in `signals` by a delayed one, and write its age in ticks.

    If the measurement of a tick is lost, the previous one is repeated.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant, one lane.
    delayed
        Latest values (maximum delay + 2, positions, velocities and commands); the measurement of
        tick k is in row k mod (delay + 1), and the one shown last in row delay + 1.
    tick
        Current tick.
    signals
        Signals of the tick.

    """
    position, velocity = signals.position, signals.velocity
    delay = plant.delay
    rows = delay + 1
    n = len(position)
    write_part(delayed, tick % rows, 0, position)
    write_part(delayed, tick % rows, n, velocity)
    # The first measurement is used until the delay has passed.
    last = 0 if tick == 0 else memory.shown
    lost = is_lost(plant.seed, tick, OF_MEASUREMENT, plant.measurement_loss) & (tick > 0)
    shown = newest(plant.seed, tick, OF_MEASUREMENT, delay, plant.delay_span, last)
    shown = last if lost else shown
    memory.shown = shown
    signals.age = tick - shown
    row = rows if lost else shown % rows
    position, velocity = read_part(delayed, row, 0, position), read_part(delayed, row, n, velocity)
    write_part(delayed, rows, 0, position)
    write_part(delayed, rows, n, velocity)
    signals.position = position
    signals.velocity = velocity
