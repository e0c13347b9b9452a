# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dynamics of a tree of bodies on a base, with only + - x and /, sines and cosines.

Motions, wrenches and velocities as in `kinematics.py`: in the base's frame, about its origin.
`inverse_dynamics` is the form of Slotine and Li (Echeandia and Wensing, arXiv 2010.01033): H a_r +
C(nu) nu_r + g with Hdot - 2 C skew-symmetric, linear in the inertial parameters. With mimic joints
H = G' H_f G, where H_f is that of free joints, whose rates are G nu; C and g follow alike.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.arrays import array_of, read_along, read_part, write_along, write_part
from masmc_ros.jit.compiled import called_kernel, formula, kernel
from masmc_ros.jit.scratch import clear, lasting, scratch
from masmc_ros.robot.tree.kinematics import (
    base_motion,
    crossed,
    ORIGIN,
    Posture,
    power,
    sum_of,
    velocities,
)
from masmc_ros.robot.tree.spatial import (
    add,
    cross,
    MOMENTS,
    Moments,
    moments_in_parent,
    momentum,
    PER_BODY,
    power_gradient,
    product,
    rotate,
    rotate_back,
    ROTATION,
    Rotation,
    scale,
    transpose,
    VECTOR,
    Vector,
    velocity_map,
    wrench,
)
from masmc_ros.robot.tree.tree_model import (
    base_of,
    bodies_of,
    is_coupled,
    parent_of,
    rotors_begin,
    TreeModel,
    velocities_of,
    velocity_of,
)
import numpy as np

GRAVITY = 9.81
"""m/s^2, downwards."""

_REFERENCE, _ACCELERATION = 6, 12

MOTION = 18
"""Numbers of a body's motion: angular velocity and velocity of each of the three."""


@kernel
def write_motions(
    model: TreeModel,
    posture: Posture,
    velocity: Array,
    reference: Array,
    acceleration: Array,
    gravity: float,
    motion: Array,
) -> None:
    """
    Write velocities, reference velocities and reference accelerations of bodies (B, MOTION).

    The arguments are nu, nu_r, a_r, and gravity downwards in m/s².
    """
    motion_subspaces = posture.motion_subspaces
    bodies, base = bodies_of(model), base_of(model)
    velocities(model, posture, velocity, motion, 0)
    velocities(model, posture, reference, motion, _REFERENCE)
    w, v = base_motion(base, velocity)
    sw, sv = base_motion(base, reference)
    turned, moved = crossed(w, v, sw, sv)
    alpha, a = base_motion(base, acceleration)
    write_part(motion, 0, _ACCELERATION, add(turned, alpha))
    write_part(motion, 0, _ACCELERATION + 3, add(moved, add(a, (0.0, 0.0, gravity))))
    for body in range(1, bodies):
        k, row = velocity_of(model, body), base + body - 1
        along = read_part(motion_subspaces, row, 0, VECTOR)
        across = read_part(motion_subspaces, row, 3, VECTOR)
        turned, moved = crossed(
            read_part(motion, body, 0, VECTOR),
            read_part(motion, body, 3, VECTOR),
            scale(along, reference[k]),
            scale(across, reference[k]),
        )
        alpha, a = sum_of(
            motion,
            parent_of(model, body),
            _ACCELERATION,
            add(scale(along, acceleration[k]), turned),
            add(scale(across, acceleration[k]), moved),
        )
        write_part(motion, body, _ACCELERATION, alpha)
        write_part(motion, body, _ACCELERATION + 3, a)


@formula
def _reference_field(motion: Array, body: int) -> tuple[Rotation, Vector]:
    """Return A and c of a body, whose points x have the reference acceleration A x + c."""
    omega = read_part(motion, body, 0, VECTOR)
    v = read_part(motion, body, 3, VECTOR)
    w = read_part(motion, body, _REFERENCE, VECTOR)
    alpha = read_part(motion, body, _ACCELERATION, VECTOR)
    a = read_part(motion, body, _ACCELERATION + 3, VECTOR)
    return velocity_map(w, omega, alpha), add(a, cross(w, v))


@formula
def moments_about_base(posture: Posture, theta: Array, body: int) -> Moments:
    """Return the inertial parameters of a body about the base's origin."""
    own: Moments = read_along(theta, PER_BODY * body, MOMENTS)
    if body == 0:
        return own
    frames = posture.frames
    return moments_in_parent(
        read_part(frames, body, 0, ROTATION), read_part(frames, body, ORIGIN, VECTOR), own
    )


@kernel
def write_forces(
    model: TreeModel,
    posture: Posture,
    theta: Array,
    motion: Array,
    acceleration: Array,
    forces: Array,
) -> None:
    """Write H a_r + C(nu) nu_r + g (n) of the motions that `write_motions` writes."""
    motion_subspaces = posture.motion_subspaces
    bodies, base, adds = bodies_of(model), base_of(model), is_coupled(model)
    size, rotors = velocities_of(model), rotors_begin(model)
    wrenches = scratch(bodies, 6)
    if adds:
        clear(forces)
    for body in range(bodies):
        a, c = _reference_field(motion, body)
        moment, force = wrench(a, c, moments_about_base(posture, theta, body))
        write_part(wrenches, body, 0, moment)
        write_part(wrenches, body, 3, force)
    for body in range(bodies - 1, 0, -1):
        moment = read_part(wrenches, body, 0, VECTOR)
        force = read_part(wrenches, body, 3, VECTOR)
        k, parent = velocity_of(model, body), parent_of(model, body)
        own = power(motion_subspaces, base + body - 1, moment, force)
        forces[k] = forces[k] + own if adds else own
        for i in range(6):
            wrenches[parent, i] += wrenches[body, i]
    moment, force = read_part(wrenches, 0, 0, VECTOR), read_part(wrenches, 0, 3, VECTOR)
    for k in range(base):
        forces[k] = power(motion_subspaces, k, moment, force)
    for row in range(size):
        total = forces[row]
        for other in range(size):
            total += model.numbers[rotors + row * size + other] * acceleration[other]
        forces[row] = total


