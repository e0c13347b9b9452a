# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction and disturbance estimate with latency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from helpers.core_loop import node_values
from helpers.robots import PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.control.gates import outdated_latency, StateLateness
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.law.parts.delay_compensation import horizon
from masmc_ros.law.parts.delay_fields import CompensationMemory, CompensationSettings
from masmc_ros.law.parts.delay_prediction import BANDWIDTH, estimate_gain, observer_gains
from masmc_ros.law.parts.velocity_estimator import filter_bandwidth
from masmc_ros.loop.closed_loop import limit_torque, predict_state, reduce_torque
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.robot.robot import robot_of
import numpy as np
from numpy.typing import NDArray
import pytest

PERIOD = 0.001
AT_REST = {
    'initial_pose': (0.0, 0.0, 1.5707963267948966),
    'initial_joints': (0.0, 0.0, 0.7853981633974483, -1.5707963267948966),
    'disturbance.amplitude': (0.0,) * 4,
}
LAW = {'law': 'smc', 'switching': 'implicit', 'model_scale': 1.0}


class DelayedLoop:
    """Planar robot whose controller receives old states and follows a point."""

    def __init__(self, plant: dict[str, Any], **control: Any) -> None:
        """Initialise the loop from parameters of the plant and of the controller."""
        shared = {'control_period': PERIOD}
        values = node_values(shared, plant={**AT_REST, **plant}, controller={**LAW, **control})
        self.plant = SimulatedRobot(robot_of(values['plant']), PERIOD, values['plant'])
        robot = robot_of(values['controller'])
        self.controller = Controller(robot, PERIOD, values['controller'])
        self.controller.set_stamp_age(self.plant.delay)
        self.reference = np.zeros(12)
        self.reference[:4] = robot.task_positions(self.plant.true_position[None])[0]

    def run(self, ticks: int) -> None:
        """Advance by a number of control periods."""
        for _ in range(ticks):
            plant = self.plant
            self.controller.tick(plant.position, plant.velocity, self.reference)
            controller = self.controller
            by_velocity = plant.by_velocity
            plant.advance(np.where(by_velocity, controller.velocity_command, controller.torque))

    def predicted(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the positions and velocities in which the next torque would act."""
        controller, plant = self.controller, self.plant
        memory, signals = controller.memory.copy(), controller.signals.copy()
        signals['position'][0, :, 0], signals['velocity'][0, :, 0] = plant.position, plant.velocity
        result = signals.copy()
        predict_state(controller.settings, memory, signals, result)
        return result['position'][0, :, 0], result['velocity'][0, :, 0]


@pytest.mark.parametrize('delay', [0.001, 0.004, 0.013])
def test_prediction_true_model_equals_true_state(delay: float) -> None:
    moving = {'initial_velocity': (2.0, -1.0, 0.5, 1.0), 'measurement_delay': delay}
    loop = DelayedLoop(moving, latency=delay)
    # The first measurement is repeated until the delay has passed, which disturbs the estimate.
    loop.run(800)
    position, velocity = loop.predicted()
    np.testing.assert_allclose(position, loop.plant.true_position, atol=2e-6)
    np.testing.assert_allclose(velocity, loop.plant.true_velocity, atol=2e-4)


@pytest.mark.parametrize('lag', [0.003, 0.02])
def test_prediction_motor_lag_true_model_equals_true_state(lag: float) -> None:
    """The predicted state is that after the delay and the lag, if the last command holds."""
    delay = 0.005
    moving = {'initial_velocity': (2.0, -1.0, 0.5, 1.0), 'measurement_delay': delay}
    loop = DelayedLoop({**moving, 'motor_lag': lag}, latency=delay, motor_lag=lag)
    loop.run(1000)
    # Torques change quickly while the robot turns back.
    loop.reference[:4] += 0.05, 0.05, 0.1, 0.1
    loop.run(30)
    position, velocity = loop.predicted()
    for _ in range(round(lag / PERIOD)):
        loop.plant.advance(loop.controller.torque)
    # Heun steps of 5 ms approximate the change of the torque within a step.
    np.testing.assert_allclose(position, loop.plant.true_position, atol=1.5e-4)
    np.testing.assert_allclose(velocity, loop.plant.true_velocity, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize('delay', [0.004, 0.012])
def test_prediction_base_by_velocity_equals_true_state(delay: float) -> None:
    both = {'command_interface': 'hybrid', 'base_lag': 0.1}
    drives = {'velocity_loop.bandwidth': 1000.0, 'integrator_step': 1e-4}
    loop = DelayedLoop(
        {**both, **drives, 'measurement_delay': 0.5 * delay, 'command_delay': 0.5 * delay},
        **both,
        latency=delay,
    )
    loop.reference[4:8] = 0.1, 0.05, 0.1, 0.0
    for _ in range(600):
        loop.reference[:4] += PERIOD * loop.reference[4:8]
        loop.run(1)
    later = loop.predicted()
    # The predicted state is that after the delay of commands.
    loop.run(round(0.5 * delay / PERIOD))
    plant = loop.plant
    for state, true in zip(later, (plant.true_position, plant.true_velocity), strict=True):
        np.testing.assert_allclose(state, true, atol=2e-4)


@pytest.mark.parametrize('source', ['measured', 'estimated'])
def test_estimate_constant_disturbance_converges(source: str) -> None:
    """At rest the drives balance the disturbance, and d is H^-1 of it."""
    push = (0.4, 0.3, 1.0, 0.5)
    delay = 0.004
    constant = {'amplitude': push, 'frequency': (0.0,) * 4, 'phase': (0.5 * np.pi,) * 4}
    plant = {f'disturbance.{name}': value for name, value in constant.items()}
    loop = DelayedLoop(
        {**plant, 'measurement_delay': delay}, latency=delay, velocity_source=source
    )
    loop.run(4000)
    np.testing.assert_allclose(loop.controller.torque, -np.array(push), atol=1e-7)
    assert np.abs(loop.controller.memory['acceleration_slope']).max() < 1e-9
    error = loop.controller.robot.task_positions(loop.plant.true_position[None])[0]
    np.testing.assert_allclose(error, loop.reference[:4], atol=1e-8)


@PROPERTY
@given(
    bandwidth=st.floats(1.0, 1e4),
    period=st.floats(1e-4, 0.02),
    gain=st.floats(0.01, 0.5),
    slope=st.floats(0.0, 1.0),
)
def test_observer_gains_place_declared_poles(
    bandwidth: float, period: float, gain: float, slope: float
) -> None:
    slope_gain = slope * gain * gain
    gains = np.array(observer_gains(bandwidth, period, gain, slope_gain))
    step = np.array([[1, 1, 0.5, 0], [0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 1.0]])
    error = (np.eye(4) - np.outer(gains, [1, 0, 0, 0])) @ step
    pole = 1.0 / (1.0 + bandwidth * period)
    filtered, estimated = np.poly([pole, pole]), [1, gain + slope_gain - 2, 1 - gain]
    expected = np.convolve(filtered, estimated)
    np.testing.assert_allclose(np.poly(error), expected, atol=1e-9)


@kernel
def rule_of(settings: Any) -> tuple[float, float, float]:
    """Return h in s, beta, and the bandwidth of the observer in rad/s of settings."""
    gains = lane_of(settings[0], 0)
    return horizon(gains), estimate_gain(gains), filter_bandwidth(gains, BANDWIDTH)


def test_rule_sets_horizon_gain_and_bandwidth() -> None:
    def rule(**control: float) -> tuple[float, float, float]:
        settings = DelayedLoop({}, **control).controller.settings
        values: tuple[float, float, float] = rule_of(settings)
        return values

    assert rule(latency=0.01) == pytest.approx((0.012, 0.1, 200.0))
    assert rule(latency=0.0068, motor_lag=0.0128) == pytest.approx((0.012, 0.1, 200.0))
    assert rule(motor_lag=0.016) == pytest.approx((0.0142, 1.0 / 12.0, 200.0))
    # With 3.8 periods, nodes with a jitter of one period diverge on a busy machine.
    assert rule(latency=0.003)[0] == pytest.approx(0.0043)
    assert rule(latency=0.0005) == pytest.approx((0.0015, 0.25, 200.0))
    explicit = {'compensation.horizon': 0.003, 'compensation.gain': 0.4}
    assert rule(latency=0.01, **explicit) == pytest.approx((0.003, 0.4, 200.0))
    assert rule(latency=0.01, estimator_bandwidth=1000.0) == pytest.approx((0.012, 0.1, 1000.0))


class LimitedTorques:
    """Torques of a law at rest, after the compensation and the limit of the first joint."""

    LIMIT = 10.0

    def __init__(self, rate_limit: float = 0.0) -> None:
        """Initialise the controller of a robot with exact model, without disturbance."""
        limits = {
            'torque_limit': (self.LIMIT, *(0.0,) * 3),
            'torque_rate_limit': (rate_limit, *(0.0,) * 3),
        }
        self._controller = DelayedLoop({}, latency=0.005, **limits).controller

    def limited(self, requests: Sequence[float]) -> NDArray[np.float64]:
        """Return the commanded torques of the first joint for those that a law requests."""
        controller = self._controller
        memory, signals = controller.memory.copy(), controller.signals.copy()
        commanded = []
        for request in requests:
            signals['raw_torque'] = 0.0
            signals['raw_torque'][0, 0, 0] = request
            reduce_torque(controller.settings, memory, signals, signals)
            limit_torque(controller.settings, memory, signals)
            commanded.append(signals['torque'][0, 0, 0])
        return np.array(commanded)


@PROPERTY
@given(
    mean=st.floats(-0.95, 0.95),
    noise=st.lists(st.floats(0.0, 0.99), min_size=1, max_size=5),
)
def test_noise_beyond_limit_mean_torque_is_kept(mean: float, noise: list[float]) -> None:
    """Symmetric noise that the limit cuts on one side does not change the mean torque."""
    limit = LimitedTorques.LIMIT
    swing = [sign * value * abs(mean) for value in noise for sign in (1.0, -1.0)]
    requests = limit * (mean + np.array(swing * 60))
    torques = LimitedTorques().limited(requests)
    assert np.abs(torques).max() <= limit
    late = len(requests) // 2
    # The remainder of one swing is added in the next one.
    allowed = 2.0 * sum(noise) * limit / late
    assert torques[late:].mean() == pytest.approx(mean * limit, abs=allowed + 1e-9)


@pytest.mark.parametrize('share', [2.0, 50.0])
def test_saturation_ends_within_milliseconds(share: float) -> None:
    limit = LimitedTorques.LIMIT
    requests = [share * limit] * 2000 + [0.5 * limit] * 50
    torques = LimitedTorques().limited(requests)
    assert (torques[:2000] == limit).all()
    # 5 ms of the limit are added, half of the limit is free.
    np.testing.assert_allclose(torques[2011:], 0.5 * limit)
    # A request that turns is followed at once.
    turned = LimitedTorques().limited([share * limit] * 2000 + [-0.1 * limit])
    assert turned[-1] == -0.1 * limit


def test_withheld_torque_rate_limit_adds_nothing() -> None:
    limit = LimitedTorques.LIMIT
    requests = [2.0 * limit] * 200 + [0.9 * limit] * 2
    torques = LimitedTorques(rate_limit=1000.0 * limit).limited(requests)
    np.testing.assert_allclose(torques[-2:], 0.9 * limit)


def test_latency_zero_has_no_further_state() -> None:
    controller = DelayedLoop({}).controller
    names = {*(controller.settings.dtype.names or ()), *(controller.memory.dtype.names or ())}
    assert names.isdisjoint(field.name for field in (*CompensationMemory, *CompensationSettings))


def test_latency_changes_live_and_back() -> None:
    """A change takes effect at the next tick; without latency the law is that of the start."""
    loop, other = DelayedLoop({}), DelayedLoop({})
    loop.controller.change({'latency': 0.002})
    assert loop.controller.is_compensated
    loop.run(50)
    loop.controller.change({'latency': 0.003})
    loop.run(50)
    loop.controller.change({'latency': 0.0})
    assert not loop.controller.is_compensated
    assert loop.controller.settings.dtype == other.controller.settings.dtype
    assert loop.controller.memory.dtype == other.controller.memory.dtype
    loop.run(50)
    assert np.isfinite(loop.controller.torque).all()


def test_skipped_ticks_prediction_accounts_for_held_torque() -> None:
    moving = {'initial_velocity': (2.0, -1.0, 0.5, 1.0), 'measurement_delay': 0.004}
    loop = DelayedLoop(moving, latency=0.004)
    loop.run(500)
    for _ in range(3):
        loop.plant.advance(loop.controller.torque)
    loop.controller.skip(3)
    before = loop.controller.memory['acceleration'].copy()
    loop.controller.tick(loop.plant.position, loop.plant.velocity, loop.reference)
    # The model is true: the estimate changes by the error of integration only.
    change = loop.controller.memory['acceleration'] - before
    assert np.abs(change).max() < 1e-2
    np.testing.assert_allclose(loop.controller.memory['state_time'], 0.503)


def test_lateness_constant_age_is_zero_at_any_clock() -> None:
    lateness = StateLateness()
    late = [lateness.add(10**18 + k * 10**6, 77.0 + 1e-3 * k) for k in range(100)]
    np.testing.assert_allclose(late, 0.0, atol=1e-8)
    assert lateness.add(10**18 + 100 * 10**6, 77.1 + 0.004) == pytest.approx(0.004, rel=0.02)


def test_warning_latency_too_short_names_right_value() -> None:
    controller = DelayedLoop({}, latency=0.002).controller
    assert outdated_latency(controller, 0.0025) == ''
    assert outdated_latency(controller, -3.0) == ''
    text = outdated_latency(controller, 0.0063)
    assert text.startswith('latency = 0.002: the states are 6.3 ms old')
    assert 'at least 0.0063' in text
    # The age contains no lag of the motors.
    lagging = DelayedLoop({}, latency=0.002, motor_lag=0.004).controller
    assert 'at least 0.0063' in outdated_latency(lagging, 0.0063)
    # A simulated plant with a delay stamps its states late.
    controller.set_stamp_age(0.004)
    assert 'at least 0.0073' in outdated_latency(controller, 0.0033)
