# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Concurrent learning: theta_hat adapts to a finite stack of recorded data as well.

The torque is that of `rasmc`. A data point contains the means over an interval of
W = Y(q, v, v, dv/dt) and of the commanded forces f. It is stored as G_j = C W and y_j = C f, where
C' C = H^-1 of the nominal model. Over the points of the stack

    A = sum G_j' G_j,    b = sum G_j' y_j,
    theta_hat' = -Gamma^-1 (Y' sigma + kappa (A theta_hat - b)).

A new point replaces the one for which the smallest eigenvalue of Gamma^-1 A becomes largest, if
that is larger than before.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array, Joints, Numbers, Parameters
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise, from_index, unit
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import adapt_along, project
from masmc_ros.law.parts.delay_compensation import gradient
from masmc_ros.law.parts.last_period import last_regressor
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.reaching.reaching import correct
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.elimination import factor, solve, solve_definite
from masmc_ros.numerics.scalars import plus
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismInertia, MechanismRegressor

POINTS = 20
"""Number of data points in the stack."""


_NOVELTY = 0.05
"""Minimum squared distance of a new point to all others, relative to its square."""

_RIDGE = 1.0e-12
"""Eigenvalue added to A, relative to its trace, for parameters without excitation."""

_ITERATIONS = 30
_ROUNDING = 1.0e-9


class Settings(fields.Settings, group='concurrent_learning'):
    """Settings of the law."""

    concurrent_learning_kappa: float = gain(
        0.1, 'Weight kappa of the recorded data relative to the tracking error; 0: rasmc', 's²'
    )
    concurrent_learning_interval: float = gain(
        0.05, 'Time over which the motion is averaged to a data point', 's'
    )
    concurrent_learning_forgetting: float = gain(
        0.1, 'Rate at which recorded points fade, and newer ones replace them; 0: no fading', '1/s'
    )


class Memory(fields.Memory):
    """Memory of the law."""

    concurrent_learning_information: Numbers = field(
        'A, by its rows', size=('parameters', 'parameters')
    )
    concurrent_learning_vector: Parameters = field('b')
    concurrent_learning_stack: Numbers = field(
        'G_j, by its rows', size=(POINTS, 'joints', 'parameters')
    )
    concurrent_learning_targets: Numbers = field('y_j', size=(POINTS, 'joints'))
    concurrent_learning_count: float = field('Number of points recorded')
    concurrent_learning_motion: Numbers = field(
        'Integral of W, by its rows', size=('joints', 'parameters')
    )
    concurrent_learning_impulse: Joints = field('Integral of f')
    concurrent_learning_elapsed: float = field('Time of both integrals', 's')
    concurrent_learning_torque: Joints = field('Torque of the tick before', 'N·m')
    concurrent_learning_velocity: Joints = field('v of the tick before', initial=math.nan)


@formula
def _row(arguments: tuple[Lengths, MechanismRegressor, Numbers, Numbers], i: int) -> Numbers:
    """Return row i of W."""
    model, w, template, motion = arguments
    return mechanism.regressor_transpose_times(model, w, unit(motion, i), template)


@formula
def _inertia_column(arguments: tuple[Lengths, MechanismInertia, Numbers], i: int) -> Numbers:
    """Return column i of H."""
    model, h, motion = arguments
    return mechanism.inertia_times(model, h, unit(motion, i))


@formula
def _record(settings: Settings, tick: Tick, memory: Memory, before: Numbers) -> None:
    """Add the last period to the current interval, and record a point at its end."""
    w = last_regressor(tick, before)
    v = tick.velocity
    _accumulate(
        memory,
        tick.period,
        from_index(_row, v, (tick.model, w, tick.nominal, v)),
        mechanism.forces(tick.model, memory.concurrent_learning_torque),
    )
    elapsed = memory.concurrent_learning_elapsed + tick.period
    memory.concurrent_learning_elapsed = elapsed
    if elapsed > settings.concurrent_learning_interval * (1.0 - _ROUNDING):
        h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
        fading = 0.5 * elapsed * settings.concurrent_learning_forgetting
        _fade(memory, 1.0 / (1.0 + fading))
        _record_point(
            memory,
            elapsed,
            from_index(_inertia_column, v, (tick.model, h, v)),
            settings.gamma,
        )
        _restart(memory)


