# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Disturbance estimate and prediction of the state under latency.

The estimate compares each measured state with one step of the model from the previous one, under
the torque that acted meanwhile. Then the model predicts the state after L; until then the last
command holds. docs/theory/latency.md derives both.

The gains follow a rule for h, beta and beta_2, with those of the observer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from masmc_ros.aliases import Numbers
from masmc_ros.jit.arrays import read_along, write_along
from masmc_ros.jit.compiled import formula, kernel, subroutine
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import elementwise, head, joined, tail
from masmc_ros.law.fields import Settings
from masmc_ros.law.parts import moving_base
from masmc_ros.law.parts.delay_fields import CompensationMemory, CompensationSettings, HISTORY
from masmc_ros.law.parts.slip import backed_off
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, filter_bandwidth
from masmc_ros.numerics.portable_math import exp
from masmc_ros.numerics.scalars import minus, moved, plus, selected, times, zero
from masmc_ros.robot import mechanism

HORIZON, LARGEST_HORIZON = 1.1, 1.5
"""
Horizon h in latencies, to which a period is added, and largest h in latencies.

A smaller one is more accurate and tolerates smaller errors of latency and masses. Without the
period, nodes at 500 Hz with a jitter of some milliseconds diverge on a busy machine.
"""

SLOPE, SLOPE_PERIODS = 0.25, 0.05
"""
Gain beta_2 of the slope, as a multiple of beta squared: least, and increase with T / latency.

A larger one is more accurate. With a latency of many periods the loop then oscillates if the
assumed masses are less than 0.4 of the true ones.
"""

LAG_SHARE, LEAST_LAG_SHARE = 0.25, 0.75
"""
Shares of the motor lag in the latency of the rule for h and beta: added, and the least.

The model contains the lag, so the gains need a part of it only. Without latency, a smaller least
share is unstable.
"""

LARGEST_GAIN = 0.25
"""Largest beta of the rule."""


@formula
def horizon_of_rule(latency: float, period: float) -> float:
    """Return h in s for a latency and a control period in s."""
    longer = max(latency, period)
    return min(HORIZON * longer + period, LARGEST_HORIZON * longer)


@formula
def gain_of_rule(latency: float, period: float) -> float:
    """Return beta for a latency and a control period in s."""
    return period / latency if LARGEST_GAIN * latency > period else LARGEST_GAIN


@formula
def slope_of_rule(latency: float, period: float) -> float:
    """Return beta_2 as a multiple of beta squared for a latency and a control period in s."""
    return SLOPE + SLOPE_PERIODS * period / max(latency, period)


@formula
def _latency_of_rule(settings: Settings) -> float:
    """Return the latency in s by which the rule sets the gains."""
    lag = settings.motor_lag
    return max(settings.latency + LAG_SHARE * lag, LEAST_LAG_SHARE * lag)


@formula
def horizon(settings: Settings) -> float:
    """Return h in s: the chosen one, that of the rule, or T without latency."""
    chosen, period = settings.compensation_horizon, settings.period
    latency = _latency_of_rule(settings)
    of_rule = horizon_of_rule(latency, period) if latency > 0.0 else period
    return chosen if chosen > 0.0 else of_rule


@formula
def estimate_gain(settings: Settings) -> float:
    """Return beta, the gain of the disturbance estimate per tick."""
    chosen = settings.compensation_gain
    of_rule = gain_of_rule(_latency_of_rule(settings), settings.period)
    return chosen if chosen > 0.0 else of_rule


@formula
def slope_share(settings: Settings) -> float:
    """Return beta_2 as a multiple of beta squared."""
    chosen = settings.compensation_slope
    of_rule = slope_of_rule(_latency_of_rule(settings), settings.period)
    return chosen if chosen > 0.0 else of_rule


@formula
def observer_gains(
    bandwidth: float, period: float, gain: float, slope_gain: float
) -> tuple[float, float, float, float]:
    """
    Return the gains of angle, rate (times T), d (times T^2) and delta (times T^2).

    Two poles are 1 / (1 + bandwidth T). The others are those of the estimate from measured rates.
    docs/theory/latency.md derives them.

    Parameters
    ----------
    bandwidth
        Bandwidth of the observer in rad/s.
    period
        Time T since the last computed tick in s.
    gain
        Gain beta of d.
    slope_gain
        Gain beta_2 of delta.

    """
    a = 1.0 - 1.0 / (1.0 + bandwidth * period)
    b = gain + slope_gain
    of_slope = a * a * slope_gain
    of_d = a * a * b + 2.0 * a * slope_gain - 1.5 * of_slope
    of_rate = a * a + 2.0 * a * b + slope_gain - 1.5 * of_d - 0.5 * of_slope
    return 2.0 * a + b - of_rate - 0.5 * of_d, of_rate, of_d, of_slope


JITTER = 0.3
"""
Largest deviation from the usual latency that is compensated, relative to it.

A constant error of this size is tolerated. Stamps can deceive: a simulated plant that was late
itself continues from its last tick.
"""

