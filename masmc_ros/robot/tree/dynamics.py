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

"""
Dynamics of a tree of bodies on a base, with + - x and / only besides sines and cosines.

Velocities nu are the base's rates in its own frame (none; u, omega; or u, v, omega), then the
joints' rates in the tree's order; forces are conjugate to them. Everything is expressed in the
base's frame, about its origin: motions as angular velocity and velocity of what is at that origin,
wrenches as moment about it and force. Nothing has to be transformed from body to body then, and
the base, whose motion subspace is constant in its own frame, needs no constraint forces where it
cannot slip sideways.

Body 0 is the base, every body comes after its parent. SI units, radians; z of the base is up.

`inverse_dynamics` is the form of Slotine and Li (Echeandia and Wensing, arXiv 2010.01033): H a_r +
C(nu) nu_r + g with Hdot - 2 C skew-symmetric, linear in the bodies' moments.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.numerics.arrays import parted, read_along, read_part, write_along, write_part
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.portable_math import padded, sin_cos, write_sines_and_cosines
from masmc_ros.numerics.scratch import clear, scratch
from masmc_ros.robot.tree.model import (
    base_of,
    bodies_of,
    DIFFERENTIAL,
    FIXED,
    joint_of,
    OMNIDIRECTIONAL,
    parent_of,
    rotation_of_joint,
    rotors_begin,
    TreeModel,
)
from masmc_ros.robot.tree.spatial import (
    add,
    cross,
    inner,
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
    turn,
    VECTOR,
    Vector,
    velocity_map,
    wrench,
)
import numpy as np

GRAVITY = 9.81
"""m/s^2, downwards."""

_ORIGIN = 9
_POSITION = 12
_REFERENCE, _ACCELERATION = 6, 12

MOTION = 18
"""What a body's motion has: angular velocity and velocity of each of the three."""


class Posture(NamedTuple):
    """
    Where bodies are in the base's frame, and the base in the world's.

    Loops take its arrays out first: to take one is to count a reference, which costs time.
    """

    frames: Any
    """(B, 13) rotation, row by row, origin in m, and position of the joint in rad or m."""
    screws: Any
    """(n, 6) motion per velocity: angular velocity, velocity of what is at the base's origin."""
    sine: float
    """Of the base's yaw."""
    cosine: float
    x: float
    """Of the base's origin in the world, in m."""
    y: float


@formula
def joint_position(posture: Posture, body: int) -> float:
    """Return the position of a body's joint, in rad or m."""
    return posture.frames[body, _POSITION]


@kernel
def place(
    model: TreeModel, x: float, y: float, yaw: float, position: Any, first: int
) -> Posture:
    """
    Place all bodies.

    Parameters
    ----------
    model
        the robot.
    x, y, yaw
        pose of the base in the world, in m and rad.
    position
        vector that has the joints' positions from `first` on.
    first
        place of the first of them.

    """
    bodies, base = bodies_of(model), base_of(model)
    size, wide = base + bodies - 1, _POSITION + 1
    frames, screws = parted(np.empty(bodies * wide + size * 6), bodies, wide, size, 6)
    write_part(frames, 0, 0, ROTATION)
    write_part(frames, 0, _ORIGIN, VECTOR)
    for k in range(base):
        write_part(screws, k, 0, VECTOR)
        write_part(screws, k, 3, VECTOR)
    if base != FIXED:
        screws[0, 3], screws[base - 1, 2] = 1.0, 1.0
        if base == OMNIDIRECTIONAL:
            screws[1, 4] = 1.0
    sines, cosines = scratch(padded(bodies - 1)), scratch(padded(bodies - 1))
    for body in range(1, bodies):
        turns, _, _ = joint_of(model, body)
        sines[body - 1] = position[first + body - 1] if turns else 0.0
    write_sines_and_cosines(sines, bodies - 1, cosines)
    for body in range(1, bodies):
        turns, axis, offset = joint_of(model, body)
        parent, value = parent_of(model, body), position[first + body - 1]
        above = read_part(frames, parent, 0, ROTATION)
        origin = add(read_part(frames, parent, _ORIGIN, VECTOR), rotate(above, offset))
        along = rotate(above, axis)
        screw = base + body - 1
        s, c = sines[body - 1], cosines[body - 1]
        if turns:
            write_part(screws, screw, 0, along)
            write_part(screws, screw, 3, cross(origin, along))
        else:
            origin = add(origin, scale(along, value))
            write_part(screws, screw, 0, VECTOR)
            write_part(screws, screw, 3, along)
        own = product(above, rotation_of_joint(model, body, s, c))
        write_part(frames, body, 0, own)
        write_part(frames, body, _ORIGIN, origin)
        frames[body, _POSITION] = value
    s, c = sin_cos(yaw)
    return Posture(frames, screws, s, c, x, y)


