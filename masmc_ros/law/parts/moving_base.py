# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Laws of an arm on a base that follows velocities: `command_interface` hybrid.

The base follows its velocities b by its own drives, with a first-order lag `base_lag`. Only the
arm is driven by torques. In the coordinates of commands, c = (b, a), a are the rates of the arm
joints. The command of the base is its reference b_r with the lead base_lag d(b_r)/dt. The arm uses
the true motion of the base and compensates its lag,

    J_a a' = J_a a_r + J_b (b_r - b),    c' = (b, a'),    s = J (c - c') = J_a (a - a'),

by damped least squares if J_a cannot be inverted. Laws then use c' and its derivative in place of
the reference motion. They request torques of the arm: those of the base are zero.

The compensation of latency predicts this robot as well: b by its lag from the commanded
velocities, and the arm by its torques and the acceleration of the base. It estimates what the lag
does not explain of b', and a' includes it.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

from masmc_ros.aliases import Numbers
from masmc_ros.jit.arrays import array_of, to_vector, write_part
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise, unit
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.numerics.elimination import solve_definite
from masmc_ros.numerics.portable_math import exp
from masmc_ros.numerics.scalars import minus, moved, plus, selected, zero
from masmc_ros.params.declaration import Parameter
from masmc_ros.plant_model.drives import lagging
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture

BASE_LAG = Parameter(
    'base_lag',
    0.0,
    'Time constant with which the base follows cmd_vel, with command_interface hybrid',
    unit='s',
    minimum=0.0,
    maximum=10.0,
    read_only=False,
)
"""Parameter of the controller, and of the plant with its true value."""

_DAMPING = 1e-5
"""Square of the damping of J_a, in the squared units of J."""

BY_TORQUE, BY_VELOCITY = 'torque', 'velocity'
"""Values of the tag `base` of settings."""


class Carried(NamedTuple):
    """Reference velocities v_r and accelerations a_r of a law, and the commanded velocities."""

    velocity: Numbers
    acceleration: Numbers
    command: Numbers


@formula
def _motion(model: Lengths, command: Numbers) -> Numbers:
    """Return velocities of the mechanism from the coordinates of commands."""
    return mechanism.motion(model, mechanism.commanded_joint_rates(model, command))


@kernel
def rates_by_torque(
    model: Lengths,
    posture: MechanismPosture,
    mask: tuple[int, ...],
    missing: Numbers,
    template: Numbers,
) -> Numbers:
    """
    Return rates of the arm with J_a a = missing, by damped least squares; those of the base are 0.

    Parameters
    ----------
    model, posture
        Lengths, and posture of the state.
    mask
        1 for joints that follow velocities, 0 for the others (joints).
    missing
        Task velocity (axes).
    template
        Vector (joints) whose kind and length the result has.

    """
    size, m = len(template), len(missing)
    columns, work, right = scratch(size, m), scratch(m, m + 1), array_of(missing)
    for i in range(m):
        for j in range(m):
            work[i, j] = _DAMPING if i == j else 0.0
        work[i, m] = right[i]
    for k in range(size):
        rates = _motion(model, unit(template, k))
        write_part(columns, k, 0, mechanism.task_velocity(model, posture, rates))
        share = 0.0 if mask[k] != 0 else 1.0
        for i in range(m):
            columns[k, i] *= share
        for i in range(m):
            for j in range(m):
                work[i, j] += columns[k, i] * columns[k, j]
    solve_definite(m, work)
    out = scratch(size)
    for k in range(size):
        total = 0.0
        for i in range(m):
            total += columns[k, i] * work[i, m]
        out[k] = total
    return to_vector(out, template)


@formula
def _approached(command: float, rate: float, lag: float, otherwise: float) -> float:
    """Return the acceleration of a base under the last command."""
    return (command - rate) / lag if lag > 0.0 else otherwise


@formula
def _derivative(damped: float, rate: float, reference: float, damping: float) -> float:
    """Return d(v_r)/dt, from a_r = d(v_r)/dt - damping (v - v_r)."""
    return damped + damping * (rate - reference)


@formula
def _damped(derivative: float, rate: float, reference: float, damping: float) -> float:
    return derivative - damping * (rate - reference)


@formula
def _only(mask: int, value: float) -> float:
    return value if mask != 0 else 0.0


@formula
def _carried(
    settings: Settings,
    posture: MechanismPosture,
    v: Numbers,
    v_r: Numbers,
    a_r: Numbers,
    commanded: Numbers,
) -> Carried:
    model, mask = mechanism.model_of(settings), settings.by_velocity
    lag, damping = settings.base_lag, mechanism.reference_damping(model)
    rates, wanted = mechanism.rate_command(model, v), mechanism.rate_command(model, v_r)
    change = elementwise(
        _derivative, mechanism.rate_command(model, a_r), rates, wanted, damping
    )
    lead = 0.5 * settings.period + lag
    command = elementwise(_only, mask, elementwise(moved, wanted, change, lead))
    acceleration = elementwise(_approached, commanded, rates, lag, change)
    late = elementwise(_only, mask, elementwise(minus, wanted, rates))
    late_change = elementwise(_only, mask, elementwise(minus, change, acceleration))
    missing = mechanism.task_velocity(model, posture, _motion(model, late))
    missing_change = mechanism.task_velocity(model, posture, _motion(model, late_change))
    more = rates_by_torque(model, posture, mask, missing, rates)
    more_change = rates_by_torque(model, posture, mask, missing_change, rates)
    followed = elementwise(selected, mask, rates, elementwise(plus, wanted, more))
    change = elementwise(selected, mask, acceleration, elementwise(plus, change, more_change))
    damped = elementwise(_damped, change, rates, followed, damping)
    return Carried(_motion(model, followed), _motion(model, damped), command)


@formula
def _surface_by_torque(
    settings: Settings, posture: MechanismPosture, v: Numbers, v_r: Numbers, s: Numbers
) -> Numbers:
    model = mechanism.model_of(settings)
    return mechanism.task_velocity(model, posture, elementwise(minus, v, v_r))


@formula
def _torque_of_others(
    settings: Settings, memory: Memory, command: Numbers, raw: Numbers
) -> Numbers:
    memory.velocity_command = command
    mask = settings.by_velocity
    return elementwise(selected, mask, elementwise(zero, raw), raw)


@formula
def _others_only(settings: Settings, v: Numbers) -> Numbers:
    model = mechanism.model_of(settings)
    rates = mechanism.rate_command(model, v)
    still = elementwise(zero, rates)
    return _motion(model, elementwise(selected, settings.by_velocity, still, rates))


@formula
def _drift_by_torque(settings: Settings, memory: Memory, posture: MechanismPosture) -> None:
    model, mask = mechanism.model_of(settings), settings.by_velocity
    drift = mechanism.rate_command(model, _others_only(settings, memory.drift))
    seen = mechanism.task_velocity(model, posture, _motion(model, drift))
    drift = elementwise(minus, drift, rates_by_torque(model, posture, mask, seen, drift))
    memory.drift = _motion(model, drift)


@formula
def _command_of_both(settings: Settings, memory: Memory, torque: Numbers) -> Numbers:
    return elementwise(selected, settings.by_velocity, memory.velocity_command, torque)


@formula
def _mean_acceleration(command: float, rate: float, decay: float, h: float) -> float:
    """Return the mean acceleration of a first-order lag over a step of h s; 0 for a decay of 1."""
    return (lagging(command, rate, decay, 1) - rate) / h


@formula
def _inputs_of_both(settings: Settings, rates: Numbers, command: Numbers, h: float) -> Numbers:
    model, lag = mechanism.model_of(settings), settings.base_lag
    decay = exp(-h / lag) if lag > 0.0 else 1.0
    before = mechanism.rate_command(model, mechanism.motion(model, rates))
    acceleration = elementwise(_mean_acceleration, command, before, decay, h)
    return elementwise(selected, settings.by_velocity, acceleration, command)


@formula
def _equivalent_velocity(command: float, acceleration: float, lag: float) -> float:
    return command + lag * acceleration


@formula
def _equivalent_of_both(settings: Settings, command: Numbers, d: Numbers) -> Numbers:
    d = mechanism.rate_command(mechanism.model_of(settings), d)
    return elementwise(_equivalent_velocity, command, d, settings.base_lag)


@kernel
def accelerations_on_base(
    model: Lengths,
    posture: MechanismPosture,
    theta: Numbers,
    mask: tuple[int, ...],
    rates: Numbers,
    inputs: Numbers,
) -> Numbers:
    """
    Return the accelerations of the joints (joints): those of the base are given.

    In the coordinates of commands, the rows of the arm are H_aa a' = tau_a - n_a - H_ab b'.

    Parameters
    ----------
    model, posture
        Lengths, and posture of the state.
    theta
        Inertial parameters (parameters) of the model.
    mask
        1 for joints that follow velocities, 0 for the others (joints).
    rates
        Rates (joints) of the joints.
    inputs
        b' of the base, then torques of the arm (joints).

    """
    size, h = len(rates), mechanism.inertia(model, posture, theta)
    still = elementwise(zero, rates)
    base = elementwise(selected, mask, inputs, still)
    force = mechanism.inertia_times(model, h, _motion(model, base))
    bias = mechanism.coriolis(model, posture, theta, mechanism.motion(model, rates))
    needed = mechanism.joint_torques(model, elementwise(plus, bias, force))
    right = array_of(elementwise(minus, inputs, needed))
    work, out = scratch(size, size + 1), scratch(size)
    for k in range(size):
        force = mechanism.inertia_times(model, h, _motion(model, unit(rates, k)))
        column = array_of(mechanism.joint_torques(model, force))
        is_driven = mask[k] == 0
        for i in range(size):
            work[i, k] = column[i] if is_driven and mask[i] == 0 else (1.0 if i == k else 0.0)
        work[k, size] = right[k] if is_driven else 0.0
    solve_definite(size, work)
    for k in range(size):
        out[k] = work[k, size]
    others = to_vector(out, rates)
    return mechanism.commanded_joint_rates(model, elementwise(plus, base, others))


@formula
def _accelerations_of_both(
    settings: Settings,
    posture: MechanismPosture,
    theta: Numbers,
    rates: Numbers,
    inputs: Numbers,
) -> Numbers:
    model, mask = mechanism.model_of(settings), settings.by_velocity
    return accelerations_on_base(model, posture, theta, mask, rates, inputs)


@formula
def _yes(settings: Settings) -> bool:
    return True


_FORMULAS = {
    BY_TORQUE: SimpleNamespace(),
    BY_VELOCITY: SimpleNamespace(
        carried=_carried,
        surface=_surface_by_torque,
        commanded_torque=_torque_of_others,
        restrict_drift=_drift_by_torque,
        command=_command_of_both,
        equivalent_command=_equivalent_of_both,
        inputs_of_step=_inputs_of_both,
        accelerations=_accelerations_of_both,
        by_torque=_others_only,
        moves_by_velocity=_yes,
    ),
}
"""Formulas by the tag `base` of the settings of a law; those of BY_TORQUE are the bodies below."""

_dispatch = interface(by_tag('base', _FORMULAS.__getitem__), formula)


@_dispatch
def carried(
    settings: Settings,
    posture: MechanismPosture,
    v: Numbers,
    v_r: Numbers,
    a_r: Numbers,
    commanded: Numbers,
) -> Carried:
    """
    Return the reference motion of a law, on a base that follows velocities or on any other.

    The motion is unmodified if no joint follows velocities.

    Parameters
    ----------
    settings
        Settings of the law.
    posture
        Posture of the state.
    v, v_r, a_r
        Velocities of the mechanism, their reference and its derivative (joints).
    commanded
        Velocities (joints) that were commanded at the last tick, in the coordinates of commands.

    """
    return Carried(v_r, a_r, commanded)


@_dispatch
def surface(
    settings: Settings, posture: MechanismPosture, v: Numbers, v_r: Numbers, s: Numbers
) -> Numbers:
    """
    Return the part of the sliding surface (axes) that joints with torques can reduce.

    Parameters
    ----------
    settings
        Settings of the law.
    posture
        Posture of the state.
    v, v_r
        Velocities of the mechanism, and their reference (joints) of `carried`.
    s
        Sliding surface (axes).

    """
    model = mechanism.model_of(settings)
    return mechanism.reachable_surface(model, posture, v, v_r, s)


@_dispatch
def commanded_torque(
    settings: Settings, memory: Memory, command: Numbers, raw: Numbers
) -> Numbers:
    """
    Store the commanded velocities, and return the joint torques with zeros for the base.

    Without joints that follow velocities, the torques are unmodified.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    command
        Commanded velocities (joints) of `carried`.
    raw
        Joint torques (joints) of the law in N·m.

    """
    return raw


@_dispatch
def restrict_drift(settings: Settings, memory: Memory, posture: MechanismPosture) -> None:
    """Restrict `memory.drift` to motions of the arm in the null space of the task."""


@_dispatch
def command(settings: Settings, memory: Memory, torque: Numbers) -> Numbers:
    """
    Return the last command (joints): the last velocities of the base, and torques.

    Parameters
    ----------
    settings, memory
        Settings and memory of the law.
    torque
        Joint torques (joints) in N·m.

    """
    return torque


@_dispatch
def equivalent_command(settings: Settings, command: Numbers, d: Numbers) -> Numbers:
    """
    Return the commanded velocities (joints) that explain d of the base as well, by its lag.

    Parameters
    ----------
    settings
        Settings of the law.
    command
        Commanded velocities (joints), in the coordinates of commands.
    d
        Accelerations (joints) of the mechanism that the model does not explain.

    """
    return command


@_dispatch
def inputs_of_step(settings: Settings, rates: Numbers, command: Numbers, h: float) -> Numbers:
    """
    Return the inputs (joints) of `accelerations` in a step: b' of the base, and torques.

    Without a lag commands do not explain b', which is zero.

    Parameters
    ----------
    settings
        Settings of the law.
    rates
        Rates (joints) of the joints at the start of the step.
    command
        Mean `command` (joints) in the step.
    h
        Length of the step in s.

    """
    return command


@_dispatch
def accelerations(
    settings: Settings,
    posture: MechanismPosture,
    theta: Numbers,
    rates: Numbers,
    inputs: Numbers,
) -> Numbers:
    """
    Return the accelerations of the joints (joints) according to the model.

    Parameters
    ----------
    settings
        Settings of the law.
    posture
        Posture of the state.
    theta
        Inertial parameters (parameters) of the model.
    rates
        Rates (joints) of the joints.
    inputs
        Result of `inputs_of_step` (joints).

    """
    model = mechanism.model_of(settings)
    return mechanism.joint_accelerations(model, posture, theta, rates, inputs)


@_dispatch
def by_torque(settings: Settings, v: Numbers) -> Numbers:
    """Return velocities of the mechanism, or their derivatives, without those of the base."""
    return v


@_dispatch
def moves_by_velocity(settings: Settings) -> bool:
    """Return True if the base follows velocities; the torques of its drives are then unknown."""
    return False
