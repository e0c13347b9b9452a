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
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.tuples import elementwise, head, joined
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.portable_math import gaussian, uniform
from masmc_ros.numerics.scalars import minus, zero
from masmc_ros.plant_model.joint_effects import rotor_angles, rotor_rates
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings, Signals
from masmc_ros.robot import mechanism

OF_MEASUREMENT, OF_COMMAND = 0, 1
"""Streams of random numbers of the delays."""

LOSSES = 2
"""Offset from the stream of a delay to the stream of its lost messages."""


@formula
def is_lost(seed: int, tick: int, stream: int, probability: float) -> bool:
    """
    Return True if the message that arrives at a tick is lost.

    Parameters
    ----------
    seed, stream
        Sequence of random numbers; the stream is OF_MEASUREMENT or OF_COMMAND.
    tick
        Current tick.
    probability
        Probability of a loss; 0: no message is lost.

    """
    return uniform(seed, tick, stream + LOSSES) < probability


@formula
def newest(seed: int, tick: int, stream: int, largest: int, span: int, last: int) -> int:
    """
    Return the tick of the newest value that has arrived at a tick.

    Parameters
    ----------
    seed, stream
        Sequence of random numbers; the stream is OF_MEASUREMENT or OF_COMMAND.
    tick
        Current tick.
    largest
        Largest delay in ticks.
    span
        Largest minus smallest delay in ticks.
    last
        Result of the previous tick, a lower bound.

    """
    arrived = tick - largest + int(uniform(seed, tick, stream) * (span + 1))
    return arrived if arrived > last else last


@formula
def receive(
    plant: Record, memory: Record, delay_line: Array, tick: int, signals: Record, holds: bool
) -> None:
    """
    Write the command that has arrived at a tick into the memory.

    It writes `torque` and `commanded_rates`. The first command, and the first one after a void
    command, act without delay.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant, all lanes.
    delay_line
        Delayed values of each lane (maximum delay + 2, positions, velocities and commands); the
        command of tick k is in row k mod (delay + 1), and the last received one in row delay + 1.
    tick
        Current tick.
    signals
        Signals of the tick, with the command.
    holds
        True for a void command; zeros are written.

    """
    lanes, delays = lane_count(plant), 0
    for lane in range(lanes):
        robot = lane_of(plant, lane)
        delays += robot.command_delay + int(robot.command_loss > 0.0)
    for lane in range(lanes):
        torque, rates = lane_of(signals, lane).torque, lane_of(signals, lane).rates
        lane_of(memory, lane).torque = elementwise(zero, torque) if holds else torque
        lane_of(memory, lane).commanded_rates = elementwise(zero, rates) if holds else rates
    if holds:
        for lane in range(lanes):
            lane_of(memory, lane).acting = tick + 1
    elif delays > 0:
        for lane in range(lanes):
            robot, state = lane_of(plant, lane), lane_of(memory, lane)
            _delay_command(robot, state, lane_of(delay_line, lane), tick)


@formula
def _delay_command(
    plant: PlantSettings, memory: PlantMemory, delay_line: Array, tick: int
) -> None:
    torque, rates = memory.torque, memory.commanded_rates
    delay = plant.command_delay
    first = 2 * len(memory.position)
    second = first + len(torque)
    write_part(delay_line, tick % (delay + 1), first, torque)
    write_part(delay_line, tick % (delay + 1), second, rates)
    # The first command cannot be lost, because there is none before it.
    first_tick = memory.acting >= tick
    lost = is_lost(plant.seed, tick, OF_COMMAND, plant.command_loss) & (not first_tick)
    acting = newest(plant.seed, tick, OF_COMMAND, delay, plant.command_delay_span, memory.acting)
    acting = memory.acting if lost else acting
    memory.acting = acting
    row = delay + 1 if lost else acting % (delay + 1)
    torque = read_part(delay_line, row, first, torque)
    rates = read_part(delay_line, row, second, rates)
    write_part(delay_line, delay + 1, first, torque)
    write_part(delay_line, delay + 1, second, rates)
    memory.torque = torque
    memory.commanded_rates = rates


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
