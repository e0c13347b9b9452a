# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Forward dynamics of a tree by articulated bodies, O(n) (Featherstone, RBDA 2008, chapter 7).

A subtree with free joints responds to the acceleration a of its root with the wrench I_A a + p_A,
where I_A is the articulated-body inertia. Conventions are those of `dynamics`; all bodies use one
frame, so there are no transformations between bodies. With mimic joints, whose forces depend on
those of other branches, H is factored instead, O(n^3).
An articulated inertia [A B; B' M] has 21 numbers: A and M, symmetric, by rows of their upper
triangles, and B between them by rows. It takes (omega, v) to (moment, force).
"""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.arrays import read_part, write_part
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise
from masmc_ros.numerics.elimination import factor, solve
from masmc_ros.numerics.scalars import minus, plus
from masmc_ros.robot.tree.dynamics import moments_about_base
from masmc_ros.robot.tree.kinematics import (
    crossed,
    Posture,
    power,
    sum_of,
    towards_base,
    write_velocity,
)
from masmc_ros.robot.tree.spatial import (
    add,
    cross,
    inner,
    Moments,
    momentum,
    scale,
    VECTOR,
    Vector,
)
from masmc_ros.robot.tree.tree_model import (
    base_of,
    bodies_of,
    is_coupled,
    parent_of,
    rotors_begin,
    TreeModel,
    velocity_of,
)
import numpy as np

Inertia = tuple[float, ...]
INERTIA: Inertia = (0.0,) * 21
"""No inertia."""

_WRENCH, _ENTRIES = 21, 27
"""Start of p_A in the row of a body, which has inertia and wrench."""

_FORCE, _GIVES, _LEFT, _OWN = 3, 6, 7, 8
"""Indices in the row of a joint: wrench U = I_A s, its force, 1 / s' U, and residual force."""


@kernel
def forward_dynamics(
    model: TreeModel,
    posture: Posture,
    theta: Array,
    velocity: Array,
    forces: Array,
    gravity: float,
) -> Array:
    """Return the acceleration (n) under forces (n), H^-1 (forces - C nu - g)."""
    acceleration = np.empty(len(velocity))
    write_accelerations(model, posture, theta, velocity, forces, gravity, acceleration)
    return acceleration


@kernel
def write_accelerations(
    model: TreeModel,
    posture: Posture,
    theta: Array,
    velocity: Array,
    forces: Array,
    gravity: float,
    acceleration: Array,
) -> None:
    """
    Write the acceleration (n) under forces (n), H^-1 (forces - C nu - g).

    Parameters
    ----------
    model
        Robot; the inertia of its rotors couples only velocities of the base.
    posture
        Positions of its bodies.
    theta
        Inertial parameters (10 B), body by body.
    velocity
        (n) nu.
    forces
        (n) conjugate to nu.
    gravity
        m/s^2, downwards.
    acceleration
        Output, acceleration (n).

    """
    motion_subspaces = posture.motion_subspaces
    bodies, base = bodies_of(model), base_of(model)
    motion, inertias, joints = scratch(bodies, 6), scratch(bodies, _ENTRIES), scratch(bodies, _OWN)
    for body in range(bodies):
        own = moments_about_base(posture, theta, body)
        w, v = write_velocity(model, motion_subspaces, velocity, motion, 0, body)
        moment, force = momentum(own, w, v)
        write_part(inertias, body, 0, _inertia_of(own))
        write_part(inertias, body, _WRENCH, add(cross(w, moment), cross(v, force)))
        write_part(inertias, body, _WRENCH + 3, cross(w, force))
    if is_coupled(model):
        _solve_coupled(
            model, motion_subspaces, inertias, motion, velocity, forces, gravity, acceleration
        )
        return
    for body in range(bodies - 1, 0, -1):
        _propagate_inertia(
            model, motion_subspaces, motion, velocity, forces, inertias, joints, body
        )
    _move_base(model, motion_subspaces, inertias, forces, gravity, motion, acceleration)
    for body in range(1, bodies):
        k, parent = base + body - 1, parent_of(model, body)
        # `motion` contains the acceleration v x s qdot of the joint rate.
        alpha = add(read_part(motion, parent, 0, VECTOR), read_part(motion, body, 0, VECTOR))
        a = add(read_part(motion, parent, 3, VECTOR), read_part(motion, body, 3, VECTOR))
        known = inner(read_part(joints, body, 0, VECTOR), alpha)
        known += inner(read_part(joints, body, _FORCE, VECTOR), a)
        joint_acceleration = (joints[body, _LEFT] - known) * joints[body, _GIVES]
        acceleration[k] = joint_acceleration
        along = read_part(motion_subspaces, k, 0, VECTOR)
        across = read_part(motion_subspaces, k, 3, VECTOR)
        write_part(motion, body, 0, add(alpha, scale(along, joint_acceleration)))
        write_part(motion, body, 3, add(a, scale(across, joint_acceleration)))


@kernel
def _solve_coupled(
    model: TreeModel,
    motion_subspaces: Array,
    inertias: Array,
    motion: Array,
    velocity: Array,
    forces: Array,
    gravity: float,
    acceleration: Array,
) -> None:
    """
    Write H^-1 (forces - C nu - g), by the factors of H.

    `inertias` and `motion` have inertias, velocity wrenches and velocities of the bodies; this
    function overwrites them.
    """
    bodies, base, size = bodies_of(model), base_of(model), len(velocity)
    rotors, matrix, moved = rotors_begin(model), scratch(size, size), scratch(bodies, 6)
    for k in range(size):
        acceleration[k] = forces[k]
        for column in range(size):
            matrix[k, column] = model.numbers[rotors + k * size + column]
    # Accelerations at zero nudot and their wrenches; the ground accelerates upwards by gravity.
    for body in range(bodies):
        alpha, a = VECTOR, (0.0, 0.0, gravity)
        if body > 0:
            row, rate = base + body - 1, velocity[velocity_of(model, body)]
            turned, carried = crossed(
                read_part(motion, body, 0, VECTOR),
                read_part(motion, body, 3, VECTOR),
                scale(read_part(motion_subspaces, row, 0, VECTOR), rate),
                scale(read_part(motion_subspaces, row, 3, VECTOR), rate),
            )
            alpha, a = sum_of(moved, parent_of(model, body), 0, turned, carried)
        write_part(moved, body, 0, alpha)
        write_part(moved, body, 3, a)
        n, f = _answer(read_part(inertias, body, 0, INERTIA), alpha, a)
        n, f = sum_of(inertias, body, _WRENCH, n, f)
        write_part(inertias, body, _WRENCH, n)
        write_part(inertias, body, _WRENCH + 3, f)
    # Rows of bodies become those of composite bodies: each with its subtree.
    for row in range(base + bodies - 2, -1, -1):
        body = max(row - base + 1, 0)
        k = row if row < base else velocity_of(model, body)
        n = read_part(inertias, body, _WRENCH, VECTOR)
        f = read_part(inertias, body, _WRENCH + 3, VECTOR)
        acceleration[k] -= power(motion_subspaces, row, n, f)
        n, f = _answer(
            read_part(inertias, body, 0, INERTIA),
            read_part(motion_subspaces, row, 0, VECTOR),
            read_part(motion_subspaces, row, 3, VECTOR),
        )
        matrix[k, k] += power(motion_subspaces, row, n, f)
        at = towards_base(model, base, row)
        while at >= 0:
            column = at if at < base else velocity_of(model, at - base + 1)
            shared = power(motion_subspaces, at, n, f)
            matrix[k, column] += 2.0 * shared if column == k else shared
            matrix[column, k] = matrix[k, column]
            at = towards_base(model, base, at)
        if body > 0:
            parent = parent_of(model, body)
            for i in range(_ENTRIES):
                inertias[parent, i] += inertias[body, i]
    factor(matrix)
    solve(matrix, acceleration)


@formula
def _inertia_of(inertial_parameters: Moments) -> Inertia:
    """Return the inertia of a rigid body."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    return (
        yy + zz, -xy, -zx, zz + xx, -yz, xx + yy,
        0.0, -z, y, z, 0.0, -x, -y, x, 0.0,
        mass, 0.0, 0.0, mass, 0.0, mass,
    )  # fmt: skip


@formula
def _answer(to: Inertia, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return the wrench of an inertia times a motion."""
    moment = (
        to[0] * w[0] + to[1] * w[1] + to[2] * w[2]
        + (to[6] * v[0] + to[7] * v[1] + to[8] * v[2]),
        to[1] * w[0] + to[3] * w[1] + to[4] * w[2]
        + (to[9] * v[0] + to[10] * v[1] + to[11] * v[2]),
        to[2] * w[0] + to[4] * w[1] + to[5] * w[2]
        + (to[12] * v[0] + to[13] * v[1] + to[14] * v[2]),
    )
    force = (
        to[6] * w[0] + to[9] * w[1] + to[12] * w[2]
        + (to[15] * v[0] + to[16] * v[1] + to[17] * v[2]),
        to[7] * w[0] + to[10] * w[1] + to[13] * w[2]
        + (to[16] * v[0] + to[18] * v[1] + to[19] * v[2]),
        to[8] * w[0] + to[11] * w[1] + to[14] * w[2]
        + (to[17] * v[0] + to[19] * v[1] + to[20] * v[2]),
    )
    return moment, force


@formula
def _outer(n: Vector, f: Vector, part: float) -> Inertia:
    """Return the wrench (n, f) times itself times a number, as an inertia."""
    p, g = scale(n, part), scale(f, part)
    return (
        p[0] * n[0], p[0] * n[1], p[0] * n[2], p[1] * n[1], p[1] * n[2], p[2] * n[2],
        p[0] * f[0], p[0] * f[1], p[0] * f[2],
        p[1] * f[0], p[1] * f[1], p[1] * f[2],
        p[2] * f[0], p[2] * f[1], p[2] * f[2],
        g[0] * f[0], g[0] * f[1], g[0] * f[2], g[1] * f[1], g[1] * f[2], g[2] * f[2],
    )  # fmt: skip


@kernel
def _propagate_inertia(
    model: TreeModel,
    motion_subspaces: Array,
    motion: Array,
    velocity: Array,
    forces: Array,
    inertias: Array,
    joints: Array,
    body: int,
) -> None:
    """
    Propagate the articulated-body inertia of a subtree to its parent.

    In `motion`, the acceleration v x s qdot of the joint rate replaces the velocity.
    """
    k, parent = base_of(model) + body - 1, parent_of(model, body)
    rotor = rotors_begin(model) + k * (len(motion_subspaces) + 1)
    to = read_part(inertias, body, 0, INERTIA)
    w, v = read_part(motion_subspaces, k, 0, VECTOR), read_part(motion_subspaces, k, 3, VECTOR)
    n, f = _answer(to, w, v)
    pivot = inner(w, n) + inner(v, f) + model.numbers[rotor]
    p_n = read_part(inertias, body, _WRENCH, VECTOR)
    p_f = read_part(inertias, body, _WRENCH + 3, VECTOR)
    left = forces[k] - (inner(w, p_n) + inner(v, p_f))
    rate = velocity[k]
    turned, moved = crossed(
        read_part(motion, body, 0, VECTOR),
        read_part(motion, body, 3, VECTOR),
        scale(w, rate),
        scale(v, rate),
    )
    write_part(motion, body, 0, turned)
    write_part(motion, body, 3, moved)
    write_part(joints, body, 0, n)
    write_part(joints, body, _FORCE, f)
    gives = 1.0 / pivot
    joints[body, _GIVES], joints[body, _LEFT] = gives, left
    away = _outer(n, f, gives)
    kept = elementwise(minus, to, away)
    total = elementwise(plus, read_part(inertias, parent, 0, INERTIA), kept)
    write_part(inertias, parent, 0, total)
    c_n, c_f = _answer(to, turned, moved)
    part = (left - (inner(n, turned) + inner(f, moved))) * gives
    moment = add(add(p_n, c_n), scale(n, part))
    force = add(add(p_f, c_f), scale(f, part))
    moment = add(read_part(inertias, parent, _WRENCH, VECTOR), moment)
    force = add(read_part(inertias, parent, _WRENCH + 3, VECTOR), force)
    write_part(inertias, parent, _WRENCH, moment)
    write_part(inertias, parent, _WRENCH + 3, force)


@formula
def _move_base(
    model: TreeModel,
    motion_subspaces: Array,
    inertias: Array,
    forces: Array,
    gravity: float,
    motion: Array,
    acceleration: Array,
) -> None:
    """Write the acceleration of the base, also in place of its velocity in `motion`."""
    base, size, rotors = base_of(model), len(motion_subspaces), rotors_begin(model)
    to = read_part(inertias, 0, 0, INERTIA)
    matrix, x = scratch(base, base), scratch(base)
    # Gravity is an upward acceleration of the fixed ground.
    n, f = _answer(to, VECTOR, (0.0, 0.0, gravity))
    n = add(n, read_part(inertias, 0, _WRENCH, VECTOR))
    f = add(f, read_part(inertias, 0, _WRENCH + 3, VECTOR))
    for i in range(base):
        x[i] = forces[i] - power(motion_subspaces, i, n, f)
        along = read_part(motion_subspaces, i, 0, VECTOR)
        across = read_part(motion_subspaces, i, 3, VECTOR)
        moment, force = _answer(to, along, across)
        for j in range(base):
            rotor = model.numbers[rotors + i * size + j]
            matrix[i, j] = power(motion_subspaces, j, moment, force) + rotor
    factor(matrix)
    solve(matrix, x)
    for i in range(6):
        motion[0, i] = gravity if i == 5 else 0.0
    for k in range(base):
        acceleration[k] = x[k]
        for i in range(6):
            motion[0, i] += motion_subspaces[k, i] * x[k]
