# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Delays of commands, jitter, losses, motor lag, stiction and missing velocities of the plant."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from helpers.robots import Array, PROPERTY
from helpers.small_tree import parameters, START
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.jit.record import take_over
from masmc_ros.loop import records
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.driven_robots import DrivenRobots
from masmc_ros.loop.signals import OF_PLANT
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.plant_model.measurement import is_lost, newest, OF_COMMAND, OF_MEASUREMENT
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PAPER = str(ROOT / 'config' / 'paper.yaml')
CALM = (
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    'plant.torque_limit=[0.0, 0.0, 0.0, 0.0]',
    'plant.torque_rate_limit=0.0',
)
GENTLE = 'controller.k_s1=20.0', 'controller.k_s2=0.0'
EVERYTHING = (
    'duration=0.2',
    'plant.measurement_delay=0.003',
    'plant.command_delay=0.004',
    'plant.delay_jitter=0.5',
    'plant.measurement_loss=0.1',
    'plant.command_loss=0.1',
    'plant.motor_lag=[0.005, 0.005, 0.0, 0.002]',
    'plant.stiction.torque=[0.2, 0.0, 0.4, 0.3]',
    'plant.joint_stiffness=[0.0, 500.0, 2000.0, 1000.0]',
    'plant.joint_damping=0.5',
    'plant.encoder_resolution=0.0001',
    'plant.measures_velocity=false',
    'controller.velocity_source=estimated',
    'controller.observer_gain=0.02',
    *GENTLE,
)


def planar(*settings: str) -> SimulatedRobot:
    """Return the paper's robot without disturbance and limits."""
    return plant_of(load_scenario(PAPER, (*CALM, *settings))['plant'], 0.001)


def applied(plant: SimulatedRobot, commands: Array) -> Array:
    """Return the torques (n, joints) that the motors apply under commands (n, joints)."""
    torques = np.empty_like(commands)
    for k, command in enumerate(commands):
        plant.advance(command)
        torques[k] = plant.applied
    return torques


# Compiled code with and without effects of motors and joints.


COMMANDS = np.random.default_rng(1).uniform(-0.5, 0.5, (30, 4))


def test_robot_without_effects_equals_code_with_effects() -> None:
    plain, general = planar(), planar()
    settings = records.plant_settings(general.mechanism, has_effects=True)
    assert settings.dtype != plain.settings.dtype
    take_over(settings, general.settings)
    general.settings = settings
    np.testing.assert_array_equal(applied(general, COMMANDS), applied(plain, COMMANDS))
    assert general.signals.tobytes() == plain.signals.tobytes()


@pytest.mark.slow
def test_driven_robot_with_effects_starts_later() -> None:
    base, lagging = (
        load_scenario(PAPER, (*CALM, *effects)) for effects in ((), ('plant.motor_lag=0.005',))
    )
    robots = DrivenRobots(
        base, 2, path=np.zeros((90, 12)), window=(0, 90), settling=np.array([0.1, 0.01])
    )
    robots.start({0: base})
    for command in COMMANDS:
        robots.step(np.array([command, command]), np.array([True, False]))
    robots.start({1: lagging})
    for command in COMMANDS:
        robots.step(np.array([command, command]), np.array([True, True]))
    for lane, (values, ticks) in enumerate(((base, 2), (lagging, 1))):
        plant = plant_of(values['plant'], 0.001)
        applied(plant, np.tile(COMMANDS, (ticks, 1)))
        for name in OF_PLANT:
            np.testing.assert_array_equal(
                robots.signals[name][0, ..., lane], plant.signals[name][0, ..., 0], err_msg=name
            )


# Delays.


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.integers(0, 20), st.integers(0, 1))
def test_newest_value_is_in_order_and_within_jitter(
    seed: int, largest: int, span: int, stream: int
) -> None:
    span, last = min(span, largest), 0
    for tick in range(60):
        arrived = newest(seed, tick, stream, largest, span, last)
        assert arrived >= last
        assert max(tick - largest, 0) <= arrived <= max(tick - largest + span, last)
        last = arrived


def test_jitter_draws_all_delays_of_its_range() -> None:
    ages = {k - newest(3, k, 0, 9, 4, 0) for k in range(20, 400)}
    assert ages == {5, 6, 7, 8, 9}


