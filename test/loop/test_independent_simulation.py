# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled closed loop against an independent simulation and measured accuracies."""

from __future__ import annotations

from dataclasses import replace
import math

from helpers.independent_simulation import base_parameters, Simulator
from helpers.lagrangian import matrices
from helpers.robots import Array, DEFAULT, Machine
from helpers.scenario import PAPER_LAWS, Scenario, whole
from masmc_ros.law.registry import SWITCHING
import numpy as np
import pytest

KINDS = [
    *((law, switching, 0.0) for law in PAPER_LAWS for switching in SWITCHING),
    ('smc', 'implicit', 0.5),
    ('rasmc', 'implicit', 1.0),
]
COMPILED_KINDS = [
    pytest.param(*kind, marks=pytest.mark.slow if kind[1] in ('saturation', 'sigmoid') else ())
    for kind in KINDS
]
DURATION = 0.3


def random_robot(rng: np.random.Generator) -> Machine:
    """Return the default robot with varied parameters and a centre of mass off the axle."""
    p = {name: value * rng.uniform(0.6, 1.6) for name, value in DEFAULT.items()}
    p['com_offset'] = rng.uniform(-0.06, 0.12)
    p['arm_offset'] = rng.uniform(0.1, 0.3) - p['com_offset']
    p['wheel_yaw_inertia'] = rng.uniform(0.0, 0.005)
    p['link_1_com'] = p['link_1_length'] * rng.uniform(0.2, 0.8)
    p['link_2_com'] = p['link_2_length'] * rng.uniform(0.2, 0.8)
    return Machine(p)


def random_scenario(law: str, switching: str, observer_gain: float, seed: int) -> Scenario:
    """Draw a run that starts near its reference, with gains suited to its period."""
    rng = np.random.default_rng([seed, PAPER_LAWS.index(law), SWITCHING.index(switching)])
    robot = random_robot(rng)
    pose = rng.uniform(-2.0, 2.0, 3)
    joints = rng.uniform(-2.0, 2.0, 4)
    joints[3] = rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 2.2)
    rates = rng.uniform(-0.5, 0.5, 4)
    m = matrices(robot.physical, np.concatenate([pose, joints]), rates)
    inverse = np.linalg.inv(m.jacobian)
    least_inertia = np.linalg.eigvalsh(inverse.T @ m.reduced_inertia @ inverse)[0]
    period = float(rng.choice([0.0005, 0.001, 0.002]))
    stiffness, layer = 0.2 * least_inertia / period, rng.uniform(0.1, 0.4)
    amplitude, frequency = rng.uniform(0.0, 0.05, 4), rng.uniform(0.5, 3.0, 4)
    phase = rng.uniform(-math.pi, math.pi, 4)
    start = m.task_position + rng.uniform(-0.02, 0.02, 4) - amplitude * np.sin(phase)
    return Scenario(
        law,
        switching,
        observer_gain,
        layer,
        rng.uniform(0.6, 1.4),
        robot,
        period,
        int(rng.integers(1, 4)),
        round(DURATION / period) + 1,
        rng.uniform(0.2, 1.0, 4) * stiffness,
        rng.uniform(0.2, 1.0, 4) * stiffness * layer,
        rng.uniform(0.5, 4.0, 4),
        rng.uniform(0.5, 5.0, 7),
        rng.uniform(-1.5, 1.5, 4),
        rng.uniform(0.5, 8.0, 4),
        rng.uniform(-math.pi, math.pi, 4),
        np.where(rng.uniform(size=4) < 0.5, 0.0, rng.uniform(0.5, 6.0, 4)),
        pose,
        joints,
        rates,
        np.array([start, m.jacobian @ rates * 0.5, amplitude, frequency, phase]),
    )


