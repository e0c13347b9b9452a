# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Momentum observer: torque formula and estimated disturbance."""

from __future__ import annotations

from helpers.law_bench import at_random, Instant, run, tick
from helpers.robots import DEFAULT, Machine
from masmc_ros.robot.two_link.geometry import motion
import numpy as np
import pytest

LAW = 'momentum_observer'


@pytest.mark.parametrize('seed', range(20))
def test_momentum_observer_torque_matches_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k_p, k_d = rng.uniform(1.0, 50.0, (2, 4))
    rate = rng.uniform(10.0, 1000.0)
    controller, at = at_random(
        seed,
        LAW,
        momentum_observer__k_p=tuple(k_p),
        momentum_observer__k_d=tuple(k_d),
        momentum_observer__rate=rate,
    )
    d, last = np.zeros(4), None
    for _ in range(3):
        if last is not None:
            v, drive = last
            measured = at.inertia @ (at.v - v) / at.period - drive
            d = (d + at.period * rate * measured) / (1.0 + at.period * rate)
        wanted = at.desired[2] - k_d * at.error_rate - k_p * at.error
        torque = at.model_torque(wanted) - d
        actual = tick(controller, at)
        np.testing.assert_allclose(actual, torque, rtol=1e-9, atol=1e-8)
        last = at.v, actual - at.coriolis @ at.v
        v = at.v + 0.01 * rng.normal(size=4)
        at = Instant(at.period, at.position, v, at.desired, at.scale, at.sigma)


def test_momentum_observer_filters_disturbance_at_its_rate() -> None:
    """On a motion of the model, d is the disturbance behind a filter of rate K_o."""
    rate, push = 100.0, np.array([1.5, -0.5, 3.0, 2.0])
    controller, at = at_random(3, LAW, momentum_observer__rate=rate)
    for k in range(30):
        torque = tick(controller, at)
        d = controller.memory['momentum_observer_disturbance'][0, :, 0]
        power = [np.dot(d, motion(Machine(DEFAULT).geometry, one)) for one in np.eye(4)]
        filtered = push * (1.0 - (1.0 + at.period * rate) ** -k)
        np.testing.assert_allclose(power, filtered, rtol=1e-6, atol=1e-6)
        v = at.v + at.period * np.linalg.solve(at.inertia, torque + push - at.coriolis @ at.v)
        at = Instant(at.period, at.position, v, at.desired, at.scale, at.sigma)


@pytest.mark.slow
def test_momentum_observer_estimates_constant_disturbance() -> None:
    """The estimate d consists of forces conjugate to v; the applied torques act on joints."""
    track = run(
        LAW,
        'controller.model_scale=1.0',
        'plant.disturbance.frequency=[0.0, 0.0, 0.0, 0.0]',
        'plant.disturbance.phase=[1.5707963, 1.5707963, 1.5707963, 1.5707963]',
        duration=4.0,
    )
    d = track.controller.memory['momentum_observer_disturbance'][0, :, 0]
    # The power of d along the motion of a unit joint velocity equals the joint's torque.
    power = [np.dot(d, motion(Machine(DEFAULT).geometry, rate)) for rate in np.eye(4)]
    np.testing.assert_allclose(power, [1.5, 1.5, 3.0, 3.0], rtol=0.02)
    assert np.abs(track.settled).max() < 1e-3


@pytest.mark.slow
def test_momentum_observer_reduces_tracking_error() -> None:
    settled = [
        np.linalg.norm(run(LAW, f'controller.{LAW}.rate={rate}', duration=10.0).settled)
        for rate in (0.0, 200.0)
    ]
    assert settled[1] < 4e-3
    assert settled[1] < 0.2 * settled[0]
