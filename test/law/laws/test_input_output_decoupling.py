# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Input-output decoupling: torque formula and independent dynamics of the outputs."""

from __future__ import annotations

from helpers.law_bench import at_random, run, tick
from masmc_ros.law.parts.inverse_dynamics import DAMPING, STIFFNESS
import numpy as np
import pytest

LAW = 'input_output_decoupling'


@pytest.mark.parametrize('seed', range(20))
def test_input_output_decoupling_torque_matches_formula(seed: int) -> None:
    """The expected torque inverts the decoupling matrix J H^-1; the law inverts J."""
    controller, at = at_random(seed, LAW)
    nu = at.desired[2] - DAMPING * at.error_rate - STIFFNESS * at.error
    decoupling = at.jacobian @ np.linalg.inv(at.inertia)
    drift = at.drift - decoupling @ at.coriolis @ at.v
    wanted = np.linalg.solve(decoupling, nu - drift)
    np.testing.assert_allclose(tick(controller, at), wanted, rtol=1e-9, atol=1e-9)


def test_input_output_decoupling_equals_nonlinear_feedback() -> None:
    decoupling_law, at = at_random(5, LAW)
    feedback_law, _ = at_random(5, 'nonlinear_feedback')
    for _ in range(3):
        np.testing.assert_array_equal(tick(decoupling_law, at), tick(feedback_law, at))


@pytest.mark.slow
def test_input_output_decoupling_outputs_are_independent() -> None:
    """Different bandwidths, critically damped: e_i = (e_0 + (edot_0 + w e_0) t) e^-wt."""
    w = np.array([6.0, 8.0, 10.0, 12.0])
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
        'control_period=0.0005',
        f'controller.nonlinear_feedback.k_p={(w**2).tolist()}',
        f'controller.nonlinear_feedback.k_d={(2.0 * w).tolist()}',
        duration=2.0,
    )
    start, rate = track.error[0], track.surface[0] - 2.0 * track.error[0]
    t = track.time[:, None]
    expected = (start + (rate + w * start) * t) * np.exp(-w * t)
    assert np.abs(track.error - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.slow
def test_input_output_decoupling_tracks_path() -> None:
    """Half of the true masses: the bounds hold for gains that dominate the model error."""
    assert (run(LAW, duration=10.0).settled < (0.021, 0.024, 0.0065, 0.0065)).all()