def with_robust_settings(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with limits and robust adaptation, each in about half of the runs."""
    rng = np.random.default_rng([seed, 1])
    wide = whole(replace(scenario, ticks=scenario.ticks // 4))
    largest = np.abs(wide.raw_torque).max(axis=0)
    steps = np.abs(np.diff(wide.raw_torque, axis=0)).max(axis=0) / scenario.period
    extra = {
        'torque_limit': np.where(rng.uniform(size=4) < 0.5, 0.0, 0.8 * largest),
        'torque_rate_limit': np.where(rng.uniform(size=4) < 0.5, 0.0, 0.7 * steps),
        'leakage': rng.choice([0.0, 2.0]),
        'e_modification': rng.choice([0.0, 5.0]),
        'dead_zone': rng.choice([0.0, 0.02]),
        'freeze_when_saturated': int(rng.integers(2)),
    }
    return replace(scenario, extra=tuple(extra.items()))


# One robot and path per seed; further seeds are slow.
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]


@pytest.mark.parametrize('seed', SEEDS[:3])
@pytest.mark.parametrize(('law', 'switching', 'observer_gain'), COMPILED_KINDS)
def test_closed_loop_every_law_matches_independent_simulation(
    law: str, switching: str, observer_gain: float, seed: int
) -> None:
    assert_agree(random_scenario(law, switching, observer_gain, seed))


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('switching', ['tanh', 'implicit'])
def test_closed_loop_limits_and_leakage_match_independent_one(switching: str, seed: int) -> None:
    assert_agree(with_robust_settings(random_scenario('rasmc', switching, 0.5, seed), seed))


def assert_agree(scenario: Scenario) -> None:
    """Assert that every tick of a run agrees with the independent simulation."""
    run, n = whole(scenario), scenario.ticks
    expected = Simulator(scenario).run()
    assert run.singular == 0
    assert_close(run.position[:n], expected.position, 1e-7, 'rad and m')
    assert_close(run.velocity[:n], expected.velocity, 1e-6, 'rad/s and m/s')
    assert_close(run.torque, expected.torque, 1e-4, 'N m')
    assert_close(run.estimate, expected.estimate, 1e-6, 'theta')


def assert_close(actual: Array, expected: Array, limit: float, unit: str) -> None:
    """Assert that trajectories agree, and report the first tick that differs."""
    difference = np.abs(actual - expected).max(axis=1)
    assert np.isfinite(expected).all()
    assert (difference <= limit).all(), (
        f'tick {np.argmax(difference > limit)}: {difference.max():.1e} {unit}'
    )


@pytest.mark.slow
def test_random_scenarios_exercise_limits_and_surfaces() -> None:
    """Across the drawn runs, torques are limited, surfaces are reached and estimates move."""
    clipped = moved = slid = 0
    for kind in KINDS:
        scenario = random_scenario(*kind, 0)
        run = whole(scenario)
        n = scenario.ticks
        clipped += bool((run.applied[1:n] != run.torque[: n - 1]).any())
        moved += bool((run.estimate[-1] != run.estimate[0]).all())
        slid += bool((np.abs(run.surface).min(axis=0) < 1e-3).all())
    assert clipped >= 4
    assert moved == sum(law == 'rasmc' for law, _, _ in KINDS)
    assert slid >= 4


def test_random_scenarios_with_limits_limit_the_torque() -> None:
    limited_runs = 0
    for seed in range(4):
        run = whole(with_robust_settings(random_scenario('rasmc', 'implicit', 0.5, seed), seed))
        share = (run.raw_torque != run.torque).any(axis=1).mean()
        limited_runs += 0.001 < share < 0.9
    assert limited_runs >= 2


def test_base_parameters_random_robots_match_independent_ones() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        robot = random_robot(rng)
        assert robot.theta == pytest.approx(base_parameters(robot.physical), rel=1e-13)


ACCURACY = {
    ('smc', 'sign', 0.0): (24.283, 0.774, 236554.0),
    ('smc', 'tanh', 0.0): (20.689, 39.566, 15.3),
    ('rasmc', 'tanh', 0.0): (6.486, 19.748, 11.6),
    ('smc', 'implicit', 0.0): (7.629, 1.483, 11.5),
    ('smc', 'implicit', 0.5): (0.0218, 0.0080, 11.4),
}
"""RMS error of E and of F in mm and total variation of the torques in N m/s, 10 <= t < 20 s."""

HALF_A_DIGIT = {
    ('smc', 'implicit', 0.5): (5e-5, 5e-5, 0.05),
    ('smc', 'sign', 0.0): (24.283 * 5e-3, 0.774 * 5e-3, 236554.0 * 5e-3),
}


@pytest.mark.parametrize(('law', 'switching', 'observer_gain'), ACCURACY)
def test_accuracy_paper_scenario_equals_measured_values(
    law: str, switching: str, observer_gain: float
) -> None:
    run = whole(Scenario(law, switching, observer_gain))
    half = slice(10_000, 20_000)
    error = 1e3 * run.error[half]
    rms = [math.sqrt((error[:, axes] ** 2).sum(axis=1).mean()) for axes in ([0, 1], [2, 3])]
    variation = np.abs(np.diff(run.torque[half], axis=0)).sum() / 10.0
    key = law, switching, observer_gain
    digits = HALF_A_DIGIT.get(key, (5e-4, 5e-4, 0.05))
    for actual, expected, tolerance in zip((*rms, variation), ACCURACY[key], digits, strict=True):
        assert actual == pytest.approx(expected, abs=1.001 * tolerance)
    assert run.singular == 0
