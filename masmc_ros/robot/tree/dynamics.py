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
Dynamics of a tree of bodies on a base, O(n), with + - x and / only besides sines and cosines.

Velocities nu are the base's rates in its own frame (none; u, omega; or u, v, omega), then the
joints' rates in the tree's order; forces are conjugate to them. In the base's frame its motion
subspace is constant, so that a base that cannot slip sideways needs no constraint forces.

Arrays are [body, component, lane], or [component, lane] for what a robot has one of; lanes are
innermost, so that LLVM vectorises across runs. Body 0 is the base, every body comes after its
parent. SI units, radians; z of the base is up.

`inverse_dynamics` is the form of Slotine and Li (Echeandia and Wensing, arXiv 2010.01033): H a_r +
C(nu) nu_r + g with Hdot - 2 C skew-symmetric, linear in the bodies' moments.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.numerics.arrays import read_row, write_row
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.tree.spatial import (
    add,
    cross,
    inner,
    MOMENTS,
    moments_in_parent,
    power_gradient,
    product,
    rotate,
    rotate_back,
    ROTATION,
    Rotation,
    scale,
    subtract,
    turn,
    VECTOR,
    Vector,
    velocity_map,
    wrench,
)
import numpy as np

REVOLUTE, PRISMATIC = 0, 1
"""Kinds of joints; a continuous one is revolute without limits."""

FIXED, DIFFERENTIAL, OMNIDIRECTIONAL = 0, 2, 3
"""Kinds of bases, which are the numbers of their rates."""

GRAVITY = 9.81
"""m/s^2, downwards."""


class Tree(NamedTuple):
    """What does not change while a robot moves; arrays over bodies, of which 0 is the base."""

    base: int
    """Kind of the base."""
    parent: Any
    """(B) number of the body that each hangs on; that of the base is not read."""
    kind: Any
    """(B) kind of each body's joint."""
    axis: Any
    """(B, 3, 1) unit axis in the body's frame (and in that of its placement)."""
    rotation: Any
    """(B, 9, 1) of each body's frame in its parent's, with the joint at zero."""
    offset: Any
    """(B, 3, 1) of each body's origin in its parent's frame, with the joint at zero, in m."""
    armature: Any
    """(n, n) constant inertia of rotors and wheels in velocities nu, in kg, kg m and kg m^2."""
    lanes: tuple[float, ...] = ()
    """As many numbers as all arrays have lanes, so that compiled code knows; none if any."""


class Placement(NamedTuple):
    """Where bodies are in their parents' frames, the base in the world's: arrays over bodies."""

    rotation: Any
    """(B, 9, lanes)."""
    offset: Any
    """(B, 3, lanes) in m."""


@formula
def _base_rates(base: int, velocity: Any, lane: int) -> tuple[float, float, float]:
    """Return u, v and omega of the base."""
    if base == DIFFERENTIAL:
        return velocity[0, lane], 0.0, velocity[1, lane]
    if base == OMNIDIRECTIONAL:
        return velocity[0, lane], velocity[1, lane], velocity[2, lane]
    return 0.0, 0.0, 0.0


@formula
def _joint_part(kind: int, axis: Vector, rate: float) -> tuple[Vector, Vector]:
    """Return angular and linear velocity across a joint, S rate."""
    along = scale(axis, rate)
    return (along, VECTOR) if kind == REVOLUTE else (VECTOR, along)


