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

"""The plant's motion: forward dynamics, integrated by classic Runge-Kutta steps."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each
from masmc_ros.robot import mechanism

Numbers = tuple[float, ...]
State = tuple[Numbers, Numbers]
"""Positions, and the joints' rates."""


@formula
def _moved(value: float, h: float, rate: float) -> float:
    """Return value + h rate."""
    return value + h * rate


@formula
def _total(k1: float, k2: float, k3: float, k4: float) -> float:
    """Return the sum of the slopes with their weights."""
    return k1 + 2.0 * k2 + 2.0 * k3 + k4


@formula
def derivative(
    model: Any, theta: Numbers, position: Numbers, rates: Numbers, torque: Numbers
) -> State:
    """Return the derivatives of positions and joints' rates, (8) and (10), torque in N m."""
    posture = mechanism.posture(model, position)
    v = mechanism.motion(model, rates)
    bias = mechanism.coriolis(model, posture, theta, v)
    force = each(minus, mechanism.forces(model, torque), bias)
    h = mechanism.inertia(model, posture, theta)
    v_dot = mechanism.inertia_solve(model, h, force)
    return (
        mechanism.position_rates(model, posture, rates),
        mechanism.joint_rates(model, v_dot),
    )


@formula
def rk4_step(
    model: Any,
    theta: Numbers,
    position: Numbers,
    rates: Numbers,
    h: float,
    start: Numbers,
    middle: Numbers,
    end: Numbers,
) -> State:
    """Return the state after h seconds, under the joints' torques at three times."""
    p1, r1 = derivative(model, theta, position, rates, start)
    half = 0.5 * h
    p2, r2 = derivative(
        model, theta, each(_moved, position, half, p1), each(_moved, rates, half, r1), middle
    )
    p3, r3 = derivative(
        model, theta, each(_moved, position, half, p2), each(_moved, rates, half, r2), middle
    )
    p4, r4 = derivative(
        model, theta, each(_moved, position, h, p3), each(_moved, rates, h, r3), end
    )
    sixth = h / 6.0
    return (
        each(_moved, position, sixth, each(_total, p1, p2, p3, p4)),
        each(_moved, rates, sixth, each(_total, r1, r2, r3, r4)),
    )
