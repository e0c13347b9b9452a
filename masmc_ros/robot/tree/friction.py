# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction of joints; its coefficients are adapted like the bodies' moments.

    tau_f = F_v qdot + F_c sigma(qdot),   sigma(x) = x / sqrt(x^2 + creep^2)

theta has F_v of all joints and then F_c after the moments of the bodies, or neither. In what a law
computes qdot is the joints' part of the reference motion: as tau_f grows with qdot, what the real
rates differ by takes energy from sigma and never gives it any, and noise of rates is not fed back.
"""

from __future__ import annotations

import math
from typing import Any

from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.scratch import copy_into, scratch
from masmc_ros.robot.tree.model import bodies_of, TreeModel
from masmc_ros.robot.tree.spatial import PER_BODY
from masmc_ros.robot.tree.wheels import into_base, into_wheels

CREEP = 0.02
"""Rate in rad/s or m/s at which seven tenths of Coulomb's friction are there."""


@formula
def _sliding(rate: float) -> float:
    """Return Coulomb's friction as a part of all of it."""
    return rate / math.sqrt(rate * rate + CREEP * CREEP)


@kernel
def add_friction(
    model: TreeModel, theta: Any, motion: Any, sign: float, forces: Any
) -> None:
    """Add to forces, or take from them, what joints that move as nu (n) says meet with."""
    first, count = PER_BODY * bodies_of(model), len(motion)
    if len(theta) == first:
        return
    torques = scratch(count)
    copy_into(torques, motion)
    into_wheels(model, torques, False)
    for j in range(count):
        rate = torques[j]
        torques[j] = theta[first + j] * rate + theta[first + count + j] * _sliding(rate)
    into_base(model, torques, True)
    for k in range(count):
        forces[k] += sign * torques[k]


@kernel
def write_friction_gradient(model: TreeModel, reference: Any, motion: Any, gradient: Any) -> None:
    """Write what belongs to friction of Y' v, v being a motion (n), into a gradient of theta."""
    first, count = PER_BODY * bodies_of(model), len(motion)
    if len(gradient) == first:
        return
    rates, along = scratch(count), scratch(count)
    copy_into(rates, reference)
    copy_into(along, motion)
    into_wheels(model, rates, False)
    into_wheels(model, along, False)
    for j in range(count):
        gradient[first + j] = rates[j] * along[j]
        gradient[first + count + j] = _sliding(rates[j]) * along[j]


@kernel
def adapt_friction(
    model: TreeModel, theta: Any, gradient: Any, gamma: Any, period: float
) -> None:
    """Move the coefficients in theta on by a step down the gradient, none below zero."""
    for j in range(PER_BODY * bodies_of(model), len(theta)):
        moved = theta[j] - period / gamma[j] * gradient[j]
        theta[j] = moved if moved > 0.0 else 0.0
