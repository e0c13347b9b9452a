# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a law knows at a tick: the state, the reference, and the sliding surface of both."""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.law.parts.surface import reference_acceleration, reference_velocity, sliding_surface
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.record import get
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each, tabulate, unit
from masmc_ros.robot import mechanism

Numbers = tuple[float, ...]


class Tick(NamedTuple):
    """One tick; vectors are tuples, velocities the mechanism's own (`robot.mechanism`)."""

    period: float  # T in s
    model: Any  # lengths
    posture: Any  # of the measured state
    nominal: Numbers  # theta of the nominal model
    velocity: Numbers  # v
    reference_velocity: Numbers  # v_r
    reference_acceleration: Numbers  # a_r
    error: Numbers  # e = x - x_d of the task
    error_rate: Numbers  # edot
    surface: Numbers  # s = edot + sigma e
    regressor: Any  # Y(q, v, v_r, a_r)


@formula
def tick_of(
    settings: Any,
    lane: int,
    posture: Any,
    v: Numbers,
    position: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tick:
    """
    Return the tick of a measured state and of x_d, xdot_d and xddot_d.

    v_r = J^-1 xdot_r and a_r = J^-1 (xddot_r - Jdot v_r) with (13) and (14).
    """
    model = mechanism.model_of(settings, lane)
    sigma = get(settings, 'sigma', lane)
    x = mechanism.task_position(model, posture, position)
    x_dot = mechanism.task_velocity(model, posture, v)
    error = each(minus, x, desired[0])
    rate = each(minus, x_dot, desired[1])
    v_r = mechanism.motion_from_task(
        model, posture, each(reference_velocity, desired[1], error, sigma)
    )
    drift = mechanism.task_drift(model, posture, v, v_r)
    x_ddot_r = each(reference_acceleration, desired[2], rate, sigma)
    a_r = mechanism.motion_from_task(model, posture, each(minus, x_ddot_r, drift))
    return Tick(
        get(settings, 'period', lane),
        model,
        posture,
        get(settings, 'nominal', lane),
        v,
        v_r,
        a_r,
        error,
        rate,
        each(sliding_surface, error, rate, sigma),
        mechanism.regressor(model, posture, v, v_r, a_r),
    )


@formula
def _task_inertia_column(of: tuple[Any, Any, Any, Numbers], j: int) -> Numbers:
    model, posture, h, like = of
    v = mechanism.motion_from_task(model, posture, unit(like, j))
    return mechanism.task_from_forces(model, posture, mechanism.inertia_times(model, h, v))


@formula
def task_inertia(model: Any, posture: Any, theta: Numbers, like: Numbers) -> Any:
    """Return H_x = J^-T H J^-1 of (11) by its columns, kg; `like` has an entry for each axis."""
    h = mechanism.inertia(model, posture, theta)
    return tabulate(_task_inertia_column, like, (model, posture, h, like))
