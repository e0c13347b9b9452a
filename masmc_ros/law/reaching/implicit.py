# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Implicit reaching law: sliding mode without chatter and without a boundary layer.

Implicit Euler discretisation of the set-valued law (V. Acary and B. Brogliato, "Implicit
Euler numerical scheme and chattering-free implementation of sliding mode systems", Systems
and Control Letters 59, 2010): the switching term belongs to the *next* sample's surface s+,

    (H_x + T K_s1) s+ + T K_s2 zeta = H_x s,    zeta in Sgn(s+),    u = -K_s1 s+ - K_s2 zeta,

with the task-space inertia H_x of the nominal model. On the surface, s+ = 0 and zeta takes the
value that keeps it there.

The prediction error s_k - s+_{k-1} is an impulse of the disturbance. The estimate d follows it:
d_k = d_{k-1} + (beta / T) H_x (s_k - s+_{k-1}), and u -= d. Slip of wheels reduces beta:
`parts.slip`.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Axes, Columns, Joints, Numbers
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import called_kernel, formula
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise, least, matrix_times, tail
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.parts.delay_compensation import horizon, is_on
from masmc_ros.law.parts.inverse_dynamics import limited_acceleration
from masmc_ros.law.parts.slip import backed_off, SLIP_BACKOFF
from masmc_ros.law.reaching.reaching import GAINS, Reaching, SHORTCUT
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.elimination import solve_definite
from masmc_ros.numerics.scalars import minus, moved, times, zero
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism

OBSERVER_GAIN = Parameter(
    'observer_gain',
    0.5,
    'Gain beta of the disturbance estimate of the implicit law; 0: no estimate',
    minimum=0.0,
    maximum=1.0,
    read_only=False,
)


# About two steps per axis suffice; the bound only prevents endless loops by rounding.
_STEPS = 200
_TOLERANCE = 1.0e-13
_NO_SIDE = 2.0


@formula
def _followed(disturbance: float, impulse: float, gain_per_period: float) -> float:
    """Return the next disturbance estimate of one axis in N."""
    return disturbance + gain_per_period * impulse


@formula
def disturbance_estimate(
    inertia: Columns, s: Numbers, predicted: Numbers, gain_per_period: float, disturbance: Numbers
) -> Numbers:
    """
    Return the next estimate in N.

    `inertia` has the columns of H_x in kg. `predicted` is s+ of the previous tick in m/s, or NaN
    without one. `gain_per_period` is beta / T in 1/s.
    """
    impulse = matrix_times(inertia, elementwise(minus, s, predicted))
    following = elementwise(_followed, disturbance, impulse, gain_per_period)
    is_off = (gain_per_period == 0.0) | (predicted[0] != predicted[0])
    return disturbance if is_off else following


@formula
def _holds(force: float, box: float) -> float:
    """Return 1 if the box of one axis, T K_s2, keeps it on the surface, otherwise 0."""
    has_box = box > 0.0
    ratio = abs(force) / (box if has_box else 1.0)
    return 0.0 if (not has_box) | (ratio > 1.0 + _TOLERANCE) else 1.0


@formula
def solution(
    inertia: Columns, period: float, k_s1: Numbers, k_s2: Numbers, s: Numbers
) -> tuple[Numbers, Numbers]:
    """Return s+ in m/s and zeta."""
    force = matrix_times(inertia, s)
    box = elementwise(times, k_s2, period)
    # If all axes stay on the surface, there is nothing to solve.
    if least(elementwise(_holds, force, box)) > 0.0:
        return elementwise(zero, s), elementwise(_within, force, box)
    return _solved(inertia, period, k_s1, k_s2, s)


@called_kernel
def _solved(
    inertia: Columns, period: float, k_s1: Numbers, k_s2: Numbers, s: Numbers
) -> tuple[Numbers, Numbers]:
    """Return s+ in m/s and zeta, computed by `implicit_reaching`."""
    n = len(s)
    following, zeta, work, matrix = scratch(n), scratch(n), scratch(n, n + 1), scratch(n, n)
    for j in range(n):
        for i in range(n):
            matrix[i, j] = inertia[j][i]
    implicit_reaching(n, matrix, period, k_s1, k_s2, s, following, zeta, work)
    return to_vector(following, s), to_vector(zeta, s)


@formula
def _pushed(k_s1: float, following: float, k_s2: float, zeta: float, disturbance: float) -> float:
    """Return u on one axis in N."""
    return -(k_s1 * following + k_s2 * zeta) - disturbance


@formula
def _reached(
    settings: Settings, tick: Tick, memory: Memory, inertia: Columns, following: Axes, zeta: Axes
) -> Axes:
    """Return the reaching force of a solution, and store s+ and the disturbance estimate."""
    disturbance = memory.disturbance
    if not is_on(settings):
        gain = backed_off(
            settings,
            tick.model,
            tick.posture,
            tick.position_rates,
            tail(tick.position_rates, tick.velocity),
            settings.observer_gain,
        )
        disturbance = disturbance_estimate(
            inertia,
            tick.surface,
            memory.predicted,
            gain / tick.period,
            disturbance,
        )
    memory.disturbance = disturbance
    memory.predicted = following
    return elementwise(_pushed, settings.k_s1, following, settings.k_s2, zeta, disturbance)


