# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Compensation of latency for every law: prediction, and a disturbance estimate with a slope.

L is the time from the measurement of a state to the effect of the torque that answers it: the
latency, until this torque starts to act, and the lag of the motors. The estimate compares each
measured state with one step of the model from the previous one, under the torque that acted
meanwhile. Then the model predicts the state after L, in which the law, its reference and its
regressor are evaluated; until then the last command holds. d is an acceleration of the
mechanism's velocities,

    f = (v - v_model) / T,   delta <- delta + beta_2 f,   d <- d + beta f + delta,

and the torque of any law is reduced by H (d + (L / T + 1) delta). Torque that a limit withholds is
added to the next torques. docs/theory/latency.md derives the gains. A base that follows velocities
is predicted by its lag (`moving_base`). Without latency the compiled code contains none of this:
`COMPENSATIONS` selects it.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import NamedTuple

from masmc_ros.aliases import Joints, Numbers, Record
from masmc_ros.jit.arrays import read_along, write_along
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import dot, elementwise, head, joined, tail
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.parts import delay_gains, moving_base
from masmc_ros.law.parts.slip import backed_off
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, filter_bandwidth
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.portable_math import exp
from masmc_ros.numerics.scalars import minus, moved, plus, selected, zero
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import MechanismPosture

OFF, ON = '', 'delay'
"""Tags of records without and with compensation."""

LONGEST = 0.1
"""Largest compensated latency in s."""

HISTORY = 128
"""Stored commands; a power of two. Latency is limited to two periods less."""

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

LONGEST_EXCESS = 0.005
"""
Largest withheld impulse that is added later, relative to the torque limit, in s.

A limit cuts the noise of a torque close to it on one side, which reduces the mean torque. The
added impulse restores the mean. After a real saturation it delays the torque by some milliseconds.
With a limit of the torque rate such a delay would make the loop oscillate, so nothing is added.
"""

LONGEST_STEP = 0.005
"""Longest step of the model in s."""

ADAPTATION_TIME = 0.01
"""Time c in s: the estimates follow sigma = c d."""

SLOWNESS = 8.0
"""Smallest time constant of the adaptation in latencies."""

PARAMETERS = (
    Parameter(
        'latency',
        0.0,
        'Time from the measurement of a state to the first effect of its torque; 0: no '
        'compensation',
        unit='s',
        minimum=0.0,
        maximum=LONGEST,
        read_only=False,
    ),
    Parameter(
        'motor_lag',
        0.0,
        'Time constant of the torques of the motors',
        unit='s',
        minimum=0.0,
        maximum=LONGEST,
        read_only=False,
    ),
    Parameter(
        'compensation.horizon',
        0.0,
        'Time h in which the implicit law reaches the surface, with latency; 0: 1.1 times '
        'the latency and a quarter of motor_lag, plus a period, but at most 1.5 times',
        unit='s',
        minimum=0.0,
        read_only=False,
    ),
    Parameter(
        'compensation.gain',
        0.0,
        'Gain beta of the disturbance estimate with latency; 0: the period divided by the latency '
        'plus a quarter of motor_lag, at most 1/4. Another value enables the estimate without '
        'latency',
        minimum=0.0,
        maximum=1.0,
        read_only=False,
    ),
    Parameter(
        'compensation.slope',
        0.0,
        'Gain beta_2 of the slope of the disturbance estimate, as a multiple of beta squared; 0: '
        '0.25 plus 0.05 periods divided by the latency, at most 0.3',
        minimum=0.0,
        maximum=1.0,
        read_only=False,
    ),
)

SETTINGS = (
    Field('stamp_age', description='Time from the measurement of a state to its stamp', unit='s'),
)
"""Settings that are not parameters."""

MEMORY = (
    Field('acceleration', 'joints', 'Estimated d, in the velocities of the mechanism', '1/s²'),
    Field('acceleration_slope', 'joints', 'Its change delta per period', '1/s²'),
    Field('motor', 'joints', 'Torques of the motors in the last measured state', 'N·m'),
    Field('excess', 'joints', 'Torques that the limit has withheld', 'N·m'),
    Field('measured_position', 'positions', 'Positions of the last measured state', 'm, rad'),
    Field('measured_base', 'base', 'Base pose in it', 'm, rad'),
    Field('measured_rates', 'joints', 'Rates in it, measured or estimated', 'rad/s'),
    Field('measured_acceleration', 'joints', 'Its derivative, of the mechanism', '1/s²'),
    Field('history_command', (HISTORY, 'joints'), 'Commands: torques, base velocities'),
    Field('history_start', HISTORY, 'Times at which they started to act', 's'),
    Field('history_newest', description='Row of the newest one', kind='i8'),
    Field('history_initialised', description='1 after the first tick', kind='i8'),
    Field('state_time', description='Time of the last measured state', unit='s'),
    Field('acts_from', description='Time from which its torque acts', unit='s'),
    Field('skipped', description='Ticks since the last one that were not computed', kind='i8'),
    Field('later', description='Latency of the next state beyond the usual one', unit='s'),
)
"""Memory with compensation; times are those of the measured states."""


