# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What the controller makes of ticks that were cut, left out, or answered by somebody else."""

from __future__ import annotations

from typing import Any

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.names import DRIVEN_JOINTS
from masmc_ros.nodes.controller.saturation import Saturation
from masmc_ros.params.scenario import load_scenario
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
import numpy as np
from processes import PAPER
import pytest

PERIOD = 1e-3
GENTLE = ('controller.k_s1=20', 'controller.k_s2=20', 'controller.law=smc')


class Loop:
    """A controller on its robot, tick by tick."""

    def __init__(self, *settings: str) -> None:
        values = load_scenario(str(PAPER), (*GENTLE, *settings))
        self.controller = Controller(robot_of(values['controller']), PERIOD, values['controller'])
        self.robot = SimulatedRobot(robot_of(values['plant']), PERIOD, values['plant'])
        trajectory = Trajectory(values['trajectory'], PERIOD, robot_of(values['trajectory']))
        self.reference = trajectory.sample(0, 3000)

    def disturbance(self) -> Any:
        """Return the disturbance that the controller has estimated."""
        return self.controller.memory['disturbance'][0, :, 0].copy()

    def tick(self) -> None:
        """Answer the robot's state."""
        robot = self.robot
        self.controller.tick(robot.position, robot.velocity, self.reference[robot.tick])

    def move(self, torque: Any) -> None:
        """Let the robot move on for a period."""
        self.robot.advance(np.asarray(torque, dtype=np.float64))

    def rate_error(self) -> float:
        """Return the largest error of the estimated rates in rad/s."""
        estimated = self.controller.memory['rates'][0, :, 0]
        return float(np.abs(estimated - self.robot.velocity[3:]).max())


def rate_error(every: int, *, says_so: bool = True) -> float:
    """Return the largest error of estimated rates where only every so many states are answered."""
    loop = Loop('controller.velocity_source=estimated')
    largest = 0.0
    for tick in range(1500):
        if tick % every == 0:
            if says_so and tick:
                loop.controller.skip(every - 1)
            loop.tick()
            if tick > 300:
                largest = max(largest, loop.rate_error())
        loop.move(loop.controller.torque)
    return largest


def test_rates_are_estimated_through_ticks_that_are_left_out() -> None:
    assert rate_error(3) < 0.15
    assert rate_error(3) < 0.2 * rate_error(3, says_so=False)


@pytest.mark.parametrize('every', [10, 12, 20])
def test_rates_are_estimated_where_most_ticks_are_left_out(every: int) -> None:
    """With the gains of one period the observer is unstable from ten on."""
    assert rate_error(every) < 4.0


def test_rates_do_not_jump_where_many_ticks_are_left_out_at_once() -> None:
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


def test_ticks_that_are_left_out_are_no_disturbance() -> None:
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
    loop.controller.rest()
    loop.tick()
    assert (loop.disturbance() == before).all()
    for _ in range(20):
        loop.move(loop.controller.torque)
    loop.controller.skip(19)
    loop.tick()
    assert (loop.disturbance() == before).all()
    # The same without a word would be taken for a push.
    for _ in range(20):
        loop.move(np.zeros(4))
    loop.tick()
    assert (loop.disturbance() != before).any()


def test_saturation_is_told_by_joint_and_from_report_to_report() -> None:
    loop = Loop('controller.torque_limit=[0.0, 0.0, 0.5, 0.0]')
    saturation = Saturation(DRIVEN_JOINTS)
    assert saturation.report() == {
        'ticks with limited torque': '0.0%', 'joints with limited torque': 'none',
    }  # fmt: skip
    cut = 0
    for _ in range(100):
        loop.tick()
        saturation.add(loop.controller)
        cut += bool(abs(loop.controller.raw_torque[2]) > 0.5)
        loop.move(loop.controller.torque)
    assert cut > 0
    assert saturation.report() == {
        'ticks with limited torque': f'{cut}.0%',
        'joints with limited torque': f'arm_joint_1 {cut}%',
    }
    assert saturation.report()['ticks with limited torque'] == '0.0%'
