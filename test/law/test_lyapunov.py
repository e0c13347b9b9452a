# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Error dynamics (18) and Lyapunov function (19)-(23) in continuous time, with their signs."""

from __future__ import annotations

from dataclasses import dataclass

from helpers.plant_state import derivative, PlantState
from helpers.robots import (
    Angles,
    Array,
    assert_agree,
    DEFAULT,
    Machine,
    machines,
    PROPERTY,
    Quad,
    quads,
)
from hypothesis import assume, given
from hypothesis import strategies as st
from masmc_ros.jit.record import fill
from masmc_ros.law.plug_in import TickInput
from masmc_ros.law.registry import LAWS
from masmc_ros.loop import records
from masmc_ros.loop.dense import tick_input
from masmc_ros.robot.two_link.dynamics import coriolis_times
from masmc_ros.robot.two_link.geometry import joint_torques, motion, posture_at
from masmc_ros.robot.two_link.kinematics import task_drift, task_position
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest


@dataclass(frozen=True)
class Situation:
    """A moving robot under (17) with an estimate, gains and a disturbance."""

    robot: Machine
    angles: Angles
    rates: Quad
    reference: Array
    """x_d, xdot_d, xddot_d (12)."""
    estimate: Array
    """theta_hat (7)."""
    k_s1: Array
    k_s2: Array
    disturbance: Array
    """tau_d (4) in v's order."""

    @property
    def tick(self) -> TickInput:
        """Surface, reference state and matrices of the true model."""
        position = np.array(
            [0.2, -0.1, self.angles.yaw, 0.0, 0.0, self.angles.arm_1, self.angles.arm_2]
        )
        velocity = np.array([0.0, 0.0, 0.0, *self.rates])
        gains = {'sigma': np.array([2.0, 1.0, 3.0, 0.5])}
        theta = np.array(self.robot.theta)
        settings = records.law_settings(TWO_LINK, LAWS['rasmc'], 'sign')
        fill(settings, 'geometry', np.array(self.robot.geometry))
        fill(settings, 'nominal', theta)
        fill(settings, 'period', 1e-3)
        fill(settings, 'sigma', gains['sigma'])
        signals = records.signals(TWO_LINK)
        fill(signals, 'position', position)
        fill(signals, 'velocity', velocity)
        fill(signals, 'reference', self.reference)
        return tick_input(settings, signals, gains, self.estimate, np.zeros(4))

    @property
    def task_disturbance(self) -> Array:
        """J^-T tau_d (4) in N."""
        return self.tick.inverse_jacobian.T @ self.disturbance

    def surface_rate(self) -> Array:
        """Return sdot (4) of the plant under the law (17)."""
        t, geometry = self.tick, self.robot.geometry
        u = -self.k_s1 * t.surface - self.k_s2 * np.sign(t.surface)
        torque = t.regressor @ self.estimate + t.jacobian.T @ u + self.disturbance
        state = PlantState(
            0.0, 0.0, self.angles.yaw, 0.0, 0.0, self.angles.arm_1, self.angles.arm_2, *self.rates
        )
        rate = derivative(self.robot.theta, geometry, state, tuple(torque.tolist()))
        kinematics = posture_at(self.angles.yaw, self.angles.arm_1, self.angles.arm_2)
        v = motion(geometry, self.rates)
        acceleration = t.jacobian @ np.array(rate[7:]) + task_drift(geometry, kinematics, v, v)
        sigma = np.asarray(t.gains['sigma'])
        return acceleration - (t.reference[2] - sigma * t.error_rate)

    def coriolis_force(self) -> Array:
        """Return V_x s (4) of (11)."""
        t, geometry = self.tick, self.robot.geometry
        kinematics = posture_at(self.angles.yaw, self.angles.arm_1, self.angles.arm_2)
        v = motion(geometry, self.rates)
        along = t.inverse_jacobian @ t.surface
        along_quasi = motion(geometry, along.tolist())
        force = coriolis_times(geometry, kinematics, self.robot.theta, v, along_quasi)
        own = joint_torques(geometry, force)
        drift = task_drift(geometry, kinematics, v, along_quasi)
        turning = t.inertia @ t.inverse_jacobian @ np.array(drift)
        return t.inverse_jacobian.T @ (np.array(own) - turning)


@st.composite
def situations(draw: st.DrawFn) -> Situation:
    """Draw a situation with a bent arm and every s_i off the surface."""
    robot = draw(machines())
    bend = draw(st.floats(0.4, 2.7)) * draw(st.sampled_from((-1.0, 1.0)))
    angles = Angles(draw(st.floats(-3.0, 3.0)), draw(st.floats(-3.0, 3.0)), bend)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    situation = Situation(
        robot,
        angles,
        draw(quads(2.0)),
        rng.uniform(-1.0, 1.0, 12),
        np.array(robot.theta) * rng.uniform(0.2, 3.0, 7),
        rng.uniform(0.0, 100.0, 4),
        rng.uniform(0.0, 100.0, 4),
        rng.uniform(-5.0, 5.0, 4),
    )
    assume(np.abs(situation.tick.surface).min() > 1e-3)
    return situation


