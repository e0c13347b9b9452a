# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Payload that is estimated from the states and torques of a running robot."""

from __future__ import annotations

from functools import cache
from typing import Any

from helpers.moved_robot import computed, PERIOD, series
from helpers.small_tree import parameters as small_tree
from helpers.small_tree import START
from masmc_ros.aliases import Array
from masmc_ros.identification.latency_fit import Estimate
from masmc_ros.identification.live_payload import (
    Block,
    BlockBuffer,
    described,
    PayloadEstimate,
    PayloadEstimator,
)
from masmc_ros.identification.parameter_file import nominal_of
from masmc_ros.identification.payload import Load
from masmc_ros.identification.samples import Samples
from masmc_ros.robot.mechanisms import DEFAULT as PLANAR
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

CENTRE = np.array([0.05, 0.02, 0.08])
FRICTION = 0.3
UR5_START = np.array([0.0, -1.2, 1.4, -1.8, -1.57, 0.0])


@cache
def planar() -> Robot:
    return robot_of({p.name: p.default for p in PLANAR.parameters})


@cache
def ur5() -> Robot:
    return robot_of(load_scenario('config/ur5.yaml', ())['controller'])


def motion(
    robot: Robot, mass: float, *, duration: float = 12.0, seed: int = 5, **options: Any
) -> Samples:
    """Return the samples of a robot with a payload and friction that is not in its model."""
    joints = len(robot.mechanism.joints)
    start, amplitude = UR5_START, np.full(joints, 0.3)
    if robot is planar():
        start, amplitude = np.array([0.0, 0.0, 0.8, -1.5]), np.array([2.0, 2.0, 0.5, 0.5])
    elif joints == len(START):
        start = np.array(START)
    theta = robot.theta_with_payload(mass, CENTRE, np.zeros(6))
    parameters = np.concatenate([theta, np.full(2 * joints, FRICTION)])
    return computed(robot, parameters, series(start, seed, duration, amplitude), **options)


def estimates(
    robot: Robot, samples: Samples, torque: Array, *, latency: float = 0.0, span: float = 10.0
) -> list[PayloadEstimate | None]:
    """Return the estimates after all blocks."""
    joints, positions = torque.shape[1], samples.position.shape[1]
    estimator = PayloadEstimator(
        robot, robot.theta, np.zeros(2 * joints), np.ones(joints, np.bool_), span
    )
    buffer, results = BlockBuffer(positions, joints, PERIOD), []
    uses_rates = not np.isnan(samples.velocity).any()
    for k, time in enumerate(samples.times):
        stamp = 1 + round(1e9 * time)
        block = buffer.add(stamp, samples.position[k], samples.velocity[k], torque[k])
        if block is not None:
            estimator.add(block, latency, uses_rates=uses_rates)
            results.append(estimator.estimate())
    return results


def picked_up(robot: Robot, mass: float, **options: Any) -> tuple[Samples, Array]:
    """Return samples and torques of a robot that picks up a mass in the middle."""
    without, loaded = (motion(robot, load, duration=24.0, **options) for load in (0.0, mass))
    middle = len(without.times) // 2
    return without, np.concatenate([without.commands[:middle], loaded.commands[middle:]])


def check_picked_up(robot: Robot, mass: float, determined: int, **options: Any) -> None:
    """Check the estimates before and after a mass is picked up, and the unknown latency."""
    samples, torque = picked_up(robot, mass, **options)
    results = estimates(robot, samples, torque)
    assert not any(result.is_significant for result in results[:12] if result is not None)
    for result in results[-8:]:
        assert result is not None
        assert result.is_significant
        assert result.load.mass == pytest.approx(mass, rel=0.01)
        assert abs(result.load.mass - mass) < 4.0 * result.load.mass_error
        np.testing.assert_allclose(result.centre[:determined], CENTRE[:determined], atol=2.0e-3)
        assert np.isnan(result.centre[determined:]).all()
        assert result.later.value == pytest.approx(options.get('latency', 0) * PERIOD, abs=1.0e-3)


def test_planar_pick_up_with_latency_and_encoders_found() -> None:
    check_picked_up(planar(), 0.8, 1, latency=4, encoder=1.0e-4)


@pytest.mark.slow
@pytest.mark.parametrize('options', [{}, {'latency': 5}, {'latency': 5, 'encoder': 1.0e-4}])
def test_ur5_pick_up_found(options: dict[str, Any]) -> None:
    check_picked_up(ur5(), 2.0, 3, **options)


@pytest.mark.slow
def test_tree_pick_up_found() -> None:
    robot = nominal_of({**small_tree(), 'model_scale': 1.0}).robot
    check_picked_up(robot, 0.5, 3, latency=3)


@pytest.mark.slow
def test_ur5_disturbance_torque_without_payload_not_reported() -> None:
    for seed in range(4):
        samples = motion(ur5(), 0.0, seed=seed)
        phases = np.outer(samples.times, [1.5, 2.0, 1.0, 3.0, 2.5, 1.5])
        phases += np.array([0.0, 1.0, 0.5, 0.3, 0.9, 2.0])
        torque = samples.commands - np.sin(phases) * [3.0, 3.0, 3.0, 0.6, 0.6, 0.6]
        results = estimates(ur5(), samples, torque)
        assert not any(result.is_significant for result in results if result is not None)


