# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that hold zero velocity without commands, and a smooth restart of the controller."""

from __future__ import annotations

from helpers.processes import PAPER
from masmc_ros.loop.controller_events import ACTIVATED, DEACTIVATED
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import activation, load_scenario
import numpy as np
import pytest

DURATION = 8.0
LIMITS = (
    'controller.torque_limit=[6.0, 6.0, 20.0, 10.0]',
    'controller.torque_rate_limit=1000.0',
    'plant.torque_limit=[6.0, 6.0, 20.0, 10.0]',
)
QUICK = (2276, 2277, 2278, 2279)
SLOWER = (2276, 2376, 2478, 2579)
LONG = (2000, 5000)
HELD = slice(3, 7)
"""The driven joints in the order of joint_states."""


def computed(ticks: tuple[int, ...], *settings: str) -> TickBlock:
    """Return the paper's run with the controller deactivated and activated at alternate ticks."""
    events = (DEACTIVATED, ACTIVATED) * (len(ticks) // 2)
    changes = [Change(tick, {}, event) for tick, event in zip(ticks, events, strict=True)]
    void = 'controller.fault_action=void'
    values = load_scenario(str(PAPER), [f'duration={DURATION}', void, *settings])
    (run,) = Simulation(values, changes).run()
    return run


def robot(*settings: str) -> SimulatedRobot:
    values = load_scenario(str(PAPER), settings)['plant']
    return SimulatedRobot(robot_of(values), values['control_period'], values)


@pytest.mark.parametrize('settings', [(), LIMITS, ('controller.switching=implicit',)])
@pytest.mark.parametrize('ticks', [QUICK, SLOWER, LONG])
def test_controller_deactivated_and_activated_does_not_jump(
    ticks: tuple[int, ...], settings: tuple[str, ...]
) -> None:
    """A free arm turned by 87 rad under this disturbance, and activation caused 649 N·m."""
    run = computed(ticks, *settings)
    # The drives brake the wheels from their speed on the path.
    travel = np.ptp(run.position[ticks[0]:ticks[1], HELD], axis=0)
    assert (travel < [0.5, 0.5, 0.05, 0.1]).all()
    assert not run.torque[ticks[0]:ticks[1]].any()
    torque = np.abs(run.torque[ticks[1]:]).max(axis=0)
    assert (torque < [3.0, 3.0, 7.0, 5.0]).all()
    assert np.abs(run.error[-1]).max() < 0.05
    # The holding torques of the drives do not count as applied torques.
    assert not run.applied[ticks[0] + 1:ticks[1] + 1].any()


@pytest.mark.parametrize('ticks', [QUICK, SLOWER, LONG])
def test_controller_activated_torque_stays_within_limits(ticks: tuple[int, ...]) -> None:
    run = computed(ticks, *LIMITS)
    step = np.abs(np.diff(run.torque, axis=0))
    # A torque may fall to zero at once.
    falls = ~run.active[1:]
    assert (step[~falls] <= 1.0 + 1e-9).all()
    assert (np.abs(run.torque) <= [6.0, 6.0, 20.0, 10.0]).all()


def test_controller_inactive_at_start_is_activated_softly() -> None:
    values = load_scenario(
        str(PAPER), ['duration=1.0', 'controller.active_on_start=false']
    )
    (soft,) = Simulation(values, activation(values)).run()
    hard = computed(())
    assert np.abs(soft.torque[:100]).max() < 0.2 * np.abs(hard.torque[:100]).max()


@pytest.mark.parametrize(
    'settings',
    [
        (),
        ('plant.torque_limit=[6.0, 6.0, 20.0, 10.0]',),
        ('plant.initial_joints=[0.0, 0.0, 0.8, 0.0]',),
        ('plant.initial_joints=[0.0, 0.0, 0.8, 3.1]', 'robot.link_1_mass=30.0'),
        ('control_period=0.01', 'plant.integrator_step=0.01'),
        ('control_period=0.01', 'plant.integrator_step=0.01', 'robot.link_2_mass=0.1'),
    ],
)
def test_drives_moving_robot_without_commands_brake_it(settings: tuple[str, ...]) -> None:
    """The robot loses its energy for any posture of the arm and any integration step."""
    plant = robot(
        'plant.initial_velocity=[5.0, 4.0, 1.0, -1.5]',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        *settings,
    )
    start = plant.position.copy()
    ticks = round(1.5 / plant.period)
    for _ in range(ticks):
        plant.advance(None)
        assert not plant.applied.any()
        assert (np.abs(plant.velocity[HELD]) < 20.0).all()
    assert np.abs(plant.velocity[HELD]).max() < 1e-2
    # The robot stays near its position.
    assert np.abs(plant.position[HELD] - start[HELD]).max() < 2.0


def test_drives_torque_command_end_holding_at_once() -> None:
    plant = robot('plant.disturbance.amplitude=[0.0, 0.0, 3.0, 0.0]')
    for _ in range(1000):
        plant.advance(None)
    assert plant.memory['drive_integral'].any()
    # After a torque command the drives keep no holding torque.
    plant.advance(np.zeros(4))
    assert not plant.memory['drive_integral'].any()
    assert not plant.applied.any()
