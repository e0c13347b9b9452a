# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Kinematics of a tree on a base: positions and motions of bodies and their points.

Velocities nu are the base's rates in its own frame (none; u, omega; or u, v, omega), then the
joints' rates in the tree's order; forces are conjugate to them. Everything is expressed in the
base's frame, about its origin: motions as angular velocity and velocity at that origin, wrenches
as moment about it and force. This needs no transformations between bodies. The motion subspace of
the base is constant in its own frame, so a base that cannot move sideways needs no constraint
forces.

A mimic joint has no velocity in nu: its body moves with the rate of the controlled joint times a
multiplier, which scales its motion subspace. Several bodies then share a velocity, whose force and
column of a Jacobian are sums over them.

Body 0 is the base, every body comes after its parent. SI units, radians; z of the base is up.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.arrays import array_of, read_part, write_part
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import clear, lasting, scratch
from masmc_ros.numerics.portable_math import padded, sin_cos, write_sines_and_cosines
from masmc_ros.robot.tree.spatial import (
    add,
    cross,
    inner,
    product,
    rotate,
    rotate_back,
    ROTATION,
    Rotation,
    scale,
    turn,
    VECTOR,
    Vector,
)
from masmc_ros.robot.tree.tree_model import (
    base_of,
    bodies_of,
    DIFFERENTIAL,
    FIXED,
    is_coupled,
    joint_of,
    multiplier_of,
    OMNIDIRECTIONAL,
    parent_of,
    rotation_of_joint,
    TreeModel,
    velocities_of,
    velocity_of,
)
import numpy as np

ORIGIN = 9
"""Place of the origin of a frame, after its rotation."""

_POSITION = 12


class Posture(NamedTuple):
    """
    Positions of the bodies in the base's frame, and of the base in the world.

    Loops read its arrays in advance, because each access counts a reference, which takes time.
    """

    frames: Array
    """
    (B, 13) rotation, row by row, and origin in m; then the positions of the controlled joints in
    rad or m, in rows 1, 2, ...
    """
    motion_subspaces: Array
    """
    (base velocities + B - 1, 6) motions of the base and of the bodies in their parents per
    velocity: angular velocity, and velocity at the base's origin.
    """
    sine: float
    """Of the base's yaw."""
    cosine: float
    x: float
    """Of the base's origin in the world, in m."""
    y: float


@formula
def joint_position(posture: Posture, joint: int) -> float:
    """Return the position of a controlled joint, in rad or m."""
    return posture.frames[joint + 1, _POSITION]


@kernel
def place(
    model: TreeModel, x: float, y: float, yaw: float, position: Numbers, first: int
) -> Posture:
    """
    Return the positions of all bodies.

    Parameters
    ----------
    model
        the robot.
    x, y, yaw
        pose of the base in the world, in m and rad.
    position
        Vector with the joint positions from index `first`.
    first
        Index of the first joint position.

    """
    bodies, base = bodies_of(model), base_of(model)
    frames = lasting(position, bodies, _POSITION + 1)
    motion_subspaces = lasting(position, base + bodies - 1, 6)
    write_part(frames, 0, 0, ROTATION)
    write_part(frames, 0, ORIGIN, VECTOR)
    for k in range(base):
        write_part(motion_subspaces, k, 0, VECTOR)
        write_part(motion_subspaces, k, 3, VECTOR)
    if base != FIXED:
        motion_subspaces[0, 3], motion_subspaces[base - 1, 2] = 1.0, 1.0
        if base == OMNIDIRECTIONAL:
            motion_subspaces[1, 4] = 1.0
    angles, driven = array_of(position), first - base
    sines, cosines = scratch(padded(bodies - 1)), scratch(padded(bodies - 1))
    for body in range(1, bodies):
        turns, _, _ = joint_of(model, body)
        value = multiplier_of(model, body) * angles[driven + velocity_of(model, body)]
        sines[body - 1] = value if turns else 0.0
    write_sines_and_cosines(sines, bodies - 1, cosines)
    for body in range(1, bodies):
        turns, axis, offset = joint_of(model, body)
        parent, value = parent_of(model, body), angles[driven + velocity_of(model, body)]
        above = read_part(frames, parent, 0, ROTATION)
        origin = add(read_part(frames, parent, ORIGIN, VECTOR), rotate(above, offset))
        along = rotate(above, axis)
        motion_subspace = base + body - 1
        s, c = sines[body - 1], cosines[body - 1]
        if turns:
            write_part(motion_subspaces, motion_subspace, 0, along)
            write_part(motion_subspaces, motion_subspace, 3, cross(origin, along))
        else:
            origin = add(origin, scale(along, value))
            write_part(motion_subspaces, motion_subspace, 0, VECTOR)
            write_part(motion_subspaces, motion_subspace, 3, along)
        own = product(above, rotation_of_joint(model, body, s, c))
        write_part(frames, body, 0, own)
        write_part(frames, body, ORIGIN, origin)
    for k in range(base, velocities_of(model)):
        frames[k - base + 1, _POSITION] = angles[driven + k]
    s, c = sin_cos(yaw)
    return Posture(frames, motion_subspaces, s, c, x, y)


