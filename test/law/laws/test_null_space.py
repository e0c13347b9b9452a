# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Operational space control: torque formula and priority of the first axes."""

from __future__ import annotations

from helpers.law_bench import at_random, Instant, run, tick
from helpers.robots import Array
from masmc_ros.law.parts.inverse_dynamics import DAMPING, STIFFNESS
import numpy as np
import pytest

LAW = 'null_space'


def commanded(at: Instant, k_p: Array, k_d: Array) -> Array:
    """Return the commanded J vdot (4)."""
    return at.desired[2] - k_d * at.error_rate - k_p * at.error - at.drift


@pytest.mark.parametrize('first', [1, 2, 3, 4])
@pytest.mark.parametrize('seed', range(6))
def test_null_space_torque_matches_formula(seed: int, first: int) -> None:
    """The expected torque uses the projector of the source, matrix by matrix."""
    k_p, k_d = np.random.default_rng(seed).uniform(1.0, 50.0, (2, 4))
    controller, at = at_random(
        seed,
        LAW,
        **{
            f'{LAW}__first_axes': first,
            f'{LAW}__k_p': tuple(k_p),
            f'{LAW}__k_d': tuple(k_d),
        },
    )
    b = commanded(at, k_p, k_d)
    inverse = np.linalg.inv(at.inertia)
    j_1, j_2 = at.jacobian[:first], at.jacobian[first:]
    lambda_1 = np.linalg.inv(j_1 @ inverse @ j_1.T)
    consistent = inverse @ j_1.T @ lambda_1
    projector = np.eye(4) - consistent @ j_1
    coupling = j_2 @ inverse @ j_1.T @ lambda_1
    mobility = j_2 @ inverse @ projector.T @ j_2.T
    f_2 = np.linalg.solve(mobility, b[first:] - coupling @ b[:first])
    wanted = j_1.T @ lambda_1 @ b[:first] + projector.T @ j_2.T @ f_2 + at.coriolis @ at.v
    np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


def task_acceleration(at: Instant, torque: Array) -> Array:
    """Return the task acceleration of the model under a torque."""
    acceleration: Array = at.drift + at.jacobian @ np.linalg.solve(
        at.inertia, torque - at.coriolis @ at.v
    )
    return acceleration


@pytest.mark.parametrize('seed', range(5))
def test_null_space_other_axes_do_not_disturb_first(seed: int) -> None:
    """The first axes have the commanded acceleration for any command of the other axes."""
    accelerations = []
    for k_p in (0.0, 1000.0):
        controller, at = at_random(seed, LAW, **{f'{LAW}__k_p': (100.0, 100.0, k_p, k_p)})
        accelerations.append(task_acceleration(at, tick(controller, at)))
    np.testing.assert_allclose(accelerations[0][:2], accelerations[1][:2], rtol=1e-8)
    assert np.abs(accelerations[0][2:] - accelerations[1][2:]).max() > 1.0


@pytest.mark.parametrize('seed', range(5))
def test_null_space_straight_arm_controls_first_axes(seed: int) -> None:
    """J is singular for a straight arm; the damped inverse of another law misses the command."""
    deviations = []
    for law in (LAW, 'nonlinear_feedback'):
        controller, at = at_random(seed, law)
        at.position[6] = 0.0
        at.v[:] = 0.0
        at.desired[0] = np.random.default_rng(seed).uniform(-0.5, 0.5, 4)
        b = commanded(at, np.full(4, STIFFNESS), np.full(4, DAMPING))
        deviations.append(np.abs(task_acceleration(at, tick(controller, at)) - b)[:2].max())
    assert deviations[0] < 1e-9 < 1e-2 < deviations[1]


@pytest.mark.slow
def test_null_space_tracks_path() -> None:
    """Half of the true masses: the bounds hold for gains that dominate the model error."""
    assert (run(LAW, duration=10.0).settled < (0.021, 0.024, 0.0065, 0.0065)).all()
