# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Motion and torques of a robot for identification, computed or simulated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from masmc_ros.aliases import Array
from masmc_ros.identification.excitation import Series
from masmc_ros.identification.regressor import instantaneous
from masmc_ros.identification.samples import Samples
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.robot.robot import Robot, robot_of
import numpy as np

PERIOD = 0.002


def series(start: Array, seed: int, duration: float, amplitude: Array | float) -> Series:
    """Return a random series of joints with amplitudes in rad or m."""
    random = np.random.default_rng(seed)
    sines, cosines = random.standard_normal((2, len(start), 5)) / np.array([1, 2, 3, 5, 8])
    return Series(start, sines, cosines, duration).times_factors(amplitude)


def computed(
    robot: Robot, parameters: Array, motion: Series, *, latency: int = 0, encoder: float = 0.0
) -> Samples:
    """
    Return the samples of a robot with parameters (p + 2 n) that moves exactly as a series.

    The state is `latency` periods old; `encoder` is the step of the encoders in rad, without
    velocities, or 0 for exact positions and velocities.
    """
    times = np.arange(round(motion.duration / PERIOD)) * PERIOD
    base = len(robot.mechanism.base)

    def positions(angles: Array) -> Array:
        return np.hstack([np.zeros((len(angles), base)), angles])

    # The torque held over a period has the value of its middle.
    angles, rates, accelerations = motion.at(times + PERIOD / 2.0)
    equations = instantaneous(robot, positions(angles), rates, accelerations)
    torque = equations.known + equations.matrix @ parameters
    measured, velocity, _ = motion.at(times - latency * PERIOD)
    if encoder > 0.0:
        measured = np.round(measured / encoder) * encoder
        velocity = np.full_like(velocity, np.nan)
    return Samples(times, positions(measured), velocity, times, torque)


def simulated(
    values: Mapping[str, Any],
    motion: Series,
    gains: tuple[Array, Array],
    *,
    latency: int,
    lag: float,
) -> Samples:
    """
    Return the samples of a simulated plant whose joints follow a series by PD feedback.

    The torque acts `latency` periods after its state, through motors with a first-order `lag` in
    s. The torque over a period is the mean of that of the motor.
    """
    period = values['control_period']
    plant = SimulatedRobot(robot_of(values), period, values)
    base, joints = len(plant.mechanism.base), len(plant.mechanism.joints)
    times = np.arange(round(motion.duration / period)) * period
    angles, rates, _ = motion.at(times)
    position, velocity = np.empty((len(times), base + joints)), np.empty((len(times), joints))
    commands = np.empty((len(times), joints))
    motor, decay = np.zeros(joints), np.exp(-period / lag)
    for k in range(len(times)):
        position[k], velocity[k] = plant.position, plant.velocity[base:]
        error, rate_error = angles[k] - position[k, base:], rates[k] - velocity[k]
        commands[k] = gains[0] * error + gains[1] * rate_error
        command = commands[k - latency] if k >= latency else np.zeros(joints)
        plant.advance(command + (motor - command) * (1.0 - decay) * lag / period)
        motor = command + (motor - command) * decay
    return Samples(times, position, velocity, times, commands)
