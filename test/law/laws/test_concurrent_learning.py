# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Concurrent learning: formulas of record and update, and behaviour without excitation."""

from __future__ import annotations

from dataclasses import replace

from helpers.dense_regressor import regressor, THETA
from helpers.law_bench import at_random, Instant, PAPER, run, tick
from helpers.robots import Array
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.adaptive.concurrent_learning import POINTS, smallest_eigenvalue
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

LAW = 'concurrent_learning'

EXCITED = (
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.slope=[0.0, 0.0, 0.0, 0.0]',
    'trajectory.line_sine.amplitude=[0.1, 0.15, 0.1, 0.1]',
    'trajectory.line_sine.frequency=[3.0, 2.0, 1.0, 1.7]',
)
"""Motion that excites every parameter, without a disturbance."""


def weakest(points: list[Array], gamma: Array) -> float:
    """Return the smallest eigenvalue of Gamma^-1 A, by the compiled code for the same ties."""
    value: float = smallest_eigenvalue(sum(g.T @ g for g in points), tuple(gamma))
    return value


def record(points: list[tuple[Array, Array]], new: tuple[Array, Array], gamma: Array) -> None:
    """Put a point (G, y) into the stack if it improves it."""
    rows = [g for g, _ in points]
    if len(points) < POINTS:
        distances = [((new[0] - g) ** 2).sum() for g in rows]
        if min(distances, default=np.inf) > 0.05 * (new[0] ** 2).sum():
            points.append(new)
        return
    values = [weakest([*rows[:k], new[0], *rows[k + 1:]], gamma) for k in range(POINTS)]
    if max(values) > weakest(rows, gamma) * (1.0 + 1e-9):
        points[int(np.argmax(values))] = new


@pytest.mark.parametrize('seed', range(20))
def test_concurrent_learning_update_matches_formula(seed: int) -> None:
    """Implicit Euler for the recorded data: (Gamma + T kappa A) d = T kappa (b - A theta)."""
    rng = np.random.default_rng(seed)
    gamma, kappa, fading = rng.uniform(0.5, 5.0, 7), rng.uniform(0.1, 50.0), rng.uniform(0.0, 5.0)
    controller, at = at_random(
        seed,
        LAW,
        gamma=tuple(gamma),
        **{f'{LAW}__kappa': kappa, f'{LAW}__forgetting': fading, f'{LAW}__interval': 0.001},
    )
    theta = at.scale * THETA
    points: list[tuple[Array, Array]] = []
    before = None
    for _ in range(POINTS + 8):
        result = tick(controller, at)
        if before is not None:
            v, torque = before
            middle = 0.5 * (at.v + v)
            w = regressor(at.position, middle, middle, (at.v - v) / at.period)
            root = np.linalg.cholesky(at.inertia)
            kept = 1.0 / (1.0 + 0.5 * at.period * fading)
            points[:] = [(kept * g, kept * y) for g, y in points]
            new = np.linalg.solve(root, w), np.linalg.solve(root, torque)
            record(points, new, gamma)
        y = regressor(at.position, at.v, *at.reference)
        u = -100.0 * at.surface - 100.0 * np.tanh(at.surface / 0.2)
        np.testing.assert_allclose(result, y @ theta + at.jacobian.T @ u, rtol=1e-6, atol=1e-6)
        information = sum((g.T @ g for g, _ in points), np.zeros((7, 7)))
        vector = sum((g.T @ f for g, f in points), np.zeros(7))
        weight = at.period * kappa
        moved = np.linalg.solve(
            np.diag(gamma) + weight * information, weight * (vector - information @ theta)
        )
        tracking = y.T @ np.linalg.solve(at.jacobian, at.surface)
        theta = theta + moved - at.period * tracking / gamma
        np.testing.assert_allclose(controller.estimate, theta, rtol=1e-6, atol=1e-6)
        before = at.v, result
        v = at.v + 0.01 * rng.normal(size=4)
        at = Instant(at.period, at.position, v, at.desired, at.scale, at.sigma)


@pytest.mark.parametrize('seed', range(20))
def test_smallest_eigenvalue_equals_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(0.5, 5.0, 7)
    rows = rng.normal(size=(9, 7)) * 10.0 ** rng.uniform(-2.0, 2.0, 7)
    matrix, scale = rows.T @ rows, np.sqrt(gamma)
    scaled = matrix / np.outer(scale, scale)
    value = smallest_eigenvalue(matrix, tuple(gamma))
    expected = np.linalg.eigvalsh(scaled)[0]
    assert abs(value - expected) < 1e-3 * expected + 2e-12 * np.trace(scaled)


@pytest.mark.slow
def test_concurrent_learning_disturbance_ends_bias_vanishes() -> None:
    """Points recorded under a disturbance are replaced after it, and theta_hat converges."""
    values = load_scenario(
        PAPER,
        (
            f'controller.law={LAW}',
            f'controller.{LAW}.kappa=30.0',
            f'controller.{LAW}.forgetting=0.2',
            *EXCITED,
            'duration=14.0',
        ),
    )
    reference = next(Simulation(values).run(block=10**6)).reference
    single = Simulation(values)
    plant, controller = single.plant, single.controller
    wrong = []
    for k in range(14000):
        controller.tick(plant.position, plant.velocity, reference[k])
        pushed = np.array([0.5, 0.5, 1.0, 1.0]) if k < 4000 else np.zeros(4)
        plant.advance(controller.torque + pushed)
        if k in (3999, 13999):
            wrong.append(np.linalg.norm(controller.estimate / THETA - 1.0))
    assert wrong[0] > 10.0
    assert wrong[1] < 0.02


def errors_after_excitation(law: str) -> tuple[Array, Array]:
    """Return the relative errors of theta_hat 1 s and 6 s after 3 s of excitation ended."""
    weight = 'controller.concurrent_learning.kappa=30.0'
    values = load_scenario(PAPER, (f'controller.law={law}', weight, *EXCITED, 'duration=3.0'))
    excited = next(Simulation(values).run(block=10**6)).reference
    still = np.zeros_like(excited[-1])
    still[:4] = excited[-1][:4]
    single = Simulation(values)
    plant, controller = single.plant, single.controller
    wrong = []
    for k in range(9000):
        controller.tick(plant.position, plant.velocity, excited[k] if k < 3000 else still)
        plant.advance(controller.torque)
        if k in (4000, 8999):
            wrong.append(np.linalg.norm(controller.estimate / THETA - 1.0))
    return wrong[0], wrong[1]


@pytest.mark.slow
def test_concurrent_learning_excitation_ends_still_converges() -> None:
    """At rest rasmc keeps its parameter errors; the recorded data removes them."""
    recorded, tracked = errors_after_excitation(LAW), errors_after_excitation('rasmc')
    assert recorded[1] < 0.005
    assert tracked[1] > 0.95 * tracked[0]


def test_concurrent_learning_too_many_parameters_raises() -> None:
    large = replace(TWO_LINK, theta=TWO_LINK.theta * 5)
    assert registry.load_for(LAW, TWO_LINK).name == LAW
    with pytest.raises(InputError, match='35 base inertial parameters, expected at most 32'):
        registry.load_for(LAW, large)


@pytest.mark.slow
def test_concurrent_learning_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 0.05