def test_command_delay_applies_earlier_command() -> None:
    commands = np.arange(80.0).reshape(20, 4) / 80.0
    torques = applied(planar('plant.command_delay=0.003'), commands)
    np.testing.assert_array_equal(torques[3:], commands[:-3])
    np.testing.assert_array_equal(torques[:3], commands[:1].repeat(3, axis=0))


def test_command_delay_after_void_command_starts_again() -> None:
    plant = planar('plant.command_delay=0.003')
    applied(plant, np.ones((5, 4)))
    plant.advance(None)
    assert not plant.applied.any()
    torques = applied(plant, np.array([[0.5] * 4, [0.6] * 4]))
    np.testing.assert_array_equal(torques, np.full((2, 4), 0.5))


# Payload.


def test_later_payload_changes_robot_from_its_tick_on() -> None:
    mass = 'plant.payload.mass=0.5'
    without, later, loaded = (
        planar(*settings) for settings in ((), (mass, 'plant.payload.time=0.003'), (mass,))
    )
    for _ in range(2):
        command = np.ones(4)
        for tick in range(5):
            np.testing.assert_array_equal(later.position, without.position)
            is_loaded = tick >= 3
            theta = (loaded if is_loaded else without).settings['theta']
            for plant in (without, later):
                plant.advance(command)
            np.testing.assert_array_equal(later.settings['theta'], theta)
            assert (later.velocity == without.velocity).all() != is_loaded
            if is_loaded:
                break
        later.reset()
        without.reset()


def test_later_payload_run_in_blocks_equals_run_tick_by_tick() -> None:
    settings = 'duration=0.2', 'plant.payload.mass=0.5', 'plant.payload.time=0.1', *GENTLE
    simulation = Simulation(load_scenario(PAPER, settings))
    (whole,) = simulation.run()
    blocks = list(simulation.run(block=70))
    plant = plant_of(load_scenario(PAPER, settings)['plant'], 0.001)
    for k, torque in enumerate(whole.torque):
        np.testing.assert_array_equal(plant.position, whole.position[k])
        plant.advance(torque)
    np.testing.assert_array_equal(np.vstack([b.position for b in blocks]), whole.position)


def test_later_payload_in_batch_raises() -> None:
    run = load_scenario(PAPER, ('plant.payload.mass=0.5', 'plant.payload.time=0.1'))
    with pytest.raises(InputError, match=r'payload.time = 0.1: expected 0 for runs in one batch'):
        BatchSimulation([run])


def test_measurement_jitter_state_has_reported_age() -> None:
    settings = 'duration=0.3', 'plant.measurement_delay=0.004', 'plant.delay_jitter=0.5'
    (run,) = Simulation(load_scenario(PAPER, (*settings, 'controller.k_s2=0'))).run()
    ages = run.signals['age'][:, 0]
    assert set(ages[10:]) == {2, 3, 4, 5, 6}
    for k in range(10, len(ages)):
        np.testing.assert_array_equal(run.position[k], run.true_position[k - ages[k]])


# Lost messages.


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.1, 0.5, 0.9]), st.integers(0, 1))
def test_losses_have_their_probability_and_are_independent(
    seed: int, probability: float, stream: int
) -> None:
    ticks, p = 4000, probability
    lost = np.array([is_lost(seed, k, stream, p) for k in range(ticks)])
    assert abs(lost.mean() - p) < 6.0 * math.sqrt(p * (1.0 - p) / ticks)
    # Pairs that share a tick are correlated.
    pairs = (p**2 * (1.0 - p**2) + 2.0 * (p**3 - p**4)) / ticks
    assert abs((lost[1:] & lost[:-1]).mean() - p**2) < 8.0 * math.sqrt(pairs)


def test_losses_of_probability_zero_keep_the_bits() -> None:
    late = 'plant.command_delay=0.002', 'plant.measurement_delay=0.001'
    ideal, late_only = planar(), planar(*late)
    other_lane = planar(*late, 'plant.measurement_loss=0.3', 'plant.command_loss=0.3')
    commands = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 4))
    assert not any(is_lost(5, k, OF_COMMAND, 0.0) for k in range(500))
    np.testing.assert_array_equal(applied(ideal, commands), commands)
    torques = applied(late_only, commands)
    np.testing.assert_array_equal(torques[2:], commands[:-2])
    assert (applied(other_lane, commands) != torques).any()