BANDWIDTH = 200.0
"""
Default bandwidth in rad/s of the observer for angles without velocities.

A faster one turns steps of the encoders into torques. Heavy joints and those close to their torque
limit then lose the path.
"""

LONGEST_STEP = 0.005
"""Longest step of the model in s."""


class State(NamedTuple):
    """State and reference in which a law is evaluated; SI units."""

    position: Numbers
    rates: Numbers  # of the joints
    position_rates: Numbers
    desired: tuple[Numbers, Numbers, Numbers]  # x_d, xdot_d and xddot_d


@formula
def usual_latency(settings: Settings) -> float:
    """Return L in s without jitter."""
    return settings.latency + settings.motor_lag


@formula
def total_latency(settings: CompensationSettings, memory: CompensationMemory) -> float:
    """Return L of the current state in s: the usual one, corrected by its jitter."""
    usual = usual_latency(settings)
    most, longest = JITTER * usual, (HISTORY - 2) * settings.period
    return min(usual + min(max(memory.later, -most), most), longest)


# History of commands.


@formula
def _store_command(
    settings: CompensationSettings, memory: CompensationMemory, torque: Numbers
) -> None:
    """Add torques and the last base velocities to the history, from `memory.acts_from` on."""
    command = moving_base.command(settings, memory, torque)
    newest = (memory.history_newest + 1) & (HISTORY - 1)
    write_along(in_place(memory, 'history_command'), newest * len(command), command)
    in_place(memory, 'history_start')[newest] = memory.acts_from
    memory.history_newest = newest


@formula
def _added(total: float, value: float, share: float) -> float:
    return total + share * value


@formula
def _mean_command(
    memory: CompensationMemory, start: float, end: float, template: Numbers
) -> Numbers:
    """Return the mean acting command between two times in s, in the form of `template`."""
    commands, starts = in_place(memory, 'history_command'), in_place(memory, 'history_start')
    newest, count = memory.history_newest, len(template)
    total, until = elementwise(zero, template), end
    for i in range(HISTORY):
        row = (newest - i) & (HISTORY - 1)
        since = starts[row]
        since = start if (since < start) | (i == HISTORY - 1) else since
        if since < until:
            command = read_along(commands, row * count, template)
            total = elementwise(_added, total, command, (until - since) / (end - start))
            until = since
        if until <= start:
            break
    return total


# Model.


@subroutine
def _derivative(
    settings: CompensationSettings,
    theta: Numbers,
    position: Numbers,
    rates: Numbers,
    inputs: Numbers,
    extra: Numbers,
) -> tuple[Numbers, Numbers]:
    """Return the derivatives of positions and joint rates; `extra` is added to accelerations."""
    model = mechanism.model_of(settings)
    posture = mechanism.posture(model, position)
    a = moving_base.accelerations(settings, posture, theta, rates, inputs)
    return mechanism.position_rates(model, posture, rates), elementwise(plus, a, extra)


@formula
def _corrected(value: float, first: float, second: float, half: float) -> float:
    """Return the end of a Heun step from its end by explicit Euler and both derivatives."""
    return value + half * (second - first)


@formula
def _lagging(command: float, motor: float, share: float) -> float:
    """Return a command plus the share of the difference from it that remains."""
    return command + share * (motor - command) if share > 0.0 else command


@kernel
def _advanced(
    settings: CompensationSettings,
    memory: CompensationMemory,
    position: Numbers,
    rates: Numbers,
    motor: Numbers,
    start: float,
    end: float,
) -> tuple[Numbers, Numbers, Numbers]:
    """
    Return positions, joint rates and motor torques at a later time according to the model.

    The model is that of theta_hat, with the commands and d. Heun steps have a length of at most
    LONGEST_STEP; the command of a step is its mean. Before the last measured state, d is
    constant.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    position, rates, motor
        Positions (positions), joint rates (joints) and torques of the motors (joints) at `start`.
    start, end
        Times in s, as those of `CompensationMemory`.

    """
    model, theta = mechanism.model_of(settings), memory.estimate
    period, now = settings.period, memory.state_time
    d, slope = memory.acceleration, memory.acceleration_slope
    steps = max(1, math.ceil((end - start) / LONGEST_STEP - 1.0e-6))
    h, lag = (end - start) / steps, settings.motor_lag
    decay = exp(-h / lag) if lag > 0.0 else 0.0
    mean = (1.0 - decay) * lag / h
    for step in range(steps):
        time = start + step * h
        command = _mean_command(memory, time, time + h, rates)
        acting = elementwise(_lagging, command, motor, mean)
        motor = elementwise(_lagging, command, motor, decay)
        acting = elementwise(selected, settings.by_velocity, command, acting)
        inputs = moving_base.inputs_of_step(settings, rates, acting, h)
        # d is the mean acceleration of the period after the last measured state.
        ahead = max(0.0, (time + 0.5 * h - now) / period - 0.5)
        extra = mechanism.joint_rates(model, elementwise(moved, d, slope, ahead))
        v_1, a_1 = _derivative(settings, theta, position, rates, inputs, extra)
        position = elementwise(moved, position, v_1, h)
        rates = elementwise(moved, rates, a_1, h)
        v_2, a_2 = _derivative(settings, theta, position, rates, inputs, extra)
        position = elementwise(_corrected, position, v_1, v_2, 0.5 * h)
        rates = elementwise(_corrected, rates, a_1, a_2, 0.5 * h)
    return position, rates, motor


