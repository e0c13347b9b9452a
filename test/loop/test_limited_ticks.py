# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Controller behaviour for ticks that were limited, skipped or answered by another node."""

from __future__ import annotations

from typing import Any

from helpers.processes import PAPER
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.topics import DRIVEN_JOINTS
from masmc_ros.nodes.controller.health import Saturation
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PERIOD = 1e-3
GENTLE = ('controller.k_s1=20', 'controller.k_s2=20', 'controller.law=smc')


class Loop:
    """A controller and its robot, tick by tick."""

    def __init__(self, *settings: str) -> None:
        values = load_scenario(str(PAPER), (*GENTLE, *settings))
        self.controller = Controller(robot_of(values['controller']), PERIOD, values['controller'])
        self.robot = SimulatedRobot(robot_of(values['plant']), PERIOD, values['plant'])
        trajectory = Trajectory(values['trajectory'], PERIOD, robot_of(values['trajectory']))
        self.reference = trajectory.sample(0, 3000)

    def disturbance(self) -> Any:
        """Return the estimated disturbance of the controller."""
        return self.controller.memory['disturbance'][0, :, 0].copy()

    def tick(self) -> None:
        """Compute the controller's response to the robot state."""
        robot = self.robot
        self.controller.tick(robot.position, robot.velocity, self.reference[robot.tick])

    def move(self, torque: Any) -> None:
        """Advance the robot by one period."""
        self.robot.advance(np.asarray(torque, dtype=np.float64))

    def rate_error(self) -> float:
        """Return the largest error of the estimated rates in rad/s."""
        estimated = self.controller.memory['rates'][0, :, 0]
        return float(np.abs(estimated - self.robot.velocity[3:]).max())


def rate_error(every: int, *, is_reported: bool = True) -> float:
    """Return the largest error of estimated joint velocities with n - 1 of n states skipped."""
    loop = Loop('controller.velocity_source=estimated')
    largest = 0.0
    for tick in range(1500):
        if tick % every == 0:
            if is_reported and tick:
                loop.controller.skip(every - 1)
            loop.tick()
            if tick > 300:
                largest = max(largest, loop.rate_error())
        loop.move(loop.controller.torque)
    return largest


def test_velocity_estimate_skipped_ticks_reported_stays_accurate() -> None:
    assert rate_error(3) < 0.15
    assert rate_error(3) < 0.2 * rate_error(3, is_reported=False)


@pytest.mark.parametrize('every', [10, 12, 20])
def test_velocity_estimate_most_ticks_skipped_is_bounded(every: int) -> None:
    """With the gains of a single period the observer is unstable if it gets one tick in ten."""
    assert rate_error(every) < 4.0


def test_velocity_estimate_50_skipped_ticks_does_not_jump() -> None:
    loop = Loop('controller.velocity_source=estimated')
    for _ in range(1500):
        loop.tick()
        loop.move(loop.controller.torque)
    for _ in range(50):
        loop.move(loop.controller.torque)
    loop.controller.skip(50)
    for _ in range(50):
        loop.tick()
        assert loop.rate_error() < 1.0
        loop.move(loop.controller.torque)


def test_disturbance_estimate_skipped_ticks_is_unchanged() -> None:
    loop = Loop(
        'controller.switching=implicit', 'controller.observer_gain=0.5',
        'controller.model_scale=1.0', 'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    )  # fmt: skip
    for _ in range(200):
        loop.tick()
        loop.move(loop.controller.torque)
    before = loop.disturbance()
    for _ in range(20):
        loop.move(np.zeros(4))
    loop.controller.output_not_applied()
    loop.tick()
    assert (loop.disturbance() == before).all()
    for _ in range(20):
        loop.move(loop.controller.torque)
    loop.controller.skip(19)
    loop.tick()
    assert (loop.disturbance() == before).all()
    # Without the call of `skip` the same ticks look like a disturbance.
    for _ in range(20):
        loop.move(np.zeros(4))
    loop.tick()
    assert (loop.disturbance() != before).any()


def test_saturation_report_names_joints_since_last_report() -> None:
    loop = Loop('controller.torque_limit=[0.0, 0.0, 0.5, 0.0]')
    saturation = Saturation(DRIVEN_JOINTS)
    assert saturation.report() == {
        'ticks with limited torque': '0.0%', 'joints with limited torque': 'none',
    }  # fmt: skip
    limited = 0
    for _ in range(100):
        loop.tick()
        saturation.add(loop.controller)
        limited += bool(abs(loop.controller.raw_torque[2]) > 0.5)
        loop.move(loop.controller.torque)
    assert limited > 0
    assert saturation.report() == {
        'ticks with limited torque': f'{limited}.0%',
        'joints with limited torque': f'arm_joint_1 {limited}%',
    }
    assert saturation.report()['ticks with limited torque'] == '0.0%'