@pytest.mark.parametrize('delay', [0, 3])
def test_lost_command_repeats_the_one_before(delay: int) -> None:
    commands = np.arange(400.0).reshape(100, 4) / 400.0
    settings = f'plant.command_delay={1e-3 * delay}', 'plant.seed=7', 'plant.command_loss=0.4'
    torques = applied(planar(*settings), commands)
    lost = [k > 0 and is_lost(7, k, OF_COMMAND, 0.4) for k in range(100)]
    assert 20 < np.sum(lost) < 60
    expected = 0
    for k in range(100):
        expected = expected if lost[k] else max(k - delay, expected)
        np.testing.assert_array_equal(torques[k], commands[expected])


def test_command_loss_after_void_command_applies_the_first_one() -> None:
    plant = planar('plant.command_loss=1.0')
    np.testing.assert_array_equal(applied(plant, np.ones((3, 4))), np.ones((3, 4)))
    plant.advance(None)
    torques = applied(plant, np.array([[0.5] * 4, [0.6] * 4]))
    np.testing.assert_array_equal(torques, np.full((2, 4), 0.5))


@pytest.mark.parametrize('delay', [0.0, 0.004])
def test_lost_measurement_repeats_the_one_before(delay: float) -> None:
    settings = 'plant.measurement_loss=0.3', f'plant.measurement_delay={delay}', 'plant.seed=3'
    (run,) = Simulation(load_scenario(PAPER, ('duration=0.3', *settings, *GENTLE))).run()
    ages = run.signals['age'][:, 0]
    assert ages.max() > round(1e3 * delay) + 2
    for k in range(1, len(ages)):
        np.testing.assert_array_equal(run.position[k], run.true_position[k - ages[k]])
        if is_lost(3, k, OF_MEASUREMENT, 0.3):
            assert ages[k] == ages[k - 1] + 1
        else:
            assert ages[k] <= round(1e3 * delay)


# Motors.


@pytest.mark.parametrize('lag', [0.001, 0.005, 0.1])
def test_motor_lag_step_response_equals_solution(lag: float) -> None:
    plant, command = planar(f'plant.motor_lag={lag}'), np.array([0.1, 0.1, 0.5, -0.2])
    # Mean of 1 - exp(-t / lag) over each period.
    ends = np.arange(51) * 0.001
    integral = ends + lag * np.exp(-ends / lag)
    torques = applied(plant, np.tile(command, (50, 1)))
    expected = np.diff(integral)[:, None] / 0.001 * command
    np.testing.assert_allclose(torques, expected, rtol=1e-9, atol=1e-12)


def test_motor_lag_robot_moves_as_under_lagging_command() -> None:
    """A lag is the same as a command that follows it in small steps."""
    lag, command = 0.01, np.array([0.2, 0.1, 0.4, 0.1])
    lagging, other = planar(f'plant.motor_lag={lag}'), planar()
    for k in range(100):
        lagging.advance(command)
        middle = 0.001 * (k + 0.5)
        other.advance(command * (1.0 - math.exp(-middle / lag)))
    np.testing.assert_allclose(lagging.true_position, other.true_position, rtol=1e-3, atol=1e-6)


def test_motor_lag_holding_drives_come_to_rest() -> None:
    plant = planar('plant.motor_lag=0.005', 'plant.initial_velocity=[1.0, 0.5, 0.4, -0.3]')
    for _ in range(1000):
        plant.advance(None)
    assert np.abs(plant.true_velocity).max() < 1e-3


# Stiction.


def test_stiction_holds_joint_until_its_level() -> None:
    assert_sticks(planar('plant.stiction.torque=[5.0, 5.0, 1.0, 1.0]'))


def assert_sticks(plant: SimulatedRobot) -> None:
    """Assert that joint 3 rests under 0.8 N·m, starts before 1.3 N·m."""
    start = plant.true_position[3:].copy()
    applied(plant, np.linspace(0.0, 0.8, 1000)[:, None] * [0.0, 0.0, 1.0, 0.0])
    assert np.abs(plant.true_position[3:] - start)[2:].max() < 2e-3
    applied(plant, np.linspace(0.8, 1.3, 1000)[:, None] * [0.0, 0.0, 1.0, 0.0])
    assert plant.true_position[5] - start[2] > 0.1


