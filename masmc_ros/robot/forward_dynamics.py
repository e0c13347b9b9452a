# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
How the joints accelerate under torques, by the mechanism's other formulas.

A formula of the contract, for mechanisms that know no shorter way.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import elementwise
from masmc_ros.robot import mechanism


@formula
def joint_accelerations(
    model: Any, posture: Any, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """Return those of H^-1 (f - V v - g)."""
    bias = mechanism.coriolis(model, posture, theta, mechanism.motion(model, rates))
    force = elementwise(minus, mechanism.forces(model, torques), bias)
    h = mechanism.inertia(model, posture, theta)
    return mechanism.joint_rates(model, mechanism.inertia_solve(model, h, force))
