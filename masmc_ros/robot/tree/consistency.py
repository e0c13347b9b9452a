# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Physical consistency of inertial parameters: positive definite pseudo-inertias.

It is for adaptation with independent parameters; `natural_adaptation` preserves consistency.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import clear, scratch
from masmc_ros.jit.tuples import from_index
from masmc_ros.robot.tree.spatial import PER_BODY
from masmc_ros.robot.tree.tree_model import bodies_of, TreeModel


@formula
def _pseudo(theta: Numbers, at: int, i: int, j: int) -> float:
    """Return an entry of a body's pseudo-inertia, whose parameters start at `at`."""
    if i == 3 and j == 3:
        return theta[at]
    if i == 3 or j == 3:
        return theta[at + 1 + min(i, j)]
    if i == j:
        return theta[at + 4 + i]
    # xy, yz, zx
    return theta[at + 7 + (0 if i + j == 1 else (1 if i + j == 3 else 2))]


@kernel
def weakest_motion(model: TreeModel, theta: Numbers) -> tuple[float, Numbers]:
    """Return the first pivot that is not positive, with x of that pseudo-inertia and the body."""
    pivot, motion = 1.0, (0.0, 0.0, 0.0, 0.0, 0.0)
    lower, x = scratch(4, 4), scratch(4)
    clear(lower)
    clear(x)
    for body in range(bodies_of(model)):
        at = PER_BODY * body
        total = 0.0
        for i in range(PER_BODY):
            total += abs(theta[at + i])
        if total == 0.0:
            continue
        # The order is mass first: rows and columns 3, 0, 1, 2.
        for column in range(4):
            for row in range(column, 4):
                entry = _pseudo(theta, at, (row + 3) % 4, (column + 3) % 4)
                for k in range(column):
                    entry -= lower[row, k] * lower[column, k] * lower[k, k]
                lower[row, column] = entry if row == column else entry / lower[column, column]
            pivot = lower[column, column]
            if not pivot > 0.0:
                for i in range(4):
                    x[i] = 1.0 if i == column else 0.0
                for i in range(column - 1, -1, -1):
                    for k in range(i + 1, column + 1):
                        x[i] -= lower[k, i] * x[k]
                return pivot, (x[1], x[2], x[3], x[0], float(body))
            motion = (0.0, 0.0, 0.0, 1.0, float(body))
    return pivot, motion


@formula
def _normal(x: Numbers, i: int) -> float:
    """Return the derivative of x' P x with respect to a parameter."""
    if i // PER_BODY != int(x[4]):
        return 0.0
    k = i % PER_BODY
    if k == 0:
        return x[3] * x[3]
    if k < 4:
        return 2.0 * x[k - 1] * x[3]
    if k < 7:
        return x[k - 4] * x[k - 4]
    return 2.0 * x[k - 7] * x[(k - 6) % 3]


@formula
def consistency_normal(model: TreeModel, x: Numbers, template: Numbers) -> Numbers:
    """Return the vector n with n' theta = x' P x."""
    return from_index(_normal, template, x)