# All together.


def test_measures_velocity_false_reports_zero_velocities() -> None:
    plant = planar('plant.measures_velocity=false')
    applied(plant, np.ones((5, 4)))
    assert not plant.velocity.any()
    assert plant.true_velocity.any()


def test_measures_velocity_false_with_measured_source_raises() -> None:
    with pytest.raises(InputError, match='velocity_source'):
        Simulation(load_scenario(PAPER, ('plant.measures_velocity=false',)))


@pytest.mark.slow
def test_all_effects_tick_by_tick_equals_whole_run_and_lane() -> None:
    values = load_scenario(PAPER, EVERYTHING)
    (whole,) = Simulation(values).run()
    single = Simulation(values)
    plant, controller = single.plant, single.controller
    for k in range(len(whole.torque)):
        np.testing.assert_array_equal(plant.position, whole.position[k])
        np.testing.assert_array_equal(plant.applied, whole.applied[k])
        controller.tick(plant.position, plant.velocity, whole.reference[k])
        np.testing.assert_array_equal(controller.torque, whole.torque[k])
        plant.advance(controller.torque)
    ideal = load_scenario(PAPER, ('duration=0.2',))
    (alone,) = Simulation(ideal).run()
    for run, lane in zip((whole, alone), (0, 1), strict=True):
        (together,) = BatchSimulation([values, ideal]).run()
        for name in ('true_position', 'torque', 'applied', 'age'):
            expected = run.signals[name][..., 0]
            np.testing.assert_array_equal(together[name][..., lane], expected, err_msg=name)


def test_all_effects_reset_repeats_run_exactly() -> None:
    again = Simulation(load_scenario(PAPER, EVERYTHING))
    one, other = (next(iter(again.run())) for _ in range(2))
    np.testing.assert_array_equal(one.true_position, other.true_position)
    np.testing.assert_array_equal(one.applied, other.applied)


def contact_robot(*settings: str) -> Any:
    pytest.importorskip('mujoco')
    return planar('plant.physics=mujoco', *settings)


@pytest.mark.slow
def test_contact_robot_motor_lag_and_delay_apply() -> None:
    plant = contact_robot('plant.motor_lag=0.005', 'plant.command_delay=0.002')
    command = np.array([0.1, 0.1, 0.5, -0.2])
    plant.advance(0.0 * command)
    ends = np.arange(49) * 0.001
    expected = np.diff(ends + 0.005 * np.exp(-ends / 0.005))[:, None] / 0.001 * command
    torques = applied(plant, np.tile(command, (50, 1)))
    assert not torques[:2].any()
    np.testing.assert_allclose(torques[2:], expected, rtol=1e-9)


@pytest.mark.slow
def test_contact_robot_stiction_holds_joint_until_its_level() -> None:
    assert_sticks(contact_robot('plant.stiction.torque=[5.0, 5.0, 1.0, 1.0]'))


@pytest.mark.slow
def test_tree_motor_lag_and_stiction_apply() -> None:
    values = parameters()
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(values))}
    joints = {'initial_joints': START, 'disturbance.amplitude': (0.0,) * 7}
    # Levels with which stiction carries the weight of the arm.
    levels = (2.0, 2.0, 2.0, 150.0, 60.0, 20.0, 5.0)
    effects = {'motor_lag': (0.005,) * 7, 'stiction.torque': levels}
    plant = plant_of({**defaults, **values, **joints, **effects}, 0.001)
    command = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 0.0])
    ends = np.arange(101) * 0.001
    expected = np.diff(ends + 0.005 * np.exp(-ends / 0.005))[:, None] / 0.001 * command
    np.testing.assert_allclose(applied(plant, np.tile(command, (100, 1))), expected, rtol=1e-9)
    start = plant.true_position[3:].copy()
    applied(plant, np.tile(command, (500, 1)))
    assert np.abs(plant.true_position[3:] - start).max() < 2e-3
    applied(plant, np.tile(5.0 * command, (500, 1)))
    assert plant.true_position[5] - start[2] > 0.1