@formula
def base_motion(base: int, rates: Any) -> tuple[Vector, Vector]:
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
def _sum_of(motion: Any, body: int, first: int, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return the sum of the motion in a row and of another."""
    return (
        add(read_part(motion, body, first, VECTOR), w),
        add(read_part(motion, body, first + 3, VECTOR), v),
    )


@formula
def write_velocity(
    model: TreeModel, screws: Any, rates: Any, motion: Any, first: int, body: int
) -> tuple[Vector, Vector]:
    """Write the motion of a body as `velocities` does, its parent's being there, and return it."""
    base = base_of(model)
    if body == 0:
        w, v = base_motion(base, rates)
    else:
        k = base + body - 1
        sw = scale(read_part(screws, k, 0, VECTOR), rates[k])
        sv = scale(read_part(screws, k, 3, VECTOR), rates[k])
        w, v = _sum_of(motion, parent_of(model, body), first, sw, sv)
    write_part(motion, body, first, w)
    write_part(motion, body, first + 3, v)
    return w, v


@kernel
def velocities(model: TreeModel, posture: Posture, rates: Any, motion: Any, first: int) -> None:
    """Write the motions of all bodies at rates (n) into [:, first to first + 6] of `motion`."""
    screws = posture.screws
    for body in range(bodies_of(model)):
        write_velocity(model, screws, rates, motion, first, body)


@kernel
def write_motions(
    model: TreeModel,
    posture: Posture,
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
    motion: Any,
) -> None:
    """
    Write velocities, reference velocities and reference accelerations of bodies (B, MOTION).

    Of nu, nu_r and a_r; gravity in m/s^2, downwards.
    """
    screws = posture.screws
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
        k = base + body - 1
        along = read_part(screws, k, 0, VECTOR)
        across = read_part(screws, k, 3, VECTOR)
        turned, moved = crossed(
            read_part(motion, body, 0, VECTOR),
            read_part(motion, body, 3, VECTOR),
            scale(along, reference[k]),
            scale(across, reference[k]),
        )
        alpha, a = _sum_of(
            motion,
            parent_of(model, body),
            _ACCELERATION,
            add(scale(along, acceleration[k]), turned),
            add(scale(across, acceleration[k]), moved),
        )
        write_part(motion, body, _ACCELERATION, alpha)
        write_part(motion, body, _ACCELERATION + 3, a)


@formula
def _reference_field(motion: Any, body: int) -> tuple[Rotation, Vector]:
    """Return A and c of a body, whose points x have the reference acceleration A x + c."""
    omega = read_part(motion, body, 0, VECTOR)
    v = read_part(motion, body, 3, VECTOR)
    w = read_part(motion, body, _REFERENCE, VECTOR)
    alpha = read_part(motion, body, _ACCELERATION, VECTOR)
    a = read_part(motion, body, _ACCELERATION + 3, VECTOR)
    return velocity_map(w, omega, alpha), add(a, cross(w, v))


@formula
def moments_about_base(posture: Posture, theta: Any, body: int) -> Moments:
    """Return the moments of a body about the base's origin."""
    own: Moments = read_along(theta, PER_BODY * body, MOMENTS)
    if body == 0:
        return own
    frames = posture.frames
    return moments_in_parent(
        read_part(frames, body, 0, ROTATION), read_part(frames, body, _ORIGIN, VECTOR), own
    )


@formula
def power(screws: Any, k: int, moment: Vector, force: Vector) -> float:
    """Return the power of a wrench per velocity k."""
    return inner(read_part(screws, k, 0, VECTOR), moment) + inner(
        read_part(screws, k, 3, VECTOR), force
    )


@kernel
def write_forces(
    model: TreeModel, posture: Posture, theta: Any, motion: Any, acceleration: Any, forces: Any
) -> None:
    """Write H a_r + C(nu) nu_r + g (n) of the motions that `write_motions` writes."""
    screws = posture.screws
    bodies, base = bodies_of(model), base_of(model)
    size, rotors = base + bodies - 1, rotors_begin(model)
    wrenches = scratch(bodies, 6)
    for body in range(bodies):
        a, c = _reference_field(motion, body)
        moment, force = wrench(a, c, moments_about_base(posture, theta, body))
        write_part(wrenches, body, 0, moment)
        write_part(wrenches, body, 3, force)
    for body in range(bodies - 1, 0, -1):
        moment = read_part(wrenches, body, 0, VECTOR)
        force = read_part(wrenches, body, 3, VECTOR)
        forces[base + body - 1] = power(screws, base + body - 1, moment, force)
        parent = parent_of(model, body)
        for i in range(6):
            wrenches[parent, i] += wrenches[body, i]
    moment, force = read_part(wrenches, 0, 0, VECTOR), read_part(wrenches, 0, 3, VECTOR)
    for k in range(base):
        forces[k] = power(screws, k, moment, force)
    for row in range(size):
        total = forces[row]
        for other in range(size):
            total += model.numbers[rotors + row * size + other, model.lane] * acceleration[other]
        forces[row] = total


@kernel
def inverse_dynamics(
    model: TreeModel,
    posture: Posture,
    theta: Any,
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
) -> Any:
    """
    Return H a_r + C(nu) nu_r + g (n).

    Parameters
    ----------
    model
        the robot.
    posture
        of its bodies.
    theta
        (10 B) moments of its bodies, one after the other.
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
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
    error: Any,
) -> Any:
    """
    Return Y' sigma (10 B): what adaptation of the moments follows.

    sigma' (H a_r + C nu_r + g) is the sum of moments times gradients, but for rotors and wheels;
    the matrix Y is never formed. `error` (n) is sigma; the others as for `inverse_dynamics`.
    """
    bodies = bodies_of(model)
    motion, gradients = scratch(bodies, MOTION), np.empty(PER_BODY * bodies)
    write_motions(model, posture, velocity, reference, acceleration, gravity, motion)
    write_gradients(model, posture, motion, error, gradients)
    return gradients


@kernel
def write_gradients(
    model: TreeModel, posture: Posture, motion: Any, error: Any, gradients: Any
) -> None:
    """Write Y' sigma of the motions that `write_motions` writes."""
    frames = posture.frames
    bodies = bodies_of(model)
    moved = scratch(bodies, 6)
    velocities(model, posture, error, moved, 0)
    for body in range(bodies):
        r = read_part(frames, body, 0, ROTATION)
        p = read_part(frames, body, _ORIGIN, VECTOR)
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
def write_inertia(model: TreeModel, posture: Posture, theta: Any, matrix: Any) -> None:
    """Write H (n, n), as `inertia` returns it."""
    screws = posture.screws
    bodies, base = bodies_of(model), base_of(model)
    size, rotors = base + bodies - 1, rotors_begin(model)
    # Of the bodies, and then of composite ones: each with all that hangs on it.
    moments = scratch(bodies, PER_BODY)
    for body in range(bodies):
        write_part(moments, body, 0, moments_about_base(posture, theta, body))
    for row in range(size):
        for column in range(size):
            matrix[row, column] = model.numbers[rotors + row * size + column, model.lane]
    for row in range(size - 1, -1, -1):
        body = max(row - base + 1, 0)
        moment, force = momentum(
            read_part(moments, body, 0, MOMENTS),
            read_part(screws, row, 0, VECTOR),
            read_part(screws, row, 3, VECTOR),
        )
        matrix[row, row] += power(screws, row, moment, force)
        at = body
        if body > 0:
            at = parent_of(model, body)
            for i in range(PER_BODY):
                moments[at, i] += moments[body, i]
        while at > 0:
            column = base + at - 1
            matrix[column, row] += power(screws, column, moment, force)
            matrix[row, column] = matrix[column, row]
            at = parent_of(model, at)
        for column in range(min(row, base)):
            matrix[column, row] += power(screws, column, moment, force)
            matrix[row, column] = matrix[column, row]


@kernel
def inertia(model: TreeModel, posture: Posture, theta: Any) -> Any:
    """
    Return H (n, n), of moments (10 B): composite bodies, O(n depth).

    With the constant inertia of rotors and wheels.
    """
    size = len(posture.screws)
    matrix = np.empty((size, size))
    write_inertia(model, posture, theta, matrix)
    return matrix


@kernel
def factor(matrix: Any) -> None:
    """Factor a symmetric matrix (n, n) into L D L', in place, L below the diagonal D."""
    for row in range(len(matrix)):
        for column in range(row):
            entry = matrix[row, column]
            for k in range(column):
                entry -= matrix[row, k] * matrix[column, k]
            matrix[row, column] = entry
        pivot = matrix[row, row]
        for column in range(row):
            scaled = matrix[row, column]
            part = scaled / matrix[column, column]
            pivot -= part * scaled
            matrix[row, column] = part
        matrix[row, row] = pivot


@kernel
def solve(factored: Any, x: Any) -> None:
    """Solve L D L' x = b in place, of x (n) that holds b."""
    size = len(factored)
    for row in range(size):
        value = x[row]
        for k in range(row):
            value -= factored[row, k] * x[k]
        x[row] = value
    for row in range(size):
        x[row] /= factored[row, row]
    for row in range(size - 1, -1, -1):
        value = x[row]
        for k in range(row):
            x[k] -= factored[row, k] * value


@formula
def _tip(posture: Posture, body: int, point: Vector) -> Vector:
    """Return where a body's point is in the base's frame."""
    r = read_part(posture.frames, body, 0, ROTATION)
    return add(read_part(posture.frames, body, _ORIGIN, VECTOR), rotate(r, point))


@formula
def to_world(posture: Posture) -> Rotation:
    """Return the base's rotation in the world."""
    return turn((0.0, 0.0, 1.0), posture.sine, posture.cosine)


@formula
def towards_base(model: TreeModel, base: int, k: int) -> int:
    """Return the next velocity on the way from velocity k to the world; -1 for none."""
    if k < base:
        return k - 1
    at = parent_of(model, k - base + 1)
    return base + at - 1


@kernel
def point_velocity(
    model: TreeModel, posture: Posture, velocity: Any, body: int, point: Vector
) -> tuple[Vector, Vector]:
    """Return a point's velocity and its body's angular velocity, arguments as below."""
    moved = scratch(bodies_of(model), 6)
    velocities(model, posture, velocity, moved, 0)
    w, world = read_part(moved, body, 0, VECTOR), to_world(posture)
    v = add(read_part(moved, body, 3, VECTOR), cross(w, _tip(posture, body, point)))
    return rotate(world, v), rotate(world, w)


@kernel
def point_jacobian(model: TreeModel, posture: Posture, body: int, point: Vector) -> Any:
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
    columns = np.empty((len(posture.screws), 6))
    write_jacobian(model, posture, body, point, columns)
    return columns


@kernel
def write_jacobian(
    model: TreeModel, posture: Posture, body: int, point: Vector, columns: Any
) -> None:
    """Write what `point_jacobian` returns."""
    screws = posture.screws
    base, world = base_of(model), to_world(posture)
    clear(columns)
    tip, k = _tip(posture, body, point), base + body - 1
    while k >= 0:
        w = read_part(screws, k, 0, VECTOR)
        v = add(read_part(screws, k, 3, VECTOR), cross(w, tip))
        write_part(columns, k, 0, rotate(world, v))
        write_part(columns, k, 3, rotate(world, w))
        k = towards_base(model, base, k)


@kernel
def point_jacobian_rate(
    model: TreeModel, posture: Posture, velocity: Any, body: int, point: Vector
) -> Any:
    """Return the derivative by time of `point_jacobian` at velocities nu (n)."""
    columns = np.empty((len(posture.screws), 6))
    write_jacobian_rate(model, posture, velocity, body, point, columns)
    return columns


@kernel
def write_jacobian_rate(
    model: TreeModel, posture: Posture, velocity: Any, body: int, point: Vector, columns: Any
) -> None:
    """Write what `point_jacobian_rate` returns."""
    screws = posture.screws
    base, world = base_of(model), to_world(posture)
    clear(columns)
    moved = scratch(bodies_of(model), 6)
    velocities(model, posture, velocity, moved, 0)
    tip, k = _tip(posture, body, point), base + body - 1
    w, v = read_part(moved, body, 0, VECTOR), read_part(moved, body, 3, VECTOR)
    speed = add(v, cross(w, tip))
    while k >= 0:
        at = max(k - base + 1, 0)
        screw = read_part(screws, k, 0, VECTOR)
        turned, carried = crossed(
            read_part(moved, at, 0, VECTOR),
            read_part(moved, at, 3, VECTOR),
            screw,
            read_part(screws, k, 3, VECTOR),
        )
        change = add(add(carried, cross(turned, tip)), cross(screw, speed))
        write_part(columns, k, 0, rotate(world, change))
        write_part(columns, k, 3, rotate(world, turned))
        k = towards_base(model, base, k)


@kernel
def add_point_forces(
    model: TreeModel,
    posture: Posture,
    body: int,
    point: Vector,
    force: Vector,
    moment: Vector,
    found: Any,
) -> None:
    """Add to forces (n) those that do the work of force and moment on a point, in the world."""
    screws = posture.screws
    base, world = base_of(model), to_world(posture)
    f = rotate_back(world, force)
    about = add(rotate_back(world, moment), cross(_tip(posture, body, point), f))
    k = base + body - 1
    while k >= 0:
        found[k] += power(screws, k, about, f)
        k = towards_base(model, base, k)
