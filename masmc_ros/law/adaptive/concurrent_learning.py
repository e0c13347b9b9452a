# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Concurrent learning: theta_hat adapts to recorded data as well.

The torque is that of `rasmc`. With W = Y(q, v, v, dv/dt) of every period, f the forces that were
commanded in it and H of the nominal model,

    A' = W' H^-1 W,    b' = W' H^-1 f,
    theta_hat' = -Gamma^-1 (Y' sigma + kappa (A theta_hat - b)).
"""

from __future__ import annotations

import math
from typing import Any

from masmc_ros.law.law import Law, register
from masmc_ros.law.parts.adaptation import adapt_along, project, tracking_gradient
from masmc_ros.law.parts.last_period import last_regressor
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.reaching.reaching import correct
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.arrays import to_vector
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.elimination import solve_definite
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import plus
from masmc_ros.numerics.tuples import elementwise, from_index, unit
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism
import numpy as np

PARAMETERS = (
    *RASMC.parameters,
    Parameter(
        'concurrent_learning.kappa',
        10.0,
        'Weight kappa of the recorded data relative to the tracking error; 0: rasmc',
        unit='s',
        minimum=0.0,
        read_only=False,
    ),
    Parameter(
        'concurrent_learning.forgetting',
        0.0,
        'Rate at which the record fades; 0: never',
        unit='1/s',
        minimum=0.0,
        read_only=False,
    ),
)

MEMORY = (
    *RASMC.memory,
    Field('concurrent_learning_information', ('parameters', 'parameters'), 'A, by its rows'),
    Field('concurrent_learning_vector', 'parameters', 'b'),
    Field('concurrent_learning_torque', 'joints', 'Torque of the tick before', 'N·m'),
    Field('concurrent_learning_velocity', 'joints', 'v of the tick before', initial=math.nan),
)


@formula
def _row(arguments: tuple[Any, Any, Numbers, Numbers], i: int) -> Numbers:
    """Return row i of W."""
    model, w, template, motion = arguments
    return mechanism.regressor_transpose_times(model, w, unit(motion, i), template)


@formula
def _weighted_row(arguments: tuple[Any, Any, Numbers, Numbers, Any], i: int) -> Numbers:
    """Return row i of H^-1 W."""
    model, w, template, motion, h = arguments
    column = mechanism.inertia_solve(model, h, unit(motion, i))
    return mechanism.regressor_transpose_times(model, w, column, template)


@formula
def _record(settings: Any, tick: Tick, memory: Any, lane: int, before: Numbers) -> None:
    """Add the last period to A and b."""
    w = last_regressor(tick, before)
    h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
    template, v = tick.nominal, tick.velocity
    _add(
        memory,
        lane,
        1.0 / (1.0 + tick.period * get(settings, 'concurrent_learning_forgetting', lane)),
        tick.period,
        from_index(_row, v, (tick.model, w, template, v)),
        from_index(_weighted_row, v, (tick.model, w, template, v, h)),
        mechanism.forces(tick.model, get(memory, 'concurrent_learning_torque', lane)),
    )


@kernel
def _add(
    memory: Any,
    lane: int,
    kept: float,
    period: float,
    rows: tuple[Numbers, ...],
    weighted: tuple[Numbers, ...],
    forces: Numbers,
) -> None:
    """Add the last period to A and b, after forgetting."""
    information = memory['concurrent_learning_information']
    vector = memory['concurrent_learning_vector']
    n = len(rows[0])
    for j in range(n):
        total = 0.0
        for i in range(len(forces)):
            total += weighted[i][j] * forces[i]
        vector[j, lane] = kept * vector[j, lane] + period * total
        for k in range(n):
            total = 0.0
            for i in range(len(forces)):
                total += weighted[i][j] * rows[i][k]
            entry = information[j * n + k, lane]
            information[j * n + k, lane] = kept * entry + period * total


@kernel
def _recalled(memory: Any, lane: int, theta: Numbers, gamma: Numbers, weight: float) -> Numbers:
    """
    Return Gamma (theta - theta+) for theta+ after an implicit step with `weight` T kappa.

    (Gamma + T kappa A) (theta+ - theta) = T kappa (b - A theta).
    """
    information = memory['concurrent_learning_information']
    vector = memory['concurrent_learning_vector']
    n = len(theta)
    work = np.empty((n, n + 1))
    for i in range(n):
        residual = vector[i, lane]
        for j in range(n):
            entry = information[i * n + j, lane]
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
def learn(settings: Any, tick: Tick, memory: Any, lane: int, raw: Numbers, held: Numbers) -> None:
    """Correct the prediction of the reaching term, record, and adapt."""
    correct(settings, tick, memory, lane, raw, held)
    before = get(memory, 'concurrent_learning_velocity', lane)
    if before[0] == before[0]:
        _record(settings, tick, memory, lane, before)
    recalled = _recalled(
        memory,
        lane,
        get(memory, 'estimate', lane),
        get(settings, 'gamma', lane),
        tick.period * get(settings, 'concurrent_learning_kappa', lane),
    )
    recalled_rate = elementwise(_rate, recalled, tick.period)
    gradient = elementwise(plus, tracking_gradient(tick), recalled_rate)
    adapt_along(settings, tick, memory, lane, raw, held, gradient)
    put(memory, 'concurrent_learning_torque', lane, held)
    put(memory, 'concurrent_learning_velocity', lane, tick.velocity)


CONCURRENT_LEARNING = register(
    Law(
        'concurrent_learning',
        RASMC.torque,
        PARAMETERS,
        MEMORY,
        learn,
        project,
        summary='rasmc with additional adaptation to recorded data of the motion',
        source='Chowdhary and Johnson 2010',
        most_parameters=32,
    )
)