# Estimate and prediction.


@formula
def _rate(value: float, before: float, period: float) -> float:
    return (value - before) / period


@formula
def _followed(d: float, slope: float, f: float, gain: float) -> float:
    return d + gain * f + slope


@kernel
def _follow_state(
    settings: CompensationSettings, memory: CompensationMemory, state: State
) -> State:
    """
    Store the last command and the measured state, and update the disturbance estimate.

    Return the state with estimated angles and rates of the joints if rates are not measured.
    """
    period, model = settings.period, mechanism.model_of(settings)
    is_estimated = settings.velocity_source == ESTIMATED
    before, now = memory.state_time, memory.state_time
    position, rates = state.position, state.rates
    if memory.history_initialised == 0:
        if is_estimated:
            rates = elementwise(zero, rates)
        _start(settings, memory, position)
    else:
        _store_command(settings, memory, memory.commanded)
        now = before + (1 + memory.skipped) * period
        elapsed = now - before
        rates_before = memory.measured_rates
        position_before = memory.measured_position
        reached, expected, motor = _advanced(
            settings, memory, position_before, rates_before, memory.motor, before, now
        )
        memory.motor = motor
        gain = backed_off(
            settings,
            model,
            mechanism.posture(model, position),
            state.position_rates,
            rates,
            estimate_gain(settings),
        )
        slope_gain = slope_share(settings) * gain * gain
        if is_estimated:
            bandwidth = filter_bandwidth(settings, BANDWIDTH)
            gains = observer_gains(bandwidth, elapsed, gain, slope_gain)
            missed = elementwise(minus, tail(position, rates), tail(reached, rates))
            angles = elementwise(moved, tail(reached, rates), missed, gains[0])
            base = head(position, memory.measured_base)
            memory.measured_base = base
            position = joined(base, angles)
            rates = elementwise(moved, expected, missed, gains[1] / elapsed)
            f = mechanism.motion(model, elementwise(times, missed, 1.0 / (elapsed * elapsed)))
            gain, slope_gain = gains[2], gains[3]
            # The gain of d includes that of its slope.
            gain = gain - slope_gain
        else:
            f = mechanism.motion(model, elementwise(_rate, rates, expected, elapsed))
        slope = elementwise(moved, memory.acceleration_slope, f, slope_gain)
        d = elementwise(_followed, memory.acceleration, slope, f, gain)
        a = mechanism.motion(model, elementwise(_rate, expected, rates_before, elapsed))
        memory.acceleration = d
        memory.acceleration_slope = slope
        memory.measured_acceleration = a
    memory.state_time = now
    memory.acts_from = now + total_latency(settings, memory) - settings.motor_lag
    memory.skipped = 0
    memory.measured_position = position
    memory.measured_rates = rates
    memory.estimator_initialised = 1
    memory.rates = rates
    return State(position, rates, state.position_rates, state.desired)


@formula
def _start(settings: CompensationSettings, memory: CompensationMemory, position: Numbers) -> None:
    """Assume that the last command acts on the first state, or if it is zero, a balance."""
    torque = memory.commanded
    if torque == elementwise(zero, torque):
        model, theta = mechanism.model_of(settings), memory.estimate
        posture = mechanism.posture(model, position)
        still = elementwise(zero, torque)
        torque = mechanism.joint_torques(model, mechanism.coriolis(model, posture, theta, still))
    memory.acts_from = -math.inf
    memory.history_initialised = 1
    memory.motor = torque
    _store_command(settings, memory, torque)


@formula
def _extrapolated(x: float, v: float, a: float, time: float) -> float:
    return x + time * v + 0.5 * time * time * a


@formula
def _slipped(rate: float, rolling: float, predicted: float) -> float:
    return rate - rolling + predicted


@subroutine
def predicted_state(
    settings: CompensationSettings, memory: CompensationMemory, state: State
) -> State:
    """Return the state in which the next torque starts to act, and the reference of that time."""
    state = _follow_state(settings, memory, state)
    model = mechanism.model_of(settings)
    now, latency = memory.state_time, total_latency(settings, memory)
    position, rates = state.position, state.rates
    if latency > 0.0:
        position, rates, _ = _advanced(
            settings, memory, position, rates, memory.motor, now, now + latency
        )
    x, v, a = state.desired
    lead = latency - settings.stamp_age
    desired = (elementwise(_extrapolated, x, v, a, lead), elementwise(moved, v, a, lead), a)
    rolling = mechanism.position_rates(
        model, mechanism.posture(model, state.position), state.rates
    )
    predicted = mechanism.position_rates(model, mechanism.posture(model, position), rates)
    # Slip of the wheels continues.
    position_rates = elementwise(_slipped, state.position_rates, rolling, predicted)
    if settings.velocity_source == ESTIMATED:
        position_rates = predicted
    return State(position, rates, position_rates, desired)