@formula
def reach(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the reaching force, and store s+ and the disturbance estimate."""
    inertia = mechanism.task_inertia(tick.model, tick.posture, tick.nominal, tick.surface)
    k_s1, k_s2 = settings.k_s1, settings.k_s2
    following, zeta = solution(inertia, horizon(settings), k_s1, k_s2, tick.surface)
    return _reached(settings, tick, memory, inertia, following, zeta)


@formula
def reach_on_surface(settings: Settings, tick: Tick, memory: Memory) -> Axes:
    """Return the force if all axes stay on the surface; count other cases in `needs_full`."""
    inertia = mechanism.task_inertia(tick.model, tick.posture, tick.nominal, tick.surface)
    force = matrix_times(inertia, tick.surface)
    box = elementwise(times, settings.k_s2, tick.period)
    memory.needs_full += 1.0 - least(elementwise(_holds, force, box))
    zeta = elementwise(_within, force, box)
    return _reached(settings, tick, memory, inertia, elementwise(zero, tick.surface), zeta)


@formula
def correct(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """
    Add the effect of torque limits to s+: T J H^-1 (torque - raw torque).

    The disturbance estimate then does not follow the effect of the limits.
    """
    if torque != raw:
        change = limited_acceleration(tick, tick.nominal, raw, torque)
        predicted = elementwise(moved, memory.predicted, change, tick.period)
        memory.predicted = predicted


@formula
def correct_nothing(
    settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints
) -> None:
    """Count in `needs_full` if torque limits changed the torque."""
    memory.needs_full += 0.0 if torque == raw else 1.0


@formula
def implicit_reaching(
    n: int,
    inertia: Array,
    period: float,
    k_s1: Numbers,
    k_s2: Numbers,
    s: Numbers,
    following: Array,
    zeta: Array,
    work: Array,
) -> None:
    """
    Solve for s+ (`following`, n, m/s) and zeta (n).

    s+ minimises the strictly convex function s+' A s+ / 2 - (H_x s)' s+ + sum T K_s2 |s+|,
    A = H_x + T K_s1. A primal active-set method finds it exactly: axes start on the surface, and
    the one that exceeds its box most leaves it. With known sides the problem is a linear system.
    An axis that would cross the surface returns to it. Every step decreases the function, so no
    set of sides occurs twice. `work` is (n, n + 1).
    """
    for i in range(n):
        following[i] = 0.0
        # Side on which an axis ends; an axis without a switching gain has no side.
        zeta[i] = 0.0 if period * k_s2[i] > 0.0 else _NO_SIDE
    for _ in range(_STEPS):
        _minimise_on_sides(n, inertia, period, k_s1, k_s2, s, zeta, work)
        if _move_on_sides(n, following, zeta, work):
            continue
        leaving = _exceeded_most(n, inertia, period, k_s2, s, following, zeta)
        if leaving < 0:
            break
        force = _force(n, inertia, s, following, leaving)
        zeta[leaving] = 1.0 if force > 0.0 else -1.0
    for i in range(n):
        if zeta[i] == 0.0:
            zeta[i] = _within(_force(n, inertia, s, following, i), period * k_s2[i])
        elif zeta[i] == _NO_SIDE:
            zeta[i] = 0.0


@formula
def _minimise_on_sides(
    n: int,
    inertia: Array,
    period: float,
    k_s1: Numbers,
    k_s2: Numbers,
    s: Numbers,
    side: Array,
    work: Array,
) -> None:
    """Write the minimiser with these sides into the last column of `work`."""
    for i in range(n):
        stays = side[i] == 0.0
        right = 0.0
        for j in range(n):
            right += inertia[i, j] * s[j]
            work[i, j] = 0.0 if stays or side[j] == 0.0 else inertia[i, j]
        right -= period * k_s2[i] * side[i] if side[i] != _NO_SIDE else 0.0
        work[i, i] = 1.0 if stays else inertia[i, i] + period * k_s1[i]
        work[i, n] = 0.0 if stays else right
    # A pivot is zero only if an axis has neither inertia, in a singular task, nor gain. It does
    # not move.
    solve_definite(n, work)


@formula
def _move_on_sides(n: int, following: Array, side: Array, work: Array) -> bool:
    """Move to the minimiser, or until an axis meets the surface; return True in that case."""
    part = 1.0
    meeting = -1
    for i in range(n):
        if abs(side[i]) == 1.0 and work[i, n] * side[i] < 0.0:
            reach = following[i] / (following[i] - work[i, n])
            if reach < part:
                part = reach
                meeting = i
    for i in range(n):
        move = part * (work[i, n] - following[i])
        following[i] = work[i, n] if meeting < 0 else following[i] + move
    if meeting >= 0:
        following[meeting] = 0.0
        side[meeting] = 0.0
    return meeting >= 0


@formula
def _exceeded_most(
    n: int, inertia: Array, period: float, k_s2: Numbers, s: Numbers, following: Array, side: Array
) -> int:
    """Return the axis on the surface that exceeds its box most; -1 if none does."""
    worst = 1.0 + _TOLERANCE
    leaving = -1
    for i in range(n):
        if side[i] == 0.0:
            ratio = abs(_force(n, inertia, s, following, i)) / (period * k_s2[i])
            if ratio > worst:
                worst = ratio
                leaving = i
    return leaving


@formula
def _force(n: int, inertia: Array, s: Numbers, following: Array, i: int) -> float:
    """Return the force that keeps axis i on the surface: entry i of H_x (s - s+)."""
    force = 0.0
    for j in range(n):
        force += inertia[i, j] * (s[j] - following[j])
    return force


@formula
def _within(value: float, box: float) -> float:
    """Return value / box limited to [-1, 1]."""
    ratio = value / box
    return 1.0 if ratio > 1.0 else (-1.0 if ratio < -1.0 else ratio)


_SETTINGS = (*GAINS, OBSERVER_GAIN, SLIP_BACKOFF)

IMPLICIT = Reaching('implicit', reach, correct, _SETTINGS)

ON_SURFACE = Reaching(f'implicit{SHORTCUT}', reach_on_surface, correct_nothing, _SETTINGS)
"""Shortcut for ticks at which all axes stay on the surface, and no torque is limited."""
