# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""External disturbance torques on the joints, continuous in time."""

from __future__ import annotations

from masmc_ros.aliases import Array, Record
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.tuples import elementwise
from masmc_ros.numerics.portable_math import bits_of, padded, sines, write_sines
import numpy as np


@formula
def _angle(time: float, frequency: float, phase: float) -> float:
    return frequency * time + phase


@formula
def _torque(amplitude: float, wave: float) -> float:
    return amplitude * wave


@formula
def moment(time: float, step: int, halves: int, h: float) -> float:
    """
    Return the time in s after half steps of a step.

    Parameters
    ----------
    time
        Start of the period in s.
    step
        Number of the step in the period, from 0.
    halves
        Number of half steps: 0, 1 or 2.
    h
        Length of a step in s.

    """
    return time + (step + 0.5 * halves) * h


@formula
def write_push(plant: Record, memory: Record, time: float) -> None:
    """Write `disturbance` (joints) at a time in s: amplitude sin(frequency t + phase) in N·m."""
    for lane in range(lane_count(plant)):
        robot = lane_of(plant, lane)
        angles = elementwise(_angle, time, robot.frequency, robot.phase)
        torque = elementwise(_torque, robot.amplitude, sines(angles))
        lane_of(memory, lane).disturbance = torque


@formula
def waves_of_step(plant: Record) -> int:
    """Return the largest number of values that `write_waves` writes."""
    return padded(3 * len(plant['phase']))


@formula
def shares_waves(plant: Record) -> bool:
    """Return True if disturbances of all lanes have the same frequencies and phases."""
    frequency, phase = plant['frequency'], plant['phase']
    others = np.int64(0)
    if lane_count(plant) > 1:
        for j in range(len(phase)):
            for lane in range(lane_count(plant)):
                # Compares bits, because zeros of different sign compare equal.
                others |= bits_of(frequency[j, lane]) ^ bits_of(frequency[j, 0])
                others |= bits_of(phase[j, lane]) ^ bits_of(phase[j, 0])
    return others == 0


@formula
def write_waves(plant: Record, time: float, step: int, h: float, waves: Array) -> None:
    """
    Write the sines that all lanes share: at the middle and the end of a step, and at its start.

    Only the first step has a start; later ones start at the end of the previous step. The sines of
    several times are computed together, because the joints alone do not fill a vector register.

    Parameters
    ----------
    plant
        Settings of the plant, all lanes.
    time
        Start of the period in s.
    step
        Number of the step in the period, from 0.
    h
        Length of a step in s.
    waves
        Array of `waves_of_step` values that is written.

    """
    frequency, phase = plant['frequency'], plant['phase']
    joints, count = len(phase), 3 if step == 0 else 2
    for k in range(count):
        at = moment(time, step, (k + 1) % 3, h)
        for j in range(joints):
            waves[k * joints + j] = _angle(at, frequency[j, 0], phase[j, 0])
    write_sines(waves, count * joints)


@formula
def push_by_waves(plant: Record, memory: Record, halves: int, waves: Array) -> None:
    """
    Write `disturbance` of all lanes after half steps of a step.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant, all lanes.
    halves
        Number of half steps: 0, 1 or 2.
    waves
        Values of `write_waves` for this step.

    """
    amplitude, disturbance = plant['amplitude'], memory['disturbance']
    first = (halves + 2) % 3 * len(disturbance)
    for j in range(len(disturbance)):
        wave = waves[first + j]
        for lane in range(lane_count(plant)):
            disturbance[j, lane] = amplitude[j, lane] * wave
