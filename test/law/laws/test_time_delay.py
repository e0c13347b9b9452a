# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Time-delay control: torque formula and rejection of slow disturbances."""

from __future__ import annotations

from helpers.law_bench import at_random, Instant, run, tick
from masmc_ros.errors import InputError
import numpy as np
import pytest

LAW = 'time_delay'


@pytest.mark.parametrize('seed', range(20))
def test_time_delay_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k_p, k_d = rng.uniform(1.0, 50.0, (2, 4))
    controller, at = at_random(
        seed, LAW, time_delay__k_p=tuple(k_p), time_delay__k_d=tuple(k_d)
    )
    wanted = at.desired[2] - k_d * at.error_rate - k_p * at.error
    before = tick(controller, at)
    np.testing.assert_allclose(before, at.model_torque(wanted), rtol=1e-9, atol=1e-9)
    v = at.v
    for _ in range(2):
        at = Instant(
            at.period, at.position, v + 0.01 * rng.normal(size=4), at.desired, at.scale, at.sigma
        )
        wanted = at.desired[2] - k_d * at.error_rate - k_p * at.error
        a_c = np.linalg.solve(at.jacobian, wanted - at.drift)
        torque = before + at.inertia @ (a_c - (at.v - v) / at.period)
        actual = tick(controller, at)
        np.testing.assert_allclose(actual, torque, rtol=1e-9, atol=1e-8)
        before, v = actual, at.v


def test_time_delay_after_pause_restarts_with_model() -> None:
    controller, at = at_random(0, LAW)
    first = tick(controller, at)
    assert (tick(controller, at) != first).any()
    controller.output_not_applied()
    assert (tick(controller, at) == first).all()


@pytest.mark.slow
def test_time_delay_constant_disturbance_leaves_no_error() -> None:
    """Half of the true masses suffice: the norm of I - H^-1 H_nominal is 1/2, below 1."""
    constant = (
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
    )
    assert np.abs(run(LAW, *constant, duration=6.0).settled).max() < 1e-4


@pytest.mark.slow
def test_time_delay_model_above_twice_mass_is_unstable() -> None:
    """Stability condition of the theory: the norm of I - H^-1 H_nominal must be below 1."""
    quiet = 'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]'
    track = run(LAW, quiet, 'controller.model_scale=1.8', duration=1.0)
    assert np.abs(np.diff(track.torque[-50:], axis=0)).max() < 0.1
    with pytest.raises(InputError, match='diverged'):
        run(LAW, quiet, 'controller.model_scale=2.2', duration=1.0)


@pytest.mark.slow
def test_time_delay_tracks_path() -> None:
    assert np.linalg.norm(run(LAW, duration=10.0).settled) < 1e-3
