# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Delays of measurements and commands in whole ticks, with jitter, and lost messages.

A delay is a uniform random whole number between its smallest and its largest value, determined by
seed, stream and tick. Values arrive in order: a value that would arrive after a later one is
dropped. If a message is lost, its receiver uses the previous one for another tick.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Record
from masmc_ros.jit.arrays import read_part, write_part
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.tuples import elementwise
from masmc_ros.numerics.portable_random import uniform
from masmc_ros.numerics.scalars import zero
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings

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
