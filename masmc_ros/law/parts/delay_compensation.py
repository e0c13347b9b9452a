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

Adaptation under latency uses the measured state. The predicted state depends on theta_hat, so its
error does not show that of theta_hat. The acceleration d that the model does not explain does.
"""

from __future__ import annotations

from types import SimpleNamespace

from masmc_ros.aliases import Numbers, Record
from masmc_ros.jit.compiled import formula, subroutine
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.parts import delay_prediction, moving_base
from masmc_ros.law.parts.delay_fields import CompensationMemory, CompensationSettings, HISTORY
from masmc_ros.law.parts.delay_prediction import (
    predicted_state,
    State,
    total_latency,
    usual_latency,
)
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, moved, times
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import MechanismPosture

ADAPTATION_TIME = 0.01
"""Time c in s: the estimates follow sigma = c d."""

SLOWNESS = 8.0
"""Smallest time constant of the adaptation in latencies."""


@formula
def _relative(gradient: float, nominal: float) -> float:
    return gradient * nominal * nominal


@subroutine
def measured_gradient(
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
    w = elementwise(times, d, ADAPTATION_TIME)
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
    time = SLOWNESS * (usual_latency(settings) + tick.period)
    whole = energy + time * reduction
    return elementwise(times, along, energy / whole if whole > 0.0 else 0.0)


OFF, ON = '', 'delay'
"""Tags of records without and with compensation."""

LONGEST_EXCESS = 0.005
"""
Largest withheld impulse that is added later, relative to the torque limit, in s.

A limit cuts the noise of a torque close to it on one side, which reduces the mean torque. The
added impulse restores the mean. After a real saturation it delays the torque by some milliseconds.
With a limit of the torque rate such a delay would make the loop oscillate, so nothing is added.
"""


@formula
def _always(settings: Settings) -> bool:
    return True


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
def _counted(settings: CompensationSettings, memory: CompensationMemory, periods: int) -> None:
    memory.skipped += periods
    if memory.skipped > HISTORY:
        memory.history_initialised = 0


COMPENSATIONS = {
    OFF: SimpleNamespace(),
    ON: SimpleNamespace(
        state_of_torque=predicted_state,
        base_command=_explaining_command,
        reduced_torque=_reduced_torque,
        error=_measured_error,
        gradient=measured_gradient,
        horizon=delay_prediction.horizon,
        is_on=_always,
        note_skipped=_counted,
    ),
}
"""Formulas by the tag `compensation` of the settings of a law; bodies below are those of OFF."""

_dispatch = interface(by_tag('compensation', COMPENSATIONS.__getitem__), formula)


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
    return state


@_dispatch
def base_command(settings: Settings, memory: Memory) -> Numbers:
    """
    Return the commanded velocities (joints) by which a base with a lag moves.

    They are those of the last tick. With compensation they include the effect of d.
    """
    return memory.velocity_command


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
    return raw


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
    return error


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
    w = mechanism.motion_error(
        tick.model, tick.posture, tick.velocity, tick.reference_velocity, tick.surface
    )
    return mechanism.regressor_transpose_times(tick.model, tick.regressor, w, tick.nominal)


@_dispatch
def horizon(settings: Settings) -> float:
    """Return the time in s in which the implicit law reaches the surface: h, or T if disabled."""
    return settings.period


@_dispatch
def is_on(settings: Settings | Record) -> bool:
    """Return True if d is estimated here; laws then estimate no disturbance themselves."""
    return False


@_dispatch
def note_skipped(settings: Settings, memory: Memory, periods: int) -> None:
    """
    Account for periods without a tick.

    The compensation restarts if they exceed its history of commands.
    """