@kernel
def _restart(memory: Memory) -> None:
    """Start a new interval."""
    memory.concurrent_learning_elapsed = 0.0
    in_place(memory, 'concurrent_learning_motion')[:] = 0.0
    in_place(memory, 'concurrent_learning_impulse')[:] = 0.0


@kernel
def _accumulate(memory: Memory, period: float, rows: tuple[Numbers, ...], forces: Numbers) -> None:
    """Add W and f of a period to their integrals."""
    motion = in_place(memory, 'concurrent_learning_motion')
    impulse = in_place(memory, 'concurrent_learning_impulse')
    p = len(rows[0])
    for i in range(len(forces)):
        impulse[i] += period * forces[i]
        for j in range(p):
            motion[i * p + j] += period * rows[i][j]


@kernel
def _fade(memory: Memory, kept: float) -> None:
    """Scale all points of the stack."""
    stack = in_place(memory, 'concurrent_learning_stack')
    targets = in_place(memory, 'concurrent_learning_targets')
    for i in range(len(stack)):
        stack[i] *= kept
    for i in range(len(targets)):
        targets[i] *= kept


@kernel
def _record_point(
    memory: Memory, elapsed: float, inertia: tuple[Numbers, ...], gamma: Numbers
) -> None:
    """
    Record the mean of the interval if it improves the stack, and update A and b.

    Parameters
    ----------
    memory
        Memory of the law.
    lane
        Lane of the memory.
    elapsed
        Length of the interval in s.
    inertia
        H by its columns.
    gamma
        Diagonal of Gamma.

    """
    stack = in_place(memory, 'concurrent_learning_stack')
    targets = in_place(memory, 'concurrent_learning_targets')
    motion = in_place(memory, 'concurrent_learning_motion')
    impulse = in_place(memory, 'concurrent_learning_impulse')
    n, p = len(inertia), len(gamma)
    size = n * p
    point, target, factored = scratch(size), scratch(n), scratch(n, n)
    for i in range(n):
        target[i] = impulse[i] / elapsed
        for j in range(p):
            point[i * p + j] = motion[i * p + j] / elapsed
        for k in range(n):
            factored[i, k] = inertia[k][i]
    factor(factored)
    for i in range(n):
        for k in range(i):
            target[i] -= factored[i, k] * target[k]
            for j in range(p):
                point[i * p + j] -= factored[i, k] * point[k * p + j]
    for i in range(n):
        weight = 1.0 / math.sqrt(factored[i, i]) if factored[i, i] > 0.0 else 0.0
        target[i] *= weight
        for j in range(p):
            point[i * p + j] *= weight
    count = int(memory.concurrent_learning_count)
    place = _place_to_fill(stack, count, point)
    if count == POINTS:
        place = _place_to_replace(stack, point, gamma)
    elif place == count:
        memory.concurrent_learning_count = count + 1
    if place >= 0:
        for i in range(size):
            stack[place * size + i] = point[i]
        for i in range(n):
            targets[place * n + i] = target[i]
    information = in_place(memory, 'concurrent_learning_information')
    vector = in_place(memory, 'concurrent_learning_vector')
    for j in range(p):
        total = 0.0
        for row in range(POINTS * n):
            total += stack[row * p + j] * targets[row]
        vector[j] = total
        for k in range(p):
            information[j * p + k] = _information(stack, POINTS * n, p, j, k)


@kernel
def _information(stack: Array, rows: int, p: int, j: int, k: int) -> float:
    """Return entry j, k of A of a stack with this number of rows."""
    total = 0.0
    for row in range(rows):
        total += stack[row * p + j] * stack[row * p + k]
    return total


@kernel
def _place_to_fill(stack: Array, count: int, point: Array) -> int:
    """Return the next place of the stack if a point differs from all recorded ones, or -1."""
    size, square = len(point), 0.0
    for i in range(size):
        square += point[i] * point[i]
    for k in range(count):
        distance = 0.0
        for i in range(size):
            change = point[i] - stack[k * size + i]
            distance += change * change
        if distance <= _NOVELTY * square:
            return -1
    return count if square > 0.0 else -1


