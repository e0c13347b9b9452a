# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Hybrid commands with late odometry, and a jump of the frame of the path."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.reference.approach import Approach
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.base_pose import BasePose
from masmc_ros.robot.dead_reckoning import DeadReckoning
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
SETTINGS = (
    'plant.command_interface=hybrid',
    'controller.command_interface=hybrid',
    'plant.base_lag=0.1',
    'controller.base_lag=0.1',
    'controller.switching=implicit',
)
ACCURATE = ('controller.observer_gain=0.5',)
"""Disturbance estimate for states without delay."""
EVERY, LATE = 20, 20
"""Ticks of 1 ms between two odometry messages, and their age in ticks."""

JUMP, AT = 0.05, 5000
"""Distance in m and tick of the jump."""


class Result(NamedTuple):
    """Errors (n, axes) in m, torques (n, joints) in N·m and velocities of all ticks."""

    error: NDArray[np.float64]
    torque: NDArray[np.float64]
    velocity: NDArray[np.float64]


def transform(x: float) -> NDArray[np.float64]:
    return np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def run(
    *settings: str,
    file: str = 'paper.yaml',
    ticks: int = 7000,
    jump: float = 0.0,
    approaches: bool = True,
) -> Result:
    """Run with a pose from late odometry, in a frame that jumps along x."""
    values = load_scenario(str(CONFIG / file), (*SETTINGS, *(settings or ACCURATE)))
    plant, control = plant_of(values['plant'], 0.001), values['controller']
    controller = Controller(robot_of(control), 0.001, control)
    controller.set_stamp_age(plant.delay)
    robot = controller.robot
    axes, joints = len(robot.mechanism.axes), len(robot.mechanism.joints)
    samples = Trajectory(values['trajectory'], 0.001, robot).sample(0, ticks)
    wheels, approach = DeadReckoning(robot), Approach(robot, control['approach_speed'])
    base, past = BasePose(wheels), []
    base.correct(transform(0.0))
    result = Result(*(np.empty((ticks, n)) for n in (axes, joints, len(plant.true_velocity))))
    for k in range(ticks):
        position, velocity = plant.position.copy(), plant.velocity.copy()
        past.append((plant.position.copy(), plant.velocity.copy()))
        wheels.add(k * 1_000_000, position)
        if k % EVERY == 0:
            sent = max(0, k - LATE)
            state = [array[None] for array in past[sent]]
            pose, twist = robot.mechanism.formulas.base_motion(*state)
            base.update(sent * 1_000_000, pose[0], twist[0])
        if k == AT:
            base.correct(transform(jump))
        base.write(k * 1_000_000, position, velocity)
        if base.has_jumped and approaches:
            approach.start()
            controller.skip(0)
        base.has_jumped = False
        reference = samples[k]
        if approach.is_on:
            rates = controller.rates(velocity)
            reference = approach.follow(k * 1_000_000, position, rates, reference)
        controller.tick(position, velocity, reference)
        true = plant.true_position.copy()
        true[0] += jump if k >= AT else 0.0
        result.error[k] = robot.task_positions(true[None])[0] - samples[k, :axes]
        result.torque[k], result.velocity[k] = controller.torque, plant.true_velocity
        command = np.where(plant.by_velocity, controller.velocity_command, controller.torque)
        plant.advance(command)
    return result


def tip_error(result: Result, axes: int) -> float:
    """Return the RMS distance of the tip, whose position has so many axes, in mm."""
    error = 1e3 * result.error[AT:, :axes]
    return math.sqrt((error**2).sum(axis=1).mean())


def test_hybrid_late_odometry_tip_stays_accurate() -> None:
    assert tip_error(run(), 2) < 0.04


def late(measurement: int, command: int) -> tuple[str, ...]:
    """Return the settings of both delays in ms, and of their sum as the known latency."""
    return (
        'controller.law=smc',
        f'plant.measurement_delay={1e-3 * measurement:g}',
        f'plant.command_delay={1e-3 * command:g}',
        f'controller.latency={1e-3 * (measurement + command):g}',
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ('file', 'axes', 'delays', 'largest'),
    [
        ('paper.yaml', 2, (2, 3), 0.2),
        ('tiago.yaml', 3, (2, 3), 0.01),
        ('tiago.yaml', 3, (5, 5), 0.04),
    ],
)
def test_hybrid_late_odometry_and_latency_tip_stays_accurate(
    file: str, axes: int, delays: tuple[int, int], largest: float
) -> None:
    assert tip_error(run(*late(*delays), file=file, ticks=10_000), axes) < largest


def test_jump_of_frame_causes_no_peak_of_torque_or_speed() -> None:
    calm, jumped, steps = run(), run(jump=JUMP), run(jump=JUMP, approaches=False)
    torques, speeds = (
        [np.abs(values[AT:]).max(axis=0) for values in (calm, jumped, steps)]
        for calm, jumped, steps in (
            (calm.torque, jumped.torque, steps.torque),
            (calm.velocity, jumped.velocity, steps.velocity),
        )
    )
    assert (torques[1] <= 2.0 * torques[0] + 0.1).all()
    assert (speeds[1] <= 1.2 * speeds[0] + 0.5).all()
    # Without an approach the law answers to the distance at once.
    assert torques[2].max() > 10.0 * torques[1].max()
    assert np.abs(jumped.error[-1]).max() < 2e-3