@formula
def _into_child(r: Rotation, p: Vector, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return a spatial motion about the child's origin, in its frame."""
    return rotate_back(r, w), rotate_back(r, add(v, cross(w, p)))


@formula
def _from_parent(
    placement: Any, motion: Any, parent: int, body: int, first: int, lane: int
) -> tuple[Vector, Vector]:
    """Return the spatial motion [:, first to first + 6] of a body's parent in its own frame."""
    return _into_child(
        read_row(placement.rotation, body, 0, lane, ROTATION),
        read_row(placement.offset, body, 0, lane, VECTOR),
        read_row(motion, parent, first, lane, VECTOR),
        read_row(motion, parent, first + 3, lane, VECTOR),
    )


@formula
def _into_parent(r: Rotation, p: Vector, moment: Vector, force: Vector) -> tuple[Vector, Vector]:
    """Return a wrench about the child's origin as one about the parent's, in its frame."""
    turned = rotate(r, force)
    return add(rotate(r, moment), cross(p, turned)), turned


@formula
def _crossed(w: Vector, v: Vector, sw: Vector, sv: Vector) -> tuple[Vector, Vector]:
    """Return the spatial cross product of two motions (w, v) x (sw, sv)."""
    return cross(w, sw), add(cross(w, sv), cross(v, sw))


@kernel
def place(tree: Tree, position: Any, placement: Placement) -> None:
    """
    Place every body in its parent's frame.

    `position` (p, lanes): x and y in m and yaw of a base that moves, then the joints'
    positions.
    """
    lanes = len(tree.lanes) or position.shape[1]
    first = 0
    for lane in range(lanes):
        write_row(placement.rotation, 0, 0, lane, ROTATION)
        write_row(placement.offset, 0, 0, lane, VECTOR)
    if tree.base != FIXED:
        first = 3
        for lane in range(lanes):
            s, c = sin_cos(position[2, lane])
            write_row(placement.rotation, 0, 0, lane, turn((0.0, 0.0, 1.0), s, c))
            write_row(placement.offset, 0, 0, lane, (position[0, lane], position[1, lane], 0.0))
    for body in range(1, len(tree.parent)):
        axis = read_row(tree.axis, body, 0, 0, VECTOR)
        rotation = read_row(tree.rotation, body, 0, 0, ROTATION)
        offset = read_row(tree.offset, body, 0, 0, VECTOR)
        joint = first + body - 1
        if tree.kind[body] == REVOLUTE:
            for lane in range(lanes):
                s, c = sin_cos(position[joint, lane])
                write_row(placement.rotation, body, 0, lane, product(rotation, turn(axis, s, c)))
                write_row(placement.offset, body, 0, lane, offset)
        else:
            along = rotate(rotation, axis)
            for lane in range(lanes):
                moved = add(offset, scale(along, position[joint, lane]))
                write_row(placement.rotation, body, 0, lane, rotation)
                write_row(placement.offset, body, 0, lane, moved)


@kernel
def inverse_dynamics(
    tree: Tree,
    moments: Any,
    placement: Placement,
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
    forces: Any,
) -> None:
    """
    Write H a_r + C(nu) nu_r + g into `forces`.

    Parameters
    ----------
    tree
        the robot.
    moments
        (B, 10, lanes) of the bodies.
    placement
        of its bodies.
    velocity
        (n, lanes) nu.
    reference
        (n, lanes) nu_r.
    acceleration
        (n, lanes) a_r.
    gravity
        m/s^2, downwards.
    forces
        (n, lanes).

    """
    bodies, lanes = len(tree.parent), len(tree.lanes) or velocity.shape[1]
    rates = len(velocity) - (bodies - 1)
    motion = np.empty((bodies, 18, lanes))
    carried = np.zeros((bodies, 6, lanes))
    _move(tree, placement, velocity, reference, acceleration, gravity, motion)
    for body in range(bodies):
        for lane in range(lanes):
            a, c = _reference_motion(motion, body, lane)
            moment, force = wrench(a, c, read_row(moments, body, 0, lane, MOMENTS))
            write_row(carried, body, 0, lane, moment)
            write_row(carried, body, 3, lane, force)
    for body in range(bodies - 1, 0, -1):
        axis = read_row(tree.axis, body, 0, 0, VECTOR)
        part = 0 if tree.kind[body] == REVOLUTE else 3
        parent = tree.parent[body]
        for lane in range(lanes):
            along = read_row(carried, body, part, lane, VECTOR)
            forces[rates + body - 1, lane] = inner(axis, along)
            moment, force = _into_parent(
                read_row(placement.rotation, body, 0, lane, ROTATION),
                read_row(placement.offset, body, 0, lane, VECTOR),
                read_row(carried, body, 0, lane, VECTOR),
                read_row(carried, body, 3, lane, VECTOR),
            )
            for i in range(3):
                carried[parent, i, lane] += moment[i]
                carried[parent, 3 + i, lane] += force[i]
    _onto_base(tree.base, carried, forces, lanes)
    for row in range(len(velocity)):
        for other in range(len(velocity)):
            if tree.armature[row, other] != 0.0:
                for lane in range(lanes):
                    forces[row, lane] += tree.armature[row, other] * acceleration[other, lane]


@kernel
def moment_gradients(
    tree: Tree,
    placement: Placement,
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
    error: Any,
    gradients: Any,
) -> None:
    """
    Write Y' sigma into `gradients` (B, 10, lanes): what adaptation of the moments follows.

    sigma' (H a_r + C nu_r + g) is the sum over bodies of moments times gradients; the matrix Y
    is never formed. `error` (n, lanes) is sigma; the others as for `inverse_dynamics`.
    """
    bodies, lanes = len(tree.parent), len(tree.lanes) or velocity.shape[1]
    motion = np.empty((bodies, 18, lanes))
    moved = np.empty((bodies, 6, lanes))
    _move(tree, placement, velocity, reference, acceleration, gravity, motion)
    _velocities(tree, placement, error, moved, 0)
    for body in range(bodies):
        for lane in range(lanes):
            a, c = _reference_motion(motion, body, lane)
            w = read_row(moved, body, 0, lane, VECTOR)
            v = read_row(moved, body, 3, lane, VECTOR)
            write_row(gradients, body, 0, lane, power_gradient(a, c, w, v))


@formula
def _reference_motion(motion: Any, body: int, lane: int) -> tuple[Rotation, Vector]:
    """Return A and c of a body, whose points x have the reference acceleration A x + c."""
    omega = read_row(motion, body, 0, lane, VECTOR)
    v = read_row(motion, body, 3, lane, VECTOR)
    w = read_row(motion, body, 6, lane, VECTOR)
    alpha = read_row(motion, body, 12, lane, VECTOR)
    a = read_row(motion, body, 15, lane, VECTOR)
    return velocity_map(w, omega, alpha), add(a, cross(w, v))


@kernel
def _velocities(tree: Tree, placement: Placement, rates: Any, motion: Any, first: int) -> None:
    """Write the spatial velocities of rates (n, lanes) into [:, first to first + 6]."""
    bodies, lanes = len(tree.parent), len(tree.lanes) or rates.shape[1]
    joints = len(rates) - (bodies - 1)
    for lane in range(lanes):
        u, v, omega = _base_rates(tree.base, rates, lane)
        write_row(motion, 0, first, lane, (0.0, 0.0, omega))
        write_row(motion, 0, first + 3, lane, (u, v, 0.0))
    for body in range(1, bodies):
        axis = read_row(tree.axis, body, 0, 0, VECTOR)
        parent, kind = tree.parent[body], tree.kind[body]
        for lane in range(lanes):
            w, v = _from_parent(placement, motion, parent, body, first, lane)
            sw, sv = _joint_part(kind, axis, rates[joints + body - 1, lane])
            write_row(motion, body, first, lane, add(w, sw))
            write_row(motion, body, first + 3, lane, add(v, sv))


@kernel
def _move(
    tree: Tree,
    placement: Placement,
    velocity: Any,
    reference: Any,
    acceleration: Any,
    gravity: float,
    motion: Any,
) -> None:
    """Write velocities, reference velocities and reference accelerations of all bodies (18)."""
    bodies, lanes = len(tree.parent), len(tree.lanes) or velocity.shape[1]
    joints = len(velocity) - (bodies - 1)
    _velocities(tree, placement, velocity, motion, 0)
    _velocities(tree, placement, reference, motion, 6)
    for lane in range(lanes):
        u, v, omega = _base_rates(tree.base, acceleration, lane)
        turned, moved = _crossed(
            read_row(motion, 0, 0, lane, VECTOR),
            read_row(motion, 0, 3, lane, VECTOR),
            read_row(motion, 0, 6, lane, VECTOR),
            read_row(motion, 0, 9, lane, VECTOR),
        )
        write_row(motion, 0, 12, lane, add(turned, (0.0, 0.0, omega)))
        write_row(motion, 0, 15, lane, add(moved, (u, v, gravity)))
    for body in range(1, bodies):
        axis = read_row(tree.axis, body, 0, 0, VECTOR)
        parent, kind, joint = tree.parent[body], tree.kind[body], joints + body - 1
        for lane in range(lanes):
            alpha, a = _from_parent(placement, motion, parent, body, 12, lane)
            sw, sv = _joint_part(kind, axis, acceleration[joint, lane])
            rw, rv = _joint_part(kind, axis, reference[joint, lane])
            turned, moved = _crossed(
                read_row(motion, body, 0, lane, VECTOR),
                read_row(motion, body, 3, lane, VECTOR),
                rw,
                rv,
            )
            write_row(motion, body, 12, lane, add(add(alpha, sw), turned))
            write_row(motion, body, 15, lane, add(add(a, sv), moved))


@formula
def _onto_base(base: int, carried: Any, forces: Any, lanes: int) -> None:
    """Write what the base's rates feel of the wrench on the base."""
    for lane in range(lanes):
        if base == DIFFERENTIAL:
            forces[0, lane] = carried[0, 3, lane]
            forces[1, lane] = carried[0, 2, lane]
        elif base == OMNIDIRECTIONAL:
            forces[0, lane] = carried[0, 3, lane]
            forces[1, lane] = carried[0, 4, lane]
            forces[2, lane] = carried[0, 2, lane]


@kernel
def inertia(tree: Tree, moments: Any, placement: Placement, matrix: Any) -> None:
    """
    Write H (n, n, lanes), of moments (B, 10, lanes): composite bodies, O(n depth).

    With the constant inertia of rotors and wheels.
    """
    bodies, size = len(tree.parent), len(matrix)
    lanes = len(tree.lanes) or matrix.shape[2]
    rates = size - (bodies - 1)
    whole = moments.copy()
    for body in range(bodies - 1, 0, -1):
        parent = tree.parent[body]
        for lane in range(lanes):
            moved = moments_in_parent(
                read_row(placement.rotation, body, 0, lane, ROTATION),
                read_row(placement.offset, body, 0, lane, VECTOR),
                read_row(whole, body, 0, lane, MOMENTS),
            )
            for i in range(10):
                whole[parent, i, lane] += moved[i]
    for row in range(size):
        for other in range(size):
            for lane in range(lanes):
                matrix[row, other, lane] = tree.armature[row, other]
    carried = np.empty((1, 6, lanes))
    felt = np.empty((rates, lanes))
    for body in range(1, bodies):
        axis = read_row(tree.axis, body, 0, 0, VECTOR)
        kind, row = tree.kind[body], rates + body - 1
        sw, sv = _joint_part(kind, axis, 1.0)
        for lane in range(lanes):
            moment, force = _momentum(read_row(whole, body, 0, lane, MOMENTS), sw, sv)
            matrix[row, row, lane] += inner(sw, moment) + inner(sv, force)
            write_row(carried, 0, 0, lane, moment)
            write_row(carried, 0, 3, lane, force)
        at = body
        while at != 0:
            parent = tree.parent[at]
            for lane in range(lanes):
                moment, force = _into_parent(
                    read_row(placement.rotation, at, 0, lane, ROTATION),
                    read_row(placement.offset, at, 0, lane, VECTOR),
                    read_row(carried, 0, 0, lane, VECTOR),
                    read_row(carried, 0, 3, lane, VECTOR),
                )
                write_row(carried, 0, 0, lane, moment)
                write_row(carried, 0, 3, lane, force)
            at = parent
            if at != 0:
                part = 0 if tree.kind[at] == REVOLUTE else 3
                along = read_row(tree.axis, at, 0, 0, VECTOR)
                column = rates + at - 1
                for lane in range(lanes):
                    entry = inner(along, read_row(carried, 0, part, lane, VECTOR))
                    matrix[row, column, lane] += entry
                    matrix[column, row, lane] += entry
        _onto_base(tree.base, carried, felt, lanes)
        for column in range(rates):
            for lane in range(lanes):
                matrix[row, column, lane] += felt[column, lane]
                matrix[column, row, lane] += felt[column, lane]
    unit = np.zeros((max(rates, 1), lanes))
    for column in range(rates):
        unit[:] = 0.0
        unit[column] = 1.0
        for lane in range(lanes):
            u, v, omega = _base_rates(tree.base, unit, lane)
            moment, force = _momentum(
                read_row(whole, 0, 0, lane, MOMENTS), (0.0, 0.0, omega), (u, v, 0.0)
            )
            write_row(carried, 0, 0, lane, moment)
            write_row(carried, 0, 3, lane, force)
        _onto_base(tree.base, carried, felt, lanes)
        for row in range(rates):
            for lane in range(lanes):
                matrix[row, column, lane] += felt[row, lane]


@formula
def _momentum(of: Any, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Return the spatial momentum of a body about its origin."""
    rotation = (0.0, -w[2], w[1], w[2], 0.0, -w[0], -w[1], w[0], 0.0)
    return wrench(rotation, v, of)


@kernel
def factor(matrix: Any, known: tuple[float, ...] = ()) -> None:
    """
    Factor symmetric matrices (n, n, lanes) into L D L', in place, L below the diagonal D.

    `known` as `Tree.lanes`.
    """
    size, lanes = len(matrix), len(known) or matrix.shape[2]
    for column in range(size):
        for before in range(column):
            for lane in range(lanes):
                step = matrix[column, before, lane]
                matrix[column, column, lane] -= step * step * matrix[before, before, lane]
        for row in range(column + 1, size):
            for before in range(column):
                for lane in range(lanes):
                    matrix[row, column, lane] -= (
                        matrix[row, before, lane]
                        * matrix[column, before, lane]
                        * matrix[before, before, lane]
                    )
            for lane in range(lanes):
                matrix[row, column, lane] /= matrix[column, column, lane]


@kernel
def solve(factored: Any, x: Any, known: tuple[float, ...] = ()) -> None:
    """Solve L D L' x = b in place, of x (n, lanes) that holds b; `known` as `Tree.lanes`."""
    size, lanes = len(factored), len(known) or factored.shape[2]
    for row in range(size):
        for before in range(row):
            for lane in range(lanes):
                x[row, lane] -= factored[row, before, lane] * x[before, lane]
    for row in range(size - 1, -1, -1):
        for lane in range(lanes):
            x[row, lane] /= factored[row, row, lane]
        for after in range(row + 1, size):
            for lane in range(lanes):
                x[row, lane] -= factored[after, row, lane] * x[after, lane]


@kernel
def forward_dynamics(
    tree: Tree,
    moments: Any,
    placement: Placement,
    velocity: Any,
    forces: Any,
    gravity: float,
    acceleration: Any,
) -> None:
    """Write the acceleration (n, lanes) under forces (n, lanes), H^-1 (forces - C nu - g)."""
    size, lanes = len(velocity), len(tree.lanes) or velocity.shape[1]
    matrix = np.empty((size, size, lanes))
    acceleration[:] = 0.0
    bias = np.empty((size, lanes))
    inverse_dynamics(
        tree, moments, placement, velocity, velocity, acceleration, gravity, bias
    )
    inertia(tree, moments, placement, matrix)
    factor(matrix, tree.lanes)
    for row in range(size):
        for lane in range(lanes):
            acceleration[row, lane] = forces[row, lane] - bias[row, lane]
    solve(matrix, acceleration, tree.lanes)


@kernel
def world_poses(tree: Tree, placement: Placement, poses: Placement) -> None:
    """Write where the bodies are in the world's frame into `poses`."""
    lanes = len(tree.lanes) or placement.offset.shape[2]
    for lane in range(lanes):
        write_row(
            poses.rotation, 0, 0, lane, read_row(placement.rotation, 0, 0, lane, ROTATION)
        )
        write_row(poses.offset, 0, 0, lane, read_row(placement.offset, 0, 0, lane, VECTOR))
    for body in range(1, len(tree.parent)):
        parent = tree.parent[body]
        for lane in range(lanes):
            r = read_row(poses.rotation, parent, 0, lane, ROTATION)
            own = read_row(placement.rotation, body, 0, lane, ROTATION)
            p = rotate(r, read_row(placement.offset, body, 0, lane, VECTOR))
            write_row(poses.rotation, body, 0, lane, product(r, own))
            origin = add(p, read_row(poses.offset, parent, 0, lane, VECTOR))
            write_row(poses.offset, body, 0, lane, origin)


@kernel
def point_jacobian(
    tree: Tree,
    poses: Placement,
    velocity: Any,
    body: int,
    point: Any,
    jacobian: Any,
    derivative: Any,
) -> None:
    """
    Write the Jacobian of a body's point and its derivative by time, in the world's frame.

    Parameters
    ----------
    tree
        the robot.
    poses
        of its bodies in the world's frame.
    velocity
        (n, lanes) nu.
    body
        number of the body.
    point
        (3, lanes) in the body's frame, in m.
    jacobian
        (6, n, lanes): the point's velocity, then the body's angular velocity.
    derivative
        (6, n, lanes).

    """
    bodies, lanes = len(tree.parent), len(tree.lanes) or velocity.shape[1]
    rates = len(velocity) - (bodies - 1)
    jacobian[:] = 0.0
    derivative[:] = 0.0
    # Of every body on the way: angular velocity, and velocity of its origin.
    moved = np.zeros((bodies, 6, lanes))
    way = np.zeros(bodies, np.bool_)
    at = body
    while at != 0:
        way[at] = True
        at = tree.parent[at]
    for lane in range(lanes):
        u, v, omega = _base_rates(tree.base, velocity, lane)
        r = read_row(poses.rotation, 0, 0, lane, ROTATION)
        write_row(moved, 0, 0, lane, (0.0, 0.0, omega))
        write_row(moved, 0, 3, lane, rotate(r, (u, v, 0.0)))
    for each in range(1, body + 1):
        if way[each]:
            parent, axis = tree.parent[each], read_row(tree.axis, each, 0, 0, VECTOR)
            for lane in range(lanes):
                w = read_row(moved, parent, 0, lane, VECTOR)
                r = read_row(poses.rotation, each, 0, lane, ROTATION)
                arm = subtract(
                    read_row(poses.offset, each, 0, lane, VECTOR),
                    read_row(poses.offset, parent, 0, lane, VECTOR),
                )
                v = add(read_row(moved, parent, 3, lane, VECTOR), cross(w, arm))
                sw, sv = _joint_part(
                    tree.kind[each], rotate(r, axis), velocity[rates + each - 1, lane]
                )
                write_row(moved, each, 0, lane, add(w, sw))
                write_row(moved, each, 3, lane, add(v, sv))
    for lane in range(lanes):
        arm = rotate(
            read_row(poses.rotation, body, 0, lane, ROTATION),
            (point[0, lane], point[1, lane], point[2, lane]),
        )
        tip = add(read_row(poses.offset, body, 0, lane, VECTOR), arm)
        speed = add(
            read_row(moved, body, 3, lane, VECTOR),
            cross(read_row(moved, body, 0, lane, VECTOR), arm),
        )
        for each in range(1, body + 1):
            if way[each]:
                r = read_row(poses.rotation, each, 0, lane, ROTATION)
                axis = rotate(r, read_row(tree.axis, each, 0, 0, VECTOR))
                turning = cross(read_row(moved, tree.parent[each], 0, lane, VECTOR), axis)
                column = rates + each - 1
                if tree.kind[each] == REVOLUTE:
                    lever = subtract(tip, read_row(poses.offset, each, 0, lane, VECTOR))
                    rate = subtract(speed, read_row(moved, each, 3, lane, VECTOR))
                    _write_column(jacobian, column, lane, cross(axis, lever), axis)
                    _write_column(
                        derivative,
                        column,
                        lane,
                        add(cross(turning, lever), cross(axis, rate)),
                        turning,
                    )
                else:
                    _write_column(jacobian, column, lane, axis, VECTOR)
                    _write_column(derivative, column, lane, turning, VECTOR)
        if tree.base != FIXED:
            r = read_row(poses.rotation, 0, 0, lane, ROTATION)
            omega = moved[0, 2, lane]
            lever = subtract(tip, read_row(poses.offset, 0, 0, lane, VECTOR))
            rate = subtract(speed, read_row(moved, 0, 3, lane, VECTOR))
            up, ahead = (0.0, 0.0, 1.0), rotate(r, (1.0, 0.0, 0.0))
            left = rotate(r, (0.0, 1.0, 0.0))
            _write_column(jacobian, 0, lane, ahead, VECTOR)
            _write_column(derivative, 0, lane, scale(left, omega), VECTOR)
            if tree.base == OMNIDIRECTIONAL:
                _write_column(jacobian, 1, lane, left, VECTOR)
                _write_column(derivative, 1, lane, scale(ahead, -omega), VECTOR)
            _write_column(jacobian, rates - 1, lane, cross(up, lever), up)
            _write_column(derivative, rates - 1, lane, cross(up, rate), VECTOR)


@formula
def _write_column(matrix: Any, column: int, lane: int, linear: Vector, angular: Vector) -> None:
    for i in range(3):
        matrix[i, column, lane] = linear[i]
        matrix[3 + i, column, lane] = angular[i]