class CompensationSettings(Settings):
    """Settings of the law, with the age of stamps that the compensation needs."""

    stamp_age: float


class CompensationMemory(Memory):
    """State of a law with that of this module."""

    acceleration: Joints
    acceleration_slope: Joints
    motor: Joints
    excess: Joints
    measured_position: Numbers
    measured_base: Numbers
    measured_rates: Joints
    measured_acceleration: Joints
    history_command: Numbers
    history_start: Numbers
    history_newest: int
    history_initialised: int
    state_time: float
    acts_from: float
    skipped: int
    later: float


ENABLING = ('latency', 'motor_lag', 'compensation.gain')
"""Parameters that enable the compensation if one of them is not zero."""


def is_compensated(values: Values) -> bool:
    """Return True if a controller with these parameter values compensates latency."""
    return any(values[name] > 0.0 for name in ENABLING)


class State(NamedTuple):
    """State and reference in which a law is evaluated; SI units."""

    position: Numbers
    rates: Numbers  # of the joints
    position_rates: Numbers
    desired: tuple[Numbers, Numbers, Numbers]  # x_d, xdot_d and xddot_d


@formula
def _same_state(settings: Settings, memory: Memory, state: State) -> State:
    return state


@formula
def _same_torque(
    settings: Settings, memory: Memory, posture: MechanismPosture, raw: Numbers
) -> Numbers:
    return raw


@formula
def _error_of_law(
    settings: Settings, memory: Memory, desired: Numbers, rate: Numbers, error: Numbers
) -> Numbers:
    return error


@formula
def _tracking_gradient(settings: Settings, memory: Memory, tick: Tick) -> Numbers:
    """Return Y' sigma of (23)."""
    w = mechanism.motion_error(
        tick.model, tick.posture, tick.velocity, tick.reference_velocity, tick.surface
    )
    return mechanism.regressor_transpose_times(tick.model, tick.regressor, w, tick.nominal)


@formula
def _one_period(settings: Settings) -> float:
    return settings.period


@formula
def _never(settings: Settings) -> bool:
    return False


@formula
def _always(settings: Settings) -> bool:
    return True


@formula
def _usual_latency(settings: Settings) -> float:
    return settings.latency + settings.motor_lag


@formula
def total_latency(settings: CompensationSettings, memory: CompensationMemory) -> float:
    """Return L of the current state in s: the usual one, corrected by its jitter."""
    usual = _usual_latency(settings)
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


@formula
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
        Times in s, as those of `MEMORY`.

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
def _times(value: float, factor: float) -> float:
    return value * factor


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
            delay_gains.estimate_gain(settings),
        )
        slope_gain = delay_gains.slope(settings) * gain * gain
        if is_estimated:
            bandwidth = filter_bandwidth(settings, BANDWIDTH)
            gains = delay_gains.observer_gains(bandwidth, elapsed, gain, slope_gain)
            missed = elementwise(minus, tail(position, rates), tail(reached, rates))
            angles = elementwise(moved, tail(reached, rates), missed, gains[0])
            base = head(position, memory.measured_base)
            memory.measured_base = base
            position = joined(base, angles)
            rates = elementwise(moved, expected, missed, gains[1] / elapsed)
            f = mechanism.motion(model, elementwise(_times, missed, 1.0 / (elapsed * elapsed)))
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


