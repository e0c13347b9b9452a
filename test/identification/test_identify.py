# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Identification of robots with known parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from helpers.moved_robot import computed, PERIOD, series, simulated
from helpers.robots import Machine, machines
from helpers.small_tree import parameters as small_tree
from helpers.small_tree import START
from hypothesis import given, Phase, settings
from hypothesis import strategies as st
from masmc_ros.aliases import Array
from masmc_ros.identification.consistent_parameters import (
    is_consistent,
    nearest_consistent,
    scaled,
)
from masmc_ros.identification.excitation import Series
from masmc_ros.identification.identify import (
    base_parameters,
    Identified,
    identify,
    measured,
    Nominal,
    relative_error,
    unexcited,
)
from masmc_ros.identification.latency_fit import Estimate, LatencyFit
from masmc_ros.identification.parameter_file import (
    nominal_of,
    of_its_kind,
    unwritten_timing,
    write_identified,
)
from masmc_ros.identification.payload import payload_of
from masmc_ros.robot.mechanisms import DEFAULT as PLANAR
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

FOUR = np.array([0.0, 0.0, 0.8, -1.5])
"""Start of the planar robot's joints."""

FRICTION = np.array([0.02, 0.03, 0.3, 0.2, 0.05, 0.04, 0.5, 0.3])


def planar(machine: Machine | None = None) -> Robot:
    values = {p.name: p.default for p in PLANAR.parameters}
    if machine is not None:
        values |= {f'robot.{name}': value for name, value in machine.physical.items()}
    return robot_of(values)


def relative(values: Array, true: Array) -> float:
    return float(np.abs(values / true - 1.0).max())


def base_error(robot: Robot, result: Identified, true: Array) -> float:
    """Return the largest error of the base parameters, in parts of the nominal robot."""
    base = base_parameters(robot, result.scale)
    error = np.linalg.solve(result.scale.scale, result.values - true)
    return float(np.abs(base.T @ error).max())


NO_SHRINKING = (Phase.explicit, Phase.reuse, Phase.generate)
"""Shrinking of an example takes minutes, and makes it no clearer."""


@pytest.mark.slow
@settings(max_examples=10, deadline=None, phases=NO_SHRINKING)
@given(machine=machines(), seed=st.integers(0, 1000))
def test_identify_planar_random_robots_found(machine: Machine, seed: int) -> None:
    robot = planar(machine)
    true = np.concatenate([robot.theta, FRICTION])
    motion = series(FOUR, seed, 12.0, np.array([2.0, 2.0, 0.5, 0.5]))
    run = measured(robot, computed(robot, true, motion, latency=3))
    result = identify(Nominal(robot, 0.6 * robot.theta, np.zeros(8)), run)
    # A parameter may be zero.
    assert (np.abs(result.values - true) < 0.01 * np.abs(true) + 1.0e-3 * true.max()).all()
    assert result.timing.total.value == pytest.approx(3.0 * PERIOD, abs=2.0e-4)


def test_identify_encoders_without_velocities() -> None:
    robot = planar()
    true = np.concatenate([robot.theta, FRICTION])
    motion = series(FOUR, 5, 20.0, np.array([2.0, 2.0, 0.5, 0.5]))
    run = measured(robot, computed(robot, true, motion, latency=4, encoder=1.0e-4))
    result = identify(Nominal(robot, 0.5 * robot.theta, np.zeros(8)), run)
    assert relative(result.values[:7], true[:7]) < 0.02
    assert result.timing.total.value == pytest.approx(4.0 * PERIOD, abs=5.0e-4)
    errors = np.abs(result.values - true) / result.errors
    assert np.median(errors) < 3.0


def test_identify_joint_at_rest_named_as_not_excited() -> None:
    robot = planar()
    true = np.concatenate([robot.theta, FRICTION])
    motion = series(FOUR, 5, 12.0, np.array([2.0, 2.0, 0.5, 0.0]))
    run = measured(robot, computed(robot, true, motion))
    result = identify(Nominal(robot, 0.5 * robot.theta, np.zeros(8)), run)
    names = {name for d in unexcited(result, base_parameters(robot, result.scale))
             for name in d.names}  # fmt: skip
    assert 'arm_joint_2_viscous' in names
    assert 'mass' not in names
    at = result.names.index('arm_joint_2_viscous')
    assert not result.is_excited[at]
    assert result.values[at] == pytest.approx(0.0, abs=1.0e-6)


