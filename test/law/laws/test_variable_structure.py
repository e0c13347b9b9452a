# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Variable structure control: torque formula and time to reach s = 0."""

from __future__ import annotations

from helpers.lagrangian import matrices
from helpers.law_bench import at_random, run, tick
from helpers.robots import DEFAULT
import numpy as np
import pytest

LAW = 'variable_structure'


@pytest.mark.parametrize('seed', range(20))
def test_variable_structure_torque_matches_formula(seed: int) -> None:
    alpha, beta, k = np.random.default_rng(seed).uniform(1.0, 50.0, (3, 4))
    controller, at = at_random(
        seed,
        LAW,
        **{
            f'{LAW}__alpha': tuple(alpha),
            f'{LAW}__beta': tuple(beta),
            f'{LAW}__k': tuple(k),
        },
    )
    v_r, a_r = at.reference
    gain = alpha * np.abs(at.error) + beta * np.abs(at.error_rate) + k
    u = -gain * np.clip(at.surface / 0.2, -1.0, 1.0)
    wanted = at.inertia @ a_r + at.coriolis @ v_r + at.jacobian.T @ u
    np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_variable_structure_reaches_surface_in_time() -> None:
    """
    The bound is sqrt(2 V_0 h) / k with h the largest eigenvalue of H_x on the way.

    V = s' H_x s / 2 falls at least by k |s|, and |s| >= sqrt(2 V / h). The largest gain on the way
    gives a lower bound of the time.
    """
    k, delta = 10.0, 0.02
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.boundary_layer={delta}',
        f'controller.{LAW}.alpha=20.0',
        f'controller.{LAW}.beta=5.0',
        f'controller.{LAW}.k={k}',
        duration=4.0,
    )
    inertias = []
    for q, rates in zip(track.position[::40], track.velocity[::40], strict=True):
        robot = matrices(DEFAULT, q, rates[3:])
        inverse = np.linalg.inv(robot.jacobian)
        inertias.append(inverse.T @ robot.reduced_inertia @ inverse)
    s = track.surface[0]
    largest = max(np.linalg.eigvalsh(h)[-1] for h in inertias)
    bound = np.sqrt(s @ inertias[0] @ s * largest) / k
    distance = np.linalg.norm(track.surface, axis=1)
    reached = track.time[np.flatnonzero(distance > 2.0 * delta)[-1]]
    assert 0.02 * bound < reached < bound
    assert bound < track.time[-1]


@pytest.mark.slow
def test_variable_structure_proportional_gains_reach_sooner() -> None:
    """Gains proportional to errors reach the surface sooner than the same k alone."""

    def area(*gains: str) -> float:
        track = run(LAW, *gains, duration=2.0)
        return float(np.linalg.norm(track.surface[:500], axis=1).sum())

    still = tuple(f'controller.{LAW}.{name}=0.0' for name in ('alpha', 'beta'))
    assert area() < 0.9 * area(*still)


@pytest.mark.slow
def test_variable_structure_tracks_path() -> None:
    assert (run(LAW, duration=10.0).settled < (0.004, 0.004, 0.0162, 0.0242)).all()