@kernel
def inverse_dynamics(
    model: TreeModel,
    posture: Posture,
    theta: Array,
    velocity: Array,
    reference: Array,
    acceleration: Array,
    gravity: float,
) -> Array:
    """
    Return H a_r + C(nu) nu_r + g (n).

    Parameters
    ----------
    model
        the robot.
    posture
        of its bodies.
    theta
        Inertial parameters (10 B), body by body.
    velocity
        (n) nu.
    reference
        (n) nu_r.
    acceleration
        (n) a_r.
    gravity
        m/s^2, downwards.

    """
    motion, forces = scratch(bodies_of(model), MOTION), np.empty(len(velocity))
    write_motions(model, posture, velocity, reference, acceleration, gravity, motion)
    write_forces(model, posture, theta, motion, acceleration, forces)
    return forces


@kernel
def moment_gradients(
    model: TreeModel,
    posture: Posture,
    velocity: Array,
    reference: Array,
    acceleration: Array,
    gravity: float,
    error: Array,
) -> Array:
    """
    Return Y' sigma (10 B), the gradient for the adaptation of inertial parameters.

    sigma' (H a_r + C nu_r + g) is the sum of parameters times gradients, without rotors and
    wheels. The matrix Y is never formed. `error` (n) is sigma; see also `inverse_dynamics`.
    """
    bodies = bodies_of(model)
    motion, gradients = scratch(bodies, MOTION), np.empty(PER_BODY * bodies)
    write_motions(model, posture, velocity, reference, acceleration, gravity, motion)
    write_gradients(model, posture, motion, error, gradients)
    return gradients


@kernel
def write_gradients(
    model: TreeModel, posture: Posture, motion: Array, error: Array, gradients: Array
) -> None:
    """Write Y' sigma of the motions that `write_motions` writes."""
    frames = posture.frames
    bodies = bodies_of(model)
    moved = scratch(bodies, 6)
    velocities(model, posture, error, moved, 0)
    for body in range(bodies):
        r = read_part(frames, body, 0, ROTATION)
        p = read_part(frames, body, ORIGIN, VECTOR)
        a, c = _reference_field(motion, body)
        w = read_part(moved, body, 0, VECTOR)
        v = read_part(moved, body, 3, VECTOR)
        # Of the body's points, in its own frame.
        own = product(product(transpose(r), a), r)
        along = rotate_back(r, add(rotate(a, p), c))
        speed = rotate_back(r, add(v, cross(w, p)))
        of_body = power_gradient(own, along, rotate_back(r, w), speed)
        write_along(gradients, PER_BODY * body, of_body)


@kernel
def write_inertia(model: TreeModel, posture: Posture, theta: Array, matrix: Array) -> None:
    """Write H (n, n), as `inertia` returns it."""
    motion_subspaces = posture.motion_subspaces
    bodies, base = bodies_of(model), base_of(model)
    size, rotors = velocities_of(model), rotors_begin(model)
    # Parameters of the bodies, then of composite bodies: each with its subtree.
    inertial_parameters = scratch(bodies, PER_BODY)
    for body in range(bodies):
        write_part(inertial_parameters, body, 0, moments_about_base(posture, theta, body))
    for row in range(size):
        for column in range(size):
            matrix[row, column] = model.numbers[rotors + row * size + column]
    for subspace in range(base + bodies - 2, -1, -1):
        body, row = max(subspace - base + 1, 0), subspace
        moment, force = momentum(
            read_part(inertial_parameters, body, 0, MOMENTS),
            read_part(motion_subspaces, subspace, 0, VECTOR),
            read_part(motion_subspaces, subspace, 3, VECTOR),
        )
        at = body
        if body > 0:
            row, at = velocity_of(model, body), parent_of(model, body)
            for i in range(PER_BODY):
                inertial_parameters[at, i] += inertial_parameters[body, i]
        matrix[row, row] += power(motion_subspaces, subspace, moment, force)
        while at > 0:
            column = velocity_of(model, at)
            shared = power(motion_subspaces, base + at - 1, moment, force)
            # Of two bodies with one velocity, both entries of their pair are on the diagonal.
            matrix[column, row] += 2.0 * shared if column == row else shared
            matrix[row, column] = matrix[column, row]
            at = parent_of(model, at)
        for column in range(min(subspace, base)):
            matrix[column, row] += power(motion_subspaces, column, moment, force)
            matrix[row, column] = matrix[column, row]


@called_kernel
def inertia(model: TreeModel, posture: Posture, theta: Numbers) -> Array:
    """
    Return H (n, n) for inertial parameters (10 B), by composite bodies in O(n depth).

    It includes the constant inertia of rotors and wheels.
    """
    size = velocities_of(model)
    matrix = lasting(theta, size, size)
    write_inertia(model, posture, array_of(theta), matrix)
    return matrix