@formula
def _predicted_state(
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


@formula
def _last_command(settings: Settings, memory: Memory) -> Numbers:
    return memory.velocity_command


@formula
def _explaining_command(settings: CompensationSettings, memory: CompensationMemory) -> Numbers:
    d = memory.acceleration
    return moving_base.equivalent_command(settings, memory.velocity_command, d)


@formula
def _with_excess(raw: float, excess: float) -> float:
    """Return a request with the withheld torque, unless the request has turned."""
    return raw + excess if raw * excess > 0.0 else raw


@formula
def _excess(raw: float, limit: float, rate_limit: float, share: float) -> float:
    """Return what the limit withholds of a torque, within a share of the limit."""
    most = 0.0 if rate_limit > 0.0 else share * limit
    return min(max(raw - min(max(raw, -limit), limit), -most), most)


@formula
def _reduced_torque(
    settings: CompensationSettings,
    memory: CompensationMemory,
    posture: MechanismPosture,
    raw: Numbers,
) -> Numbers:
    """Return raw - H d, the torque of a law less that of d, at the time at which it acts."""
    model = mechanism.model_of(settings)
    ahead = total_latency(settings, memory) / settings.period + 1.0
    d = elementwise(moved, memory.acceleration, memory.acceleration_slope, ahead)
    h = mechanism.inertia(model, posture, memory.estimate)
    force = mechanism.inertia_times(model, h, d)
    raw = elementwise(minus, raw, mechanism.joint_torques(model, force))
    raw = elementwise(_with_excess, raw, memory.excess)
    longest = LONGEST_EXCESS / settings.period
    memory.excess = elementwise(
        _excess, raw, settings.torque_limit, settings.torque_rate_limit, longest
    )
    return raw


@formula
def _measured_error(
    settings: CompensationSettings,
    memory: CompensationMemory,
    desired: Numbers,
    rate: Numbers,
    error: Numbers,
) -> Numbers:
    """Return the task error (axes) of the measured state at the time of its measurement."""
    model, position = mechanism.model_of(settings), memory.measured_position
    then = elementwise(moved, desired, rate, -settings.stamp_age)
    return mechanism.task_error(model, mechanism.posture(model, position), position, then)


@formula
def _relative(gradient: float, nominal: float) -> float:
    return gradient * nominal * nominal


@formula
def _measured_gradient(
    settings: CompensationSettings, memory: CompensationMemory, tick: Tick
) -> Numbers:
    """
    Return Y' c d of the measured state and its estimated acceleration.

    Steps are relative to theta, as those of natural adaptation. The adaptation must be slower
    than d. Its rate is that at which a step of theta_hat reduces d, in the metric of H; a factor
    limits it to 1 / (SLOWNESS (L + T)).
    """
    model, theta = tick.model, memory.estimate
    posture = mechanism.posture(model, memory.measured_position)
    v = mechanism.motion(model, memory.measured_rates)
    d = moving_base.by_torque(settings, memory.acceleration)
    y = mechanism.regressor(model, posture, v, v, memory.measured_acceleration)
    w = elementwise(_times, d, ADAPTATION_TIME)
    along = mechanism.regressor_transpose_times(model, y, w, tick.nominal)
    if not mechanism.preserves_consistency(model, settings):
        along = elementwise(_relative, along, tick.nominal)
    adapted = mechanism.theta_step(model, settings, theta, along, tick.period)
    change = elementwise(
        minus,
        mechanism.regressor_times(model, y, adapted),
        mechanism.regressor_times(model, y, theta),
    )
    h = mechanism.inertia(model, posture, theta)
    energy = tick.period * dot(d, mechanism.inertia_times(model, h, d))
    reduction = max(0.0, dot(d, change))
    time = SLOWNESS * (_usual_latency(settings) + tick.period)
    whole = energy + time * reduction
    return elementwise(_times, along, energy / whole if whole > 0.0 else 0.0)


COMPENSATIONS = {
    OFF: SimpleNamespace(
        state_of_torque=_same_state,
        base_command=_last_command,
        reduced_torque=_same_torque,
        error=_error_of_law,
        gradient=_tracking_gradient,
        horizon=_one_period,
        is_on=_never,
    ),
    ON: SimpleNamespace(
        state_of_torque=_predicted_state,
        base_command=_explaining_command,
        reduced_torque=_reduced_torque,
        error=_measured_error,
        gradient=_measured_gradient,
        horizon=delay_gains.horizon,
        is_on=_always,
    ),
}
"""Formulas by the tag `compensation` of the settings of a law."""

_dispatch = interface(by_tag('compensation', COMPENSATIONS.__getitem__))


@_dispatch
def state_of_torque(settings: Settings, memory: Memory, state: State) -> State:
    """
    Return the state and the reference in which the law is evaluated.

    Without compensation it is the measured state. With compensation it is the state predicted
    over L, and the disturbance estimate is updated first.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    state
        Measured state, and reference of its stamp.

    """


@_dispatch
def base_command(settings: Settings, memory: Memory) -> Numbers:
    """
    Return the commanded velocities (joints) by which a base with a lag moves.

    They are those of the last tick. With compensation they include the effect of d.
    """


@_dispatch
def reduced_torque(
    settings: Settings, memory: Memory, posture: MechanismPosture, raw: Numbers
) -> Numbers:
    """
    Return the joint torques (joints) in N·m less those that cancel d; `raw` without compensation.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    posture
        Posture of the state in which the law was evaluated.
    raw
        Joint torques of the law in N·m.

    """


@_dispatch
def error(
    settings: Settings, memory: Memory, desired: Numbers, rate: Numbers, error: Numbers
) -> Numbers:
    """
    Return the task error (axes) to publish, which is that of the measured state.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    desired, rate
        x_d and xdot_d (axes) of the stamp of the state.
    error
        Error of the state in which the law was evaluated; it is returned without compensation.

    """


@_dispatch
def gradient(settings: Settings, memory: Memory, tick: Tick) -> Numbers:
    """
    Return the gradient (parameters) along which theta_hat is adapted.

    It is Y' sigma of (23) without compensation, otherwise Y' c d of the measured state.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    tick
        State and reference in which the law was evaluated.

    """


@_dispatch
def horizon(settings: Settings) -> float:
    """Return the time in s in which the implicit law reaches the surface: h, or T if disabled."""


@_dispatch
def is_on(settings: Settings | Record) -> bool:
    """Return True if d is estimated here; laws then estimate no disturbance themselves."""