@pytest.mark.slow
@PROPERTY
@given(situations())
def test_error_dynamics_estimation_error_has_minus_sign(situation: Situation) -> None:
    """H_x sdot + V_x s + K_s1 s + K_s2 sgn(s) = -Y (theta - theta_hat) + tau_dx."""
    t = situation.tick
    s = t.surface
    inertial = t.task_inertia @ situation.surface_rate()
    left = inertial + situation.coriolis_force() + situation.k_s1 * s + situation.k_s2 * np.sign(s)
    estimation_error = np.array(situation.robot.theta) - situation.estimate
    mismatch = t.inverse_jacobian.T @ t.regressor @ estimation_error
    size = np.abs(inertial).max() + np.abs(left).max() + 1.0
    assert_agree(left, -mismatch + situation.task_disturbance, 1e-9, scale=size)
    # The printed equation, with a plus and without the disturbance, does not hold.
    assert np.abs(left - mismatch).max() > 1e-6 * size


def lyapunov_rate(situation: Situation, estimate_rate: Array, gamma: Array) -> float:
    """Return dL/dt of (20), with Hdot_x from Property 2: s' Hdot_x s / 2 = s' V_x s."""
    t = situation.tick
    s = t.surface
    along = s @ (t.task_inertia @ situation.surface_rate() + situation.coriolis_force())
    estimation_error = np.array(situation.robot.theta) - situation.estimate
    return float(along + estimation_error @ (gamma * -estimate_rate))


@PROPERTY
@given(situations(), st.integers(0, 2**32 - 1))
def test_update_law_cancels_estimation_error(situation: Situation, seed: int) -> None:
    """dL/dt = -s' K_s1 s - s' K_s2 sgn(s) + s' tau_dx under dtheta_hat/dt of (23)."""
    t = situation.tick
    s = t.surface
    gamma = np.random.default_rng(seed).uniform(0.1, 10.0, 7)
    update = -(t.regressor.T @ t.inverse_jacobian @ s) / gamma
    rate = lyapunov_rate(situation, update, gamma)
    expected = (
        -s @ (situation.k_s1 * s) - np.abs(s) @ situation.k_s2 + s @ situation.task_disturbance
    )
    y_x = t.inverse_jacobian.T @ t.regressor
    size = np.abs(s).max() * (
        np.abs(t.task_inertia @ situation.surface_rate()).max()
        + np.abs(y_x).max() * np.abs(situation.robot.theta).max() * 4.0
    )
    assert_agree(rate, expected, 1e-9, scale=size)
    # With the derivative of theta_tilde on the left of (23), as its symbols in (20) suggest, the
    # estimation error would enter twice instead of cancelling.
    estimation_error = np.array(situation.robot.theta) - situation.estimate
    opposite = lyapunov_rate(situation, -update, gamma)
    remainder = -2.0 * s @ y_x @ estimation_error
    assert_agree(opposite - rate, remainder, 1e-9, scale=size)


@PROPERTY
@given(situations())
def test_lyapunov_function_large_switching_gains_decreases(situation: Situation) -> None:
    strong = Situation(
        **{**vars(situation), 'k_s2': np.abs(situation.task_disturbance) * 1.01 + 1e-3}
    )
    t = strong.tick
    update = -(t.regressor.T @ t.inverse_jacobian @ t.surface)
    size = np.abs(t.surface).max() * np.abs(t.task_inertia @ strong.surface_rate()).max()
    assert lyapunov_rate(strong, update, np.ones(7)) < 1e-9 * size


def test_lyapunov_function_small_switching_gains_grows() -> None:
    """(21)-(22) omit K_s2 and the disturbance, and with them the condition on K_s2."""
    robot = Machine(DEFAULT)
    angles = Angles(0.4, 0.7, -1.2)
    still = Situation(
        robot,
        angles,
        (0.0, 0.0, 0.0, 0.0),
        np.zeros(12),
        np.array(robot.theta),
        np.zeros(4),
        np.zeros(4),
        np.zeros(4),
    )
    # A reference 1 mm off in every axis, and a disturbance along s above K_s2 = 1 N.
    kinematics = posture_at(angles.yaw, angles.arm_1, angles.arm_2)
    x = np.array(task_position(robot.geometry, kinematics, (0.2, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    reference = np.concatenate([x - 1e-3, np.zeros(8)])
    disturbance = still.tick.jacobian.T @ np.full(4, 2.0)
    near = Situation(
        **{**vars(still), 'reference': reference, 'k_s2': np.ones(4), 'disturbance': disturbance}
    )
    assert (near.tick.surface > 0.0).all()
    assert near.task_disturbance == pytest.approx(np.full(4, 2.0))
    assert lyapunov_rate(near, np.zeros(7), np.ones(7)) > 1e-3
