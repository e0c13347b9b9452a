# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint accelerations under torques, computed with the other formulas of a mechanism.

It is the default for mechanisms without a more efficient formula.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismPosture


@formula
def joint_accelerations(
    model: Lengths, posture: MechanismPosture, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """Return the joint accelerations of H^-1 (f - V v - g)."""
    bias = mechanism.coriolis(model, posture, theta, mechanism.motion(model, rates))
    force = elementwise(minus, mechanism.forces(model, torques), bias)
    h = mechanism.inertia(model, posture, theta)
    return mechanism.joint_rates(model, mechanism.inertia_solve(model, h, force))
