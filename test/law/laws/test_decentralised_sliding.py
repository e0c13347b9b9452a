# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Decentralised sliding mode: torque formula, surface rate and time to reach the surface."""

from __future__ import annotations

from dataclasses import dataclass

from helpers.lagrangian import Matrices, matrices
from helpers.law_bench import at_random, PAPER, run, tick
from helpers.robots import Array, DEFAULT
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

LAW = 'decentralised_sliding'


def without_coupling(
    inertia: Array, position: Array, v: Array, scale: float
) -> tuple[Array, Array]:
    """
    Return the model of platform and arm, each with the joints of the other at rest.

    The results are the inertia D (4, 4) from the blocks of `inertia`, and the Coriolis torques (4)
    in N·m of scaled masses.
    """
    separate, forces = np.zeros((4, 4)), np.zeros(4)
    for group in (slice(0, 2), slice(2, 4)):
        alone = np.zeros(4)
        alone[group] = v[group]
        separate[group, group] = inertia[group, group]
        coriolis = matrices(DEFAULT, position, alone).reduced_coriolis
        forces[group] = scale * (coriolis @ alone)[group]
    return separate, forces


@pytest.mark.parametrize('seed', range(20))
def test_decentralised_sliding_torque_matches_formula(seed: int) -> None:
    """Blocks of H and V, computed with the joints of the other group at rest."""
    q, p = np.random.default_rng(seed).uniform(1.0, 50.0, (2, 4))
    controller, at = at_random(seed, LAW, **{f'{LAW}__q': tuple(q), f'{LAW}__p': tuple(p)})
    s = at.surface
    x_r = at.desired[2] - at.sigma * at.error_rate
    acceleration = x_r - q * s - p * np.clip(s / 0.2, -1.0, 1.0)
    a = np.linalg.solve(at.jacobian, acceleration - at.drift)
    inertia, forces = without_coupling(at.inertia, at.position, at.v, at.scale)
    wanted = inertia @ a + forces
    np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


@dataclass(frozen=True)
class SurfaceRate:
    """Terms of ds/dt = -M reaching + c at one state, derived without the package."""

    matrix: Array
    """M (4, 4)."""
    offset: Array
    """c (4) in m/s²."""
    drift: Array
    """Jdot v - xddot_r (4) in m/s²."""
    matrices: Matrices

    @classmethod
    def at(
        cls,
        *,
        position: Array,
        v: Array,
        desired: Array,
        sigma: Array,
        scale: float,
        disturbance: Array,
    ) -> SurfaceRate:
        """Return the terms for a disturbance (4) in N·m, and a model with scaled masses."""
        true = matrices(DEFAULT, position, v)
        inertia, forces = without_coupling(scale * true.reduced_inertia, position, v, scale)
        jacobian, rate = true.jacobian, true.jacobian_rate @ v
        acceleration = desired[2] - sigma * (jacobian @ v - desired[1])
        product = jacobian @ np.linalg.solve(true.reduced_inertia, inertia)
        matrix = product @ np.linalg.inv(jacobian)
        pushed = forces - true.reduced_coriolis @ v + disturbance
        offset = (matrix - np.eye(4)) @ (acceleration - rate)
        offset += jacobian @ np.linalg.solve(true.reduced_inertia, pushed)
        return cls(matrix, offset, rate - acceleration, true)

    def of(self, v: Array, torque: Array, disturbance: Array) -> Array:
        """Return ds/dt (4) of the robot under torques (4) in N·m."""
        force = torque + disturbance - self.matrices.reduced_coriolis @ v
        a = np.linalg.solve(self.matrices.reduced_inertia, force)
        result: Array = self.matrices.jacobian @ a + self.drift
        return result


@pytest.mark.parametrize('seed', range(5))
def test_decentralised_sliding_surface_rate_matches_page(seed: int) -> None:
    """ds/dt = -M (Q s + P sat(s / delta)) + c for any disturbance."""
    q, p = np.random.default_rng(seed).uniform(1.0, 50.0, (2, 4))
    disturbance = np.random.default_rng(seed + 100).uniform(-3.0, 3.0, 4)
    controller, at = at_random(seed, LAW, **{f'{LAW}__q': tuple(q), f'{LAW}__p': tuple(p)})
    terms = SurfaceRate.at(
        position=at.position,
        v=at.v,
        desired=at.desired,
        sigma=at.sigma,
        scale=at.scale,
        disturbance=disturbance,
    )
    reaching = q * at.surface + p * np.clip(at.surface / 0.2, -1.0, 1.0)
    rate = terms.of(at.v, tick(controller, at), disturbance)
    expected = -terms.matrix @ reaching + terms.offset
    np.testing.assert_allclose(rate, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_decentralised_sliding_gain_holds_surface_of_paper() -> None:
    """Along the paper's experiment |M^-1 c| stays below P, and M + M' is not definite."""
    values = load_scenario(PAPER, (f'controller.law={LAW}',))
    track = next(Simulation(values).run(block=10**6))
    plant = values['plant']
    amplitude, frequency, phase = (
        np.array(plant[f'disturbance.{name}']) for name in ('amplitude', 'frequency', 'phase')
    )
    needed, offset, definite = [], [], []
    for k in range(0, len(track), 20):
        terms = SurfaceRate.at(
            position=np.array(track.position[k]),
            v=np.array(track.velocity[k])[-4:],
            desired=np.array(track.reference[k]).reshape(3, 4),
            sigma=np.array(values['controller']['sigma']),
            scale=0.5,
            disturbance=amplitude * np.sin(frequency * 1e-3 * k + phase),
        )
        needed.append(np.abs(np.linalg.solve(terms.matrix, terms.offset)))
        offset.append(np.abs(terms.offset))
        definite.append(np.linalg.eigvalsh(terms.matrix + terms.matrix.T)[0])
    np.testing.assert_allclose(np.max(needed, axis=0), (21.5, 31.6, 4.3, 3.0), rtol=0.02)
    assert np.max(offset) == pytest.approx(13.6, rel=0.01)
    assert min(definite) < 0.0


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