@pytest.fixture(scope='module')
def late() -> tuple[Nominal, Identified]:
    """Return the planar robot and its identification with a latency of 150 ms."""
    robot = planar()
    true = np.concatenate([robot.theta, FRICTION])
    motion = series(FOUR, 5, 10.0, np.array([2.0, 2.0, 0.5, 0.5]))
    nominal = Nominal(robot, robot.theta, FRICTION)
    return nominal, identify(nominal, measured(robot, computed(robot, true, motion, latency=75)))


def test_identify_latency_beyond_range_not_written(late: tuple[Nominal, Identified]) -> None:
    timing = late[1].timing
    assert timing.total.value == pytest.approx(75.0 * PERIOD, abs=2.0e-4)
    assert 'not written; expected at most 100 ms each' in unwritten_timing(timing)


@pytest.mark.parametrize(
    ('latency', 'lag', 'is_written'),
    [(0.1, 0.1, True), (0.0184, 0.1316, False), (0.1001, 0.0, False)],
)
def test_identified_file_always_accepted_by_controller(
    late: tuple[Nominal, Identified], latency: float, lag: float, is_written: bool, tmp_path: Path
) -> None:
    nominal, result = late
    timing = LatencyFit(*(Estimate(value, 1.0e-4) for value in (latency, lag, latency + lag)))
    file = tmp_path / 'identified.yaml'
    write_identified(file, nominal, replace(result, timing=timing), 'run.mcap')
    written = load_scenario(str(file))['controller']
    expected = (latency, lag) if is_written else (0.0, 0.0)
    assert (written['latency'], written['motor_lag']) == expected
    reason = unwritten_timing(timing)
    assert bool(reason) != is_written
    assert reason in file.read_text()


def test_payload_planar_mass_and_place_found() -> None:
    robot = planar()
    mass, place = 0.8, 0.362
    theta = robot.theta_with_payload(mass, np.zeros(3), np.zeros(6))
    loaded = np.concatenate([theta, FRICTION])
    motion = series(FOUR, 5, 12.0, np.array([2.0, 2.0, 0.5, 0.5]))
    run = measured(robot, computed(robot, loaded, motion, latency=2))
    nominal = Nominal(robot, robot.theta, FRICTION)
    payload = payload_of(nominal, robot.payload_factors, run, identify(nominal, run))
    assert payload.is_significant
    assert payload.load.mass == pytest.approx(mass, rel=0.01)
    assert payload.load.centre[0] == pytest.approx(place, rel=0.01)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.floats(0.1, 5.0))
def test_nearest_consistent_positive_definite(seed: int, size: float) -> None:
    robot = planar()
    scale = scaled(robot, robot.theta, FRICTION, np.ones(8))
    random = np.random.default_rng(seed)
    target = size * random.standard_normal(len(scale.nominal))
    root = random.standard_normal((len(target), len(target)))
    metric = root @ root.T + np.eye(len(target))
    nearest = nearest_consistent(scale, target, metric)
    least = min(np.linalg.eigvalsh(entry.matrix(nearest))[0] for entry in scale.inequalities)
    assert least > 5.0e-5
    assert scale.parameters(nearest)[7:].min() > -1.0e-6
    if is_consistent(scale, target):
        assert (nearest == target).all()
    # The solver is accurate to 1e-8 of the cost: the nominal robot is not nearer, and none that is
    # a tenth of the way closer to the target is consistent.
    def cost(y: Array) -> float:
        return float((y - target) @ metric @ (y - target))

    assert cost(nearest) <= cost(np.zeros(len(target))) * (1.0 + 1.0e-6)
    other = nearest + 0.1 * (target - nearest)
    assert not is_consistent(scale, other) or cost(nearest) < 1.0e-6 * np.abs(metric).max()


@settings(max_examples=30)
@given(machine=machines(), factor=st.floats(0.6, 1.6))
def test_values_planar_have_base_parameters(machine: Machine, factor: float) -> None:
    robot = planar(machine)
    theta = factor * robot.theta
    values = of_its_kind(robot, 'values_of')(robot, theta)
    assert np.allclose(robot_of({**values}).theta, theta, rtol=1.0e-9, atol=1.0e-12)


