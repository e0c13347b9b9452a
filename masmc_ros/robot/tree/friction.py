# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint friction, with coefficients that are adapted like inertial parameters.

    tau_f = F_v qdot + F_c sigma(qdot),   sigma(x) = x / sqrt(x^2 + creep^2)

After the inertial parameters, theta contains F_v and then F_c of all joints, or neither. Laws use
qdot of the reference motion. Since tau_f increases with qdot, the difference to the real rates
only removes energy from sigma, and noise of the rates is not fed back.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import copy_into, scratch
from masmc_ros.robot.tree.spatial import PER_BODY
from masmc_ros.robot.tree.tree_model import bodies_of, TreeModel
from masmc_ros.robot.tree.wheels import into_base, into_wheels

CREEP = 0.02
"""Rate in rad/s or m/s with 70 % of the Coulomb friction."""


@formula
def sliding(rate: float) -> float:
    """Return the share of the Coulomb friction at a rate."""
    return rate / math.sqrt(rate * rate + CREEP * CREEP)


@kernel
def add_friction(
    model: TreeModel, theta: Array, motion: Array, sign: float, forces: Array
) -> None:
    """Add the friction at velocities nu (n) to forces, or subtract it."""
    first, count = PER_BODY * bodies_of(model), len(motion)
    if len(theta) == first:
        return
    torques = scratch(count)
    copy_into(torques, motion)
    into_wheels(model, torques, False)
    for j in range(count):
        rate = torques[j]
        torques[j] = theta[first + j] * rate + theta[first + count + j] * sliding(rate)
    into_base(model, torques, True)
    for k in range(count):
        forces[k] += sign * torques[k]


@kernel
def write_friction_gradient(
    model: TreeModel, reference: Array, motion: Array, gradient: Array
) -> None:
    """Write the friction entries of Y' v for a motion v (n) into a gradient of theta."""
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
        gradient[first + count + j] = sliding(rates[j]) * along[j]


@kernel
def adapt_friction(
    model: TreeModel, theta: Array, gradient: Array, gamma: Array, period: float
) -> None:
    """Advance the coefficients in theta by a step down the gradient, with a minimum of zero."""
    for j in range(PER_BODY * bodies_of(model), len(theta)):
        moved = theta[j] - period / gamma[j] * gradient[j]
        theta[j] = moved if moved > 0.0 else 0.0
