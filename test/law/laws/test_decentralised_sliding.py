# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Decentralised sliding mode: torque formula and time to reach the surface."""

from __future__ import annotations

from helpers.lagrangian import matrices
from helpers.law_bench import at_random, PAPER, run, tick
from helpers.robots import DEFAULT
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
import numpy as np
import pytest

LAW = 'decentralised_sliding'


@pytest.mark.parametrize('seed', range(20))
def test_decentralised_sliding_torque_matches_formula(seed: int) -> None:
    """Blocks of H and V, computed with the joints of the other group at rest."""
    q, p = np.random.default_rng(seed).uniform(1.0, 50.0, (2, 4))
    controller, at = at_random(seed, LAW, **{f'{LAW}__q': tuple(q), f'{LAW}__p': tuple(p)})
    s = at.surface
    x_r = at.desired[2] - at.sigma * at.error_rate
    acceleration = x_r - q * s - p * np.clip(s / 0.2, -1.0, 1.0)
    a = np.linalg.solve(at.jacobian, acceleration - at.drift)
    wanted = np.zeros(4)
    for group in (slice(0, 2), slice(2, 4)):
        v = np.zeros(4)
        v[group] = at.v[group]
        alone = matrices(DEFAULT, at.position, v)
        wanted[group] = at.inertia[group, group] @ a[group]
        wanted[group] += at.scale * (alone.reduced_coriolis @ v)[group]
    np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_decentralised_sliding_reaches_surface_in_time() -> None:
    """All joints in one group: s' = -Q s - P sgn s holds exactly."""
    q, p, delta = 3.0, 1.5, 0.01
    simulation = Simulation(
        load_scenario(
            PAPER,
            (
                'duration=1.0',
                'control_period=0.0005',
                f'controller.law={LAW}',
                f'controller.{LAW}.q={q}',
                f'controller.{LAW}.p={p}',
                f'controller.boundary_layer={delta}',
                'controller.model_scale=1.0',
                'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
            ),
        )
    )
    simulation.controller.settings['group'] = 0
    tick_block = next(simulation.run(block=10**6))
    s = np.abs(np.array(tick_block.surface))
    reaching = np.log((q * s[0] + p) / (q * delta + p)) / q
    reached = (s > delta).sum(axis=0) * 0.0005
    assert reaching.max() > 0.1
    np.testing.assert_allclose(reached, reaching, atol=0.002)
    # After the surface is reached, only the sampling moves s.
    assert (s[int(2000 * reaching.max()) + 20:] < delta).all()


@pytest.mark.slow
def test_decentralised_sliding_tracks_path() -> None:
    """Half of the true masses, with groups that act on each other."""
    track = run(LAW, duration=10.0)
    assert (track.settled < (0.024, 0.031, 0.0043, 0.0022)).all()
    assert np.abs(track.surface[len(track.surface) // 2:]).max() < 0.2
