# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commanded velocities: the kinematic law, the drives' velocity loops, and both on the path."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.loop import records
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.plant_model.drives import drive, joint_inertias
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
RATES = 'plant.command_interface=velocity', 'controller.command_interface=velocity'


def simulation(*settings: str) -> Simulation:
    """Return the paper's scenario with commanded velocities."""
    return Simulation(load_scenario(PAPER, (*RATES, *settings)))


def rms(run: TickBlock) -> list[float]:
    """Return the RMS distances of E and F from their paths over the second half, in mm."""
    half = len(run.error) // 2
    error = 1e3 * run.error[half:-1]
    return [float(np.sqrt((error[:, a] ** 2).sum(axis=1).mean())) for a in ([0, 1], [2, 3])]


@pytest.mark.slow
@pytest.mark.parametrize('period', [0.001, 0.01])
def test_velocity_interface_paper_path_is_tracked(period: float) -> None:
    """The usual disturbance acts; the drives' loops of 100 rad/s reject it."""
    (run,) = simulation(f'control_period={period}').run(block=30_000)
    end_effector, platform = rms(run)
    assert end_effector < 0.7
    assert platform < 0.12
    assert run.rates.shape == (len(run.error), 4)
    assert not run.torque.any()
    assert (run.estimate == run.estimate[0]).all()


def test_velocity_loop_faster_drive_tracks_more_closely() -> None:
    errors = []
    for bandwidth in (50.0, 100.0, 200.0):
        (run,) = simulation(f'plant.velocity_loop.bandwidth={bandwidth}').run(block=30_000)
        errors.append(rms(run)[0])
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]


def test_velocity_interface_tick_by_tick_equals_whole_run() -> None:
    whole = simulation('duration=0.5', 'plant.torque_limit=[8.0, 8.0, 20.0, 10.0]')
    (run,) = whole.run()
    single = simulation('duration=0.5', 'plant.torque_limit=[8.0, 8.0, 20.0, 10.0]')
    plant, controller = single.plant, single.controller
    for k in range(501):
        controller.tick(plant.position, plant.velocity, run.reference[k])
        assert (plant.position == run.position[k]).all(), k
        assert (controller.velocity_command == run.rates[k]).all(), k
        assert (plant.applied == run.applied[k]).all(), k
        plant.advance(controller.velocity_command)
    assert np.abs(run.applied).max(axis=0) == pytest.approx([8.0, 8.0, 20.0, 10.0], rel=0.5)
    assert (np.abs(run.applied) <= [8.0, 8.0, 20.0, 10.0]).all()


def test_velocity_interface_reset_repeats_run_exactly() -> None:
    again = simulation('duration=0.3')
    one, other = (next(iter(again.run())) for _ in range(2))
    assert (one.position == other.position).all()
    assert (one.applied == other.applied).all()


def test_velocity_command_other_wheels_base_moves_as_commanded() -> None:
    robot = {'wheel_radius': 0.08, 'half_track': 0.25}
    one = simulation(
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        *(f'plant.robot.{name}={value}' for name, value in robot.items()),
    )
    forward, turn, *arm = command = np.array([0.4, 0.5, 0.2, -0.1])
    for _ in range(1000):
        one.plant.advance(command)
    velocity = one.plant.true_velocity
    assert np.hypot(*velocity[:2]) == pytest.approx(forward, rel=1e-4)
    assert velocity[2] == pytest.approx(turn, rel=1e-4)
    wheels = (forward + 0.25 * turn) / 0.08, (forward - 0.25 * turn) / 0.08
    assert velocity[3:].tolist() == pytest.approx([*wheels, *arm], rel=1e-3)


def test_velocity_interface_wrong_wheels_keep_accuracy() -> None:
    """The base receives speed and yaw rate and uses its true wheel distance and radius."""
    wrong = 'controller.robot.wheel_radius=0.07', 'controller.robot.half_track=0.15'
    (known,), (unknown,) = simulation().run(block=30_000), simulation(*wrong).run(block=30_000)
    assert rms(unknown) == pytest.approx(rms(known), rel=0.1)


def test_velocity_interface_fast_drives_errors_decay_with_sigma() -> None:
    """Without disturbance and with fast drives edot = -sigma e, also with a coarse period."""
    settings = (
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'plant.velocity_loop.bandwidth=1000.0',
        'plant.integrator_step=0.0001',
        'control_period=0.02',
    )
    (run,) = simulation(*settings, 'duration=2.0').run()
    norm = np.linalg.norm(run.error, axis=1)
    assert norm[60] / norm[10] == pytest.approx(np.exp(-2.0 * 50 * 0.02), rel=0.03)


def test_drive_step_response_has_double_pole_at_bandwidth() -> None:
    bandwidth, inertia, h = 20.0, 0.3, 1e-4
    rate, integral = 0.0, 0.0
    for k in range(1, 5001):
        torque, integral = drive(1.0 - rate, integral, inertia, bandwidth, 0.0, h)
        rate += h * torque / inertia
        t = bandwidth * k * h
        # Step response of (2 w s + w^2) / (s + w)^2.
        assert rate == pytest.approx(1.0 - (1.0 - t) * np.exp(-t), abs=5e-3)


def test_drive_at_torque_limit_does_not_wind_up() -> None:
    integral = 0.0
    for _ in range(10_000):
        torque, integral = drive(5.0, integral, 1.0, 10.0, 2.0, 1e-3)
        assert torque == 2.0
    assert integral == 0.0
    # The integral can still leave the limit.
    _, unwound = drive(-0.1, 4.0, 1.0, 10.0, 2.0, 1e-3)
    assert unwound < 4.0


def test_drive_tuning_joint_inertia_equals_simulated_one() -> None:
    robot = robot_of(load_scenario(PAPER)['plant'])
    settings, angles = records.plant_settings(TWO_LINK), np.array([0.0, 0.0, 0.3, -1.2])
    (inertia,) = joint_inertias(settings, robot.geometry[None], robot.theta[None], angles[None])
    plant = SimulatedRobot(
        robot,
        1e-5,
        load_scenario(PAPER, ('plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',))['plant'],
    )
    mass = np.empty((4, 4))
    for i in range(4):
        plant.reset()
        plant.memory['position'][0, 5:, 0] = 0.3, -1.2
        plant.advance(np.eye(4)[i])
        mass[:, i] = plant.true_velocity[3:] / 1e-5
    assert inertia == pytest.approx(np.diag(np.linalg.inv(mass)), rel=1e-4)


@pytest.mark.parametrize('node', ['plant', 'controller'])
@pytest.mark.parametrize('setting', ['command_interface=velocity', 'enable_stamped_cmd_vel=true'])
def test_velocity_interface_plant_controller_differ_raises(node: str, setting: str) -> None:
    with pytest.raises(InputError, match=setting.partition('=')[0]):
        Simulation(load_scenario(PAPER, (f'{node}.{setting}',)))