@formula
def base_motion(base: int, rates: Array) -> tuple[Vector, Vector]:
    """Return angular velocity and velocity of the base, in its own frame."""
    if base == DIFFERENTIAL:
        return (0.0, 0.0, rates[1]), (rates[0], 0.0, 0.0)
    if base == OMNIDIRECTIONAL:
        return (0.0, 0.0, rates[2]), (rates[0], rates[1], 0.0)
    return VECTOR, VECTOR


@formula
def crossed(w: Vector, v: Vector, sw: Vector, sv: Vector) -> tuple[Vector, Vector]:
    """Return the spatial cross product of two motions (w, v) x (sw, sv)."""
    return cross(w, sw), add(cross(w, sv), cross(v, sw))


@formula
def sum_of(motion: Array, body: int, first: int, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return the sum of the motion in a row and another motion."""
    return (
        add(read_part(motion, body, first, VECTOR), w),
        add(read_part(motion, body, first + 3, VECTOR), v),
    )


@formula
def write_velocity(
    model: TreeModel, motion_subspaces: Array, rates: Array, motion: Array, first: int, body: int
) -> tuple[Vector, Vector]:
    """Write and return the motion of a body, after that of its parent; see `velocities`."""
    base = base_of(model)
    if body == 0:
        w, v = base_motion(base, rates)
    else:
        row, rate = base + body - 1, rates[velocity_of(model, body)]
        sw = scale(read_part(motion_subspaces, row, 0, VECTOR), rate)
        sv = scale(read_part(motion_subspaces, row, 3, VECTOR), rate)
        w, v = sum_of(motion, parent_of(model, body), first, sw, sv)
    write_part(motion, body, first, w)
    write_part(motion, body, first + 3, v)
    return w, v


@kernel
def velocities(
    model: TreeModel, posture: Posture, rates: Array, motion: Array, first: int
) -> None:
    """Write the motions of all bodies at rates (n) into [:, first to first + 6] of `motion`."""
    motion_subspaces = posture.motion_subspaces
    for body in range(bodies_of(model)):
        write_velocity(model, motion_subspaces, rates, motion, first, body)


@formula
def power(motion_subspaces: Array, row: int, moment: Vector, force: Vector) -> float:
    """Return the power of a wrench in a row of motion subspaces, per velocity."""
    return inner(read_part(motion_subspaces, row, 0, VECTOR), moment) + inner(
        read_part(motion_subspaces, row, 3, VECTOR), force
    )


@formula
def to_world(posture: Posture) -> Rotation:
    """Return the base's rotation in the world."""
    return turn((0.0, 0.0, 1.0), posture.sine, posture.cosine)


@formula
def _tip(posture: Posture, body: int, point: Vector) -> Vector:
    """Return the position of a body's point in the base's frame."""
    r = read_part(posture.frames, body, 0, ROTATION)
    return add(read_part(posture.frames, body, ORIGIN, VECTOR), rotate(r, point))


@formula
def towards_base(model: TreeModel, base: int, row: int) -> int:
    """Return the next row of motion subspaces on the way to the world; -1 at its end."""
    if row < base:
        return row - 1
    at = parent_of(model, row - base + 1)
    return base + at - 1


@formula
def _velocity_of_row(model: TreeModel, base: int, row: int) -> int:
    """Return the index of the velocity of a row of motion subspaces."""
    return row if row < base else velocity_of(model, row - base + 1)


@formula
def _put_column(
    columns: Array, k: int, linear: Vector, angular: Vector, adds: bool
) -> None:
    """Write the motion per velocity k, or add it to that of other bodies with this velocity."""
    if adds:
        linear = add(read_part(columns, k, 0, VECTOR), linear)
        angular = add(read_part(columns, k, 3, VECTOR), angular)
    write_part(columns, k, 0, linear)
    write_part(columns, k, 3, angular)


@kernel
def point_velocity(
    model: TreeModel, posture: Posture, velocity: Array, body: int, point: Vector
) -> tuple[Vector, Vector]:
    """Return a point's velocity and its body's angular velocity in the world."""
    moved = scratch(bodies_of(model), 6)
    velocities(model, posture, velocity, moved, 0)
    w, world = read_part(moved, body, 0, VECTOR), to_world(posture)
    v = add(read_part(moved, body, 3, VECTOR), cross(w, _tip(posture, body, point)))
    return rotate(world, v), rotate(world, w)


@kernel
def point_jacobian(model: TreeModel, posture: Posture, body: int, point: Vector) -> Array:
    """
    Return the Jacobian of a body's point, in the world's frame.

    Parameters
    ----------
    model
        the robot.
    posture
        of its bodies.
    body
        number of the body.
    point
        in the body's frame, in m.

    Returns
    -------
        its columns (n, 6): per velocity, that of the point and the body's angular velocity.

    """
    columns = np.empty((velocities_of(model), 6))
    write_jacobian(model, posture, body, point, columns)
    return columns


@kernel
def write_jacobian(
    model: TreeModel, posture: Posture, body: int, point: Vector, columns: Array
) -> None:
    """Write the result of `point_jacobian`."""
    motion_subspaces = posture.motion_subspaces
    base, world, adds = base_of(model), to_world(posture), is_coupled(model)
    clear(columns)
    tip, row = _tip(posture, body, point), base + body - 1
    while row >= 0:
        w = read_part(motion_subspaces, row, 0, VECTOR)
        v = add(read_part(motion_subspaces, row, 3, VECTOR), cross(w, tip))
        k = _velocity_of_row(model, base, row)
        _put_column(columns, k, rotate(world, v), rotate(world, w), adds)
        row = towards_base(model, base, row)


@kernel
def point_jacobian_rate(
    model: TreeModel, posture: Posture, velocity: Array, body: int, point: Vector
) -> Array:
    """Return the time derivative of `point_jacobian` at velocities nu (n)."""
    columns = np.empty((velocities_of(model), 6))
    write_jacobian_rate(model, posture, velocity, body, point, columns)
    return columns


@kernel
def write_jacobian_rate(
    model: TreeModel, posture: Posture, velocity: Array, body: int, point: Vector, columns: Array
) -> None:
    """Write the result of `point_jacobian_rate`."""
    motion_subspaces = posture.motion_subspaces
    base, world, adds = base_of(model), to_world(posture), is_coupled(model)
    clear(columns)
    moved = scratch(bodies_of(model), 6)
    velocities(model, posture, velocity, moved, 0)
    tip, row = _tip(posture, body, point), base + body - 1
    w, v = read_part(moved, body, 0, VECTOR), read_part(moved, body, 3, VECTOR)
    speed = add(v, cross(w, tip))
    while row >= 0:
        at = max(row - base + 1, 0)
        motion_subspace = read_part(motion_subspaces, row, 0, VECTOR)
        turned, carried = crossed(
            read_part(moved, at, 0, VECTOR),
            read_part(moved, at, 3, VECTOR),
            motion_subspace,
            read_part(motion_subspaces, row, 3, VECTOR),
        )
        change = add(add(carried, cross(turned, tip)), cross(motion_subspace, speed))
        k = _velocity_of_row(model, base, row)
        _put_column(columns, k, rotate(world, change), rotate(world, turned), adds)
        row = towards_base(model, base, row)


@kernel
def add_point_forces(
    model: TreeModel,
    posture: Posture,
    body: int,
    point: Vector,
    force: Vector,
    moment: Vector,
    generalised: Array,
) -> None:
    """Add the generalised forces of a force and moment on a point, in the world, to forces (n)."""
    motion_subspaces = posture.motion_subspaces
    base, world = base_of(model), to_world(posture)
    f = rotate_back(world, force)
    about = add(rotate_back(world, moment), cross(_tip(posture, body, point), f))
    row = base + body - 1
    while row >= 0:
        k = _velocity_of_row(model, base, row)
        generalised[k] += power(motion_subspaces, row, about, f)
        row = towards_base(model, base, row)