@kernel
def _place_to_replace(stack: Array, point: Array, gamma: Numbers) -> int:
    """Return the place at which a point makes the smallest eigenvalue largest, or -1."""
    p, size = len(gamma), len(point)
    n = size // p
    whole = scratch(p, p)
    for j in range(p):
        for k in range(p):
            whole[j, k] = _information(stack, POINTS * n, p, j, k)
    best, place = smallest_eigenvalue(whole, gamma) * (1.0 + _ROUNDING), -1
    changed = scratch(p, p)
    for number in range(POINTS):
        for j in range(p):
            for k in range(p):
                total = whole[j, k]
                for i in range(n):
                    old = number * size + i * p
                    total += point[i * p + j] * point[i * p + k]
                    total -= stack[old + j] * stack[old + k]
                changed[j, k] = total
        value = smallest_eigenvalue(changed, gamma)
        if value > best:
            best, place = value, number
    return place


@kernel
def smallest_eigenvalue(matrix: Array, gamma: Numbers) -> float:
    """
    Return the smallest eigenvalue of Gamma^-1 A, for a semi-definite A (p, p).

    Inverse iteration computes it. A small multiple of Gamma is added to a singular A.
    """
    p = len(gamma)
    scaled, work, x = scratch(p, p), scratch(p, p), scratch(p)
    trace = 0.0
    for j in range(p):
        for k in range(p):
            scaled[j, k] = matrix[j, k] / math.sqrt(gamma[j] * gamma[k])
        trace += scaled[j, j]
    if not trace > 0.0:
        return 0.0
    for j in range(p):
        scaled[j, j] += _RIDGE * trace
        # The start vector must not be orthogonal to the eigenvector.
        x[j] = 1.0 / (1.0 + j) if j % 2 == 0 else -1.0 / (1.0 + j)
        for k in range(p):
            work[j, k] = scaled[j, k]
    factor(work)
    for _ in range(_ITERATIONS):
        solve(work, x)
        square = 0.0
        for j in range(p):
            square += x[j] * x[j]
        length = math.sqrt(square)
        for j in range(p):
            x[j] /= length
    value = 0.0
    for j in range(p):
        for k in range(p):
            value += x[j] * scaled[j, k] * x[k]
    return value


@kernel
def _recalled(memory: Memory, theta: Numbers, gamma: Numbers, weight: float) -> Numbers:
    """
    Return Gamma (theta - theta+) for theta+ after an implicit step with `weight` T kappa.

    (Gamma + T kappa A) (theta+ - theta) = T kappa (b - A theta).
    """
    information = in_place(memory, 'concurrent_learning_information')
    vector = in_place(memory, 'concurrent_learning_vector')
    n = len(theta)
    work = scratch(n, n + 1)
    for i in range(n):
        residual = vector[i]
        for j in range(n):
            entry = information[i * n + j]
            residual -= entry * theta[j]
            work[i, j] = weight * entry
        work[i, i] += gamma[i]
        work[i, n] = weight * residual
    solve_definite(n, work)
    for i in range(n):
        work[i, 0] = -gamma[i] * work[i, n]
    return to_vector(work[:, 0], theta)


@formula
def _rate(change: float, period: float) -> float:
    return change / period


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, held: Joints) -> None:
    """Correct the prediction of the reaching term, record, and adapt."""
    correct(settings, tick, memory, raw, held)
    before = memory.concurrent_learning_velocity
    if before[0] == before[0]:
        _record(settings, tick, memory, before)
    else:
        _restart(memory)
    recalled = _recalled(
        memory,
        memory.estimate,
        settings.gamma,
        tick.period * settings.concurrent_learning_kappa,
    )
    recalled_rate = elementwise(_rate, recalled, tick.period)
    tracking = gradient(settings, memory, tick)
    along = elementwise(plus, tracking, recalled_rate)
    adapt_along(settings, tick, memory, raw, held, along)
    memory.concurrent_learning_torque = held
    memory.concurrent_learning_velocity = tick.velocity


CONCURRENT_LEARNING = Law(
    'concurrent_learning',
    RASMC.torque,
    (*RASMC.parameters, *Settings),
    Memory,
    learn,
    project,
    summary='rasmc with additional adaptation to a finite stack of recorded data',
    source='Chowdhary and Johnson 2010 and 2011',
    most_parameters=32,
)