def changed(theta: Array, seed: int) -> Array:
    """Return the parameters of a tree with bodies that are up to half heavier or lighter."""
    factors = np.random.default_rng(seed).uniform(0.5, 1.5, len(theta) // 10)
    return theta * np.repeat(factors, 10)


def tree(**own: Any) -> Nominal:
    return nominal_of({**small_tree(), 'model_scale': 1.0, **own})


def test_values_tree_description_has_inertial_parameters() -> None:
    nominal = tree()
    theta = changed(nominal.theta, 3)
    values = of_its_kind(nominal.robot, 'values_of')(nominal.robot, theta)
    again = nominal_of(values)
    assert np.allclose(again.theta, theta, rtol=1.0e-9, atol=1.0e-12)
    assert np.allclose(again.robot.geometry, nominal.robot.geometry, atol=1.0e-12)


@pytest.mark.slow
def test_identify_tree_random_robots_found(tmp_path: Path) -> None:
    nominal = tree()
    robot, start = nominal.robot, np.array(START)
    joints = len(start)
    for seed in range(3):
        friction = np.random.default_rng(seed).uniform(0.1, 1.0, 2 * joints)
        true = np.concatenate([changed(nominal.theta, seed), friction])
        motion = series(start, seed, 20.0, np.array([2.0, 2.0, 0.7, 0.2, 0.7, 0.7, 0.7]))
        run = measured(robot, computed(robot, true, motion, latency=3))
        result = identify(nominal, run)
        assert base_error(robot, result, true) < 0.01
        assert result.timing.total.value == pytest.approx(3.0 * PERIOD, abs=2.0e-4)
        assert (result.residual < 1.0e-3).all()
        assert unexcited(result, base_parameters(robot, result.scale)) == []
    # The file has no task: that of the exciting motion would replace the one of the path.
    file = tmp_path / 'identified.yaml'
    write_identified(file, tree(**{'robot.task': ('joints',)}), result, 'run.mcap')
    written = load_scenario(str(file))['controller']
    assert written['robot.task'] == ('pose',)
    assert base_error(robot, result, np.concatenate([nominal_of(written).theta, friction])) < 0.01


@pytest.mark.slow
def test_identify_tiago_unseen_motion_predicted() -> None:
    """Friction, a motor lag of 4 ms and a latency of 5 ms; the nominal robot has half masses."""
    viscous = [0.1, 0.1, 20.0, 1.0, 1.0, 0.6, 0.5, 0.2, 0.1, 0.1]
    coulomb = [0.15, 0.15, 15.0, 1.0, 1.0, 0.6, 0.5, 0.2, 0.1, 0.1]
    plant = load_scenario('config/tiago.yaml', (
        'robot.friction=parameters',
        f'robot.viscous_friction={viscous}',
        f'robot.coulomb_friction={coulomb}',
        f'plant.disturbance.amplitude={[0.0] * 10}',
    ))['plant']  # fmt: skip
    gains = (
        np.array([2.0, 2.0, 4000.0, 100.0, 100.0, 50.0, 50.0, 10.0, 6.0, 6.0]),
        np.array([0.5, 0.5, 400.0, 10.0, 10.0, 4.0, 4.0, 0.5, 0.3, 0.3]),
    )
    start = np.array(plant['initial_joints'])
    amplitude = np.array([1.0, 1.0, 0.05] + [0.5] * 7)

    def moved(seed: int, duration: float) -> Any:
        motion: Series = series(start, seed, duration, amplitude)
        return simulated(plant, motion, gains, latency=5, lag=0.004)

    nominal = nominal_of({**plant, 'robot.friction': 'none', 'model_scale': 0.5})
    result = identify(nominal, measured(nominal.robot, moved(1, 30.0)))
    assert result.timing.latency.value == pytest.approx(0.005, abs=5.0e-4)
    assert result.timing.lag.value == pytest.approx(0.004, abs=5.0e-4)
    unseen = measured(nominal.robot, moved(2, 10.0))
    torque = unseen.torque(result.timing.latency.value, result.timing.lag.value)
    assert (relative_error(torque, unseen.predicted(result.values)) < 0.03).all()
    assert (relative_error(torque, unseen.predicted(result.nominal)) > 0.3).all()