def force(robot: Robot, samples: Samples, axis: int, size: float) -> Array:
    """Return the torques (N, n) that balance a force in N on an axis of the task."""
    base, step = len(robot.mechanism.base), 1.0e-6
    start = robot.task_positions(samples.position)[:, axis]
    columns = []
    for joint in range(samples.commands.shape[1]):
        moved = samples.position.copy()
        moved[:, base + joint] += step
        columns.append((robot.task_positions(moved)[:, axis] - start) * size / step)
    return np.column_stack(columns)


@pytest.mark.slow
@pytest.mark.parametrize('axis', [0, 1])
def test_ur5_horizontal_force_not_reported(axis: int) -> None:
    samples = motion(ur5(), 0.0)
    torque = samples.commands + force(ur5(), samples, axis, 20.0)
    results = estimates(ur5(), samples, torque)
    assert not any(result.is_significant for result in results if result is not None)


@pytest.mark.slow
def test_ur5_vertical_force_is_reported_as_mass() -> None:
    samples = motion(ur5(), 0.0)
    torque = samples.commands + force(ur5(), samples, 2, 20.0)
    last = estimates(ur5(), samples, torque)[-1]
    # A documented limitation: slow motion does not distinguish it from a weight.
    assert last is not None
    assert last.is_significant
    assert last.load.mass == pytest.approx(20.0 / 9.81, rel=0.1)


def test_planar_disturbance_torque_without_payload_not_reported() -> None:
    for seed in range(3):
        samples = motion(planar(), 0.0, seed=seed)
        torque = samples.commands - np.sin(np.outer(samples.times, [1.5, 2.0, 1.0, 3.0]))
        results = estimates(planar(), samples, torque)
        assert not any(result.is_significant for result in results if result is not None)


def test_block_buffer_gap_starts_new_block() -> None:
    buffer = BlockBuffer(1, 1, 0.01)
    one = np.ones(1)
    stamps = [round(1e7 * k) for k in range(1, 260) if k not in (50, 51, 52)]
    ends = [stamp for stamp in stamps if buffer.add(stamp, one, one, one) is not None]
    assert ends == [round(1e7 * (53 + 100)), round(1e7 * (53 + 201))]
    assert buffer.add(5, one, one, one) is None


@pytest.mark.parametrize(('step', 'seconds', 'used'), [(5, 1.0, 10), (10, 2.0, 5), (20, 4.0, 3)])
def test_estimation_time_with_long_periods_in_real_time(
    step: int, seconds: float, used: int
) -> None:
    """Blocks of 10, 20 and 40 ms per state, and an estimation time of 10 s."""
    samples = motion(planar(), 0.8, duration=seconds * 1.02 * (used + 2))
    states = slice(None, None, step)
    arrays = (samples.position, samples.velocity, samples.commands)
    position, velocity, torque = (array[states] for array in arrays)
    joints = torque.shape[1]
    buffer = BlockBuffer(position.shape[1], joints, step * PERIOD)
    blocks: list[Block] = []
    for k, time in enumerate(samples.times[states]):
        block = buffer.add(1 + round(1e9 * time), position[k], velocity[k], torque[k])
        blocks += [] if block is None else [block]
    assert len(blocks) == used + 2
    assert blocks[0].times[-1] == pytest.approx(seconds)
    results = []
    for added in (blocks, blocks[-used:]):
        estimator = PayloadEstimator(
            planar(), planar().theta, np.zeros(2 * joints), np.ones(joints, np.bool_), 10.0
        )
        for block in added:
            estimator.add(block, 0.0)
        results.append(estimator.estimate())
    assert results[0] is not None
    assert results[1] is not None
    assert results[0].load.mass == results[1].load.mass


def estimate(mass: float, explained: float, error: float = 0.05) -> PayloadEstimate:
    centre_error = np.array([0.01, 0.002, 0.5])
    load = Load(mass, error, np.array([0.1, -0.0001, 0.9]), centre_error)
    return PayloadEstimate(load, explained, Estimate(0.0, 0.001))


@pytest.mark.parametrize(
    ('value', 'announced', 'text'),
    [
        (None, 0.0, 'not known yet; expected 3 s of control, 300 periods if that is longer'),
        (estimate(0.01, 0.1), 0.0, 'none: 0.010 ± 0.050 kg'),
        (estimate(0.01, 0.1), 2.0, 'ros2 param set /controller payload.mass 0.0'),
        (estimate(2.0, 0.4), 0.0, 'not determined: 2.000 ± 0.050 kg would explain 40 %'),
        (estimate(2.0, 0.99), 2.1, '2.000 ± 0.050 kg at (0.100, 0.000, ?)'),
        (estimate(2.0, 0.99), 0.0, 'payload.com "[0.100, 0.000, 0.000]"; ros2 param set'),
    ],
)
def test_described_payload(value: PayloadEstimate | None, announced: float, text: str) -> None:
    result = described(value, announced, tip='tool0', node='/controller')
    assert text in result
    assert result.endswith('; announced') == (announced == 2.1)
