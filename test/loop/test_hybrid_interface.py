# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Hybrid command interface: the base follows velocities, the arm torques."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from helpers.small_tree import parameters, START
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.lanes import lane_of
from masmc_ros.law.command_interface import by_velocity
from masmc_ros.law.parts.moving_base import accelerations_on_base, rates_by_torque
from masmc_ros.loop import records
from masmc_ros.loop.controller_events import DEACTIVATED
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.robot import mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.geometry import Geometry
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PAPER, TIAGO = (str(ROOT / 'config' / f'{name}.yaml') for name in ('paper', 'tiago'))
HYBRID = (
    'plant.command_interface=hybrid',
    'controller.command_interface=hybrid',
    'controller.switching=implicit',
    'controller.observer_gain=0.5',
)
LAG = 'plant.base_lag=0.1', 'controller.base_lag=0.1'


def run(*settings: str, file: str = PAPER) -> tuple[Simulation, TickBlock]:
    """Return a simulation, and its run in one block."""
    simulation = Simulation(load_scenario(file, (*HYBRID, *settings)))
    (block,) = simulation.run(block=30_000)
    return simulation, block


def rms(simulation: Simulation, block: TickBlock, *axes: int) -> float:
    """Return the RMS distance over the second half on some axes, in thousandths."""
    error = block.true_error(simulation.plant.robot)[len(block) // 2:, axes]
    return 1e3 * float(np.sqrt((error**2).sum(axis=1).mean()))


@pytest.mark.slow
def test_hybrid_lagging_base_tip_is_as_accurate_as_with_torques() -> None:
    simulation, block = run(*LAG, 'duration=10.0')
    assert rms(simulation, block, 0, 1) < 0.03
    assert rms(simulation, block, 2, 3) < 0.12
    assert not block.torque[:, :2].any()
    assert not block.rates[:, 2:].any()


@pytest.mark.slow
def test_hybrid_known_lag_base_follows_more_closely() -> None:
    errors = [
        rms(*run('plant.base_lag=0.3', f'controller.base_lag={lag}', 'duration=10.0'), 2, 3)
        for lag in (0.0, 0.3)
    ]
    assert errors[1] < 0.8 * errors[0]


def test_base_lag_step_response_is_first_order() -> None:
    values = load_scenario(
        PAPER,
        (
            'plant.command_interface=hybrid',
            'plant.base_lag=0.2',
            'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
            'plant.velocity_loop.bandwidth=500.0',
            'plant.torque_limit=[0.0, 0.0, 0.0, 0.0]',
        ),
    )['plant']
    plant = plant_of(values, 0.001)
    for k in range(1, 601):
        plant.advance(np.array([0.3, 0.0, 0.0, 0.0]))
        speed = np.hypot(*plant.true_velocity[:2])
        if k >= 20:
            assert speed == pytest.approx(0.3 * (1.0 - np.exp(-0.001 * k / 0.2)), abs=3e-3)


def test_arm_rates_produce_missing_task_velocity_within_damping() -> None:
    model = Geometry(0.05, 0.2, 0.1, 0.4, 0.3)
    position = 0.1, -0.2, 0.4, 0.0, 0.0, 0.7, -1.2
    posture = mechanism.posture(model, position)
    mask, missing = np.array([1, 1, 0, 0]), (0.05, -0.02, 0.0, 0.0)
    rates = rates_by_torque(model, posture, mask, missing, (0.0,) * 4)
    motion = mechanism.motion(model, mechanism.commanded_joint_rates(model, rates))
    reached = mechanism.task_velocity(model, posture, motion)
    np.testing.assert_allclose(reached, missing, atol=5e-5)
    assert rates[:2] == (0.0, 0.0)


@pytest.mark.parametrize('values', [{}, parameters()], ids=['planar', 'tree'])
def test_accelerations_on_base_equal_those_under_its_torques(values: dict[str, Any]) -> None:
    """The base gets the accelerations that torques of its wheels would cause."""
    kind = mechanism_from(values)
    robot = robot_of({p.name: p.default for p in kind.parameters} | values)
    settings, signals = records.plant_settings(kind), records.signals(kind)
    settings['geometry'][0, :, 0] = robot.geometry
    settings['theta'][0, :, 0] = robot.theta
    joints, random = len(kind.joints), np.random.default_rng(7)
    signals['position'][0, :, 0] = random.uniform(0.2, 1.0, signals['position'].shape[1])
    signals['velocity'][0, :, 0] = random.uniform(-1.0, 1.0, signals['velocity'].shape[1])
    signals['torque'][0, :, 0] = random.uniform(-3.0, 3.0, joints)
    with interpreted():
        plant, row = lane_of(settings[0], 0), lane_of(signals[0], 0)
        model, mask = mechanism.model_of(plant), (1,) * len(kind.twist) + (0,) * joints
        posture = mechanism.posture(model, row.position)
        state = model, posture, plant.theta
        rates, torque = row.velocity[-joints:], row.torque
        expected = mechanism.joint_accelerations(*state, rates, torque)
        command = mechanism.rate_command(model, mechanism.motion(model, expected))
        inputs = tuple(np.where(mask[:joints], command, torque))
        computed = accelerations_on_base(*state, mask[:joints], rates, inputs)
    np.testing.assert_allclose(computed, expected, rtol=1e-9)


def test_commanded_velocities_with_latency_raise_one_line() -> None:
    values = load_scenario(
        PAPER,
        (
            'plant.command_interface=velocity',
            'controller.command_interface=velocity',
            'controller.latency=0.01',
        ),
    )
    with pytest.raises(InputError, match=r'velocity: expected latency, motor_lag and comp'):
        Simulation(values)


def test_hybrid_fixed_arm_raises() -> None:
    fixed_base = {'robot.base': 'fixed', 'robot.wheels': (), 'robot.posture': (0.0,)}
    values = {**parameters(), **fixed_base}
    fixed = mechanism_from(values)
    with pytest.raises(InputError, match='no base'):
        by_velocity({'command_interface': 'hybrid'}, fixed)


def test_hybrid_safe_stop_arm_holds_base_rests() -> None:
    calm = 'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]'
    values = load_scenario(PAPER, (*HYBRID, *LAG, calm, 'duration=3.0'))
    (block,) = Simulation(values, [Change(1500, {}, DEACTIVATED)]).run()
    assert np.abs(block.true_velocity[-1]).max() < 0.02
    assert not block.torque[:, :2].any()
    assert block.torque[1600, 2:].any()


@pytest.mark.slow
def test_hybrid_base_of_tree_follows_twist() -> None:
    values = parameters()
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(values))}
    plant = plant_of(
        {
            **defaults,
            **values,
            'initial_joints': START,
            'disturbance.amplitude': (0.0,) * 7,
            'command_interface': 'hybrid',
        },
        0.001,
    )
    robot = robot_of({**defaults, **values})
    assert robot.mechanism.twist
    for _ in range(500):
        plant.advance(np.array([0.2, 0.3, 0.0, 50.0, 0.0, 0.0, 0.0]))
    assert np.hypot(*plant.true_velocity[:2]) == pytest.approx(0.2, rel=0.05)
    assert plant.true_velocity[2] == pytest.approx(0.3, rel=0.05)


@pytest.mark.slow
def test_hybrid_tiago_lagging_base_tip_is_accurate() -> None:
    simulation, block = run(*LAG, 'duration=10.0', file=TIAGO)
    assert rms(simulation, block, 0, 1, 2) < 0.05
