# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Task of a tree: poses of frames and positions of joints, or some of their entries.

The *coordinates* of a tree are those of each frame in the task, one frame after the other, then
the positions of all joints. A frame has x, y, z of its origin in m and its rotation vector in rad,
both in the world frame. `outputs.py` determines the indices of the task axes among them. Its
velocities are the origins' in m/s, the angular velocities in rad/s and the joints' rates.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.arrays import array_of, read_part, to_vector, write_part
from masmc_ros.jit.compiled import called_kernel, formula, kernel
from masmc_ros.jit.scratch import clear, scratch
from masmc_ros.jit.tuples import elementwise, from_index
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot.mechanism import Tracking
from masmc_ros.robot.tree.kinematics import (
    add_point_forces,
    joint_position,
    point_velocity,
    Posture,
    to_world,
    write_jacobian,
    write_jacobian_rate,
)
from masmc_ros.robot.tree.spatial import add, product, rotate, ROTATION, Rotation, VECTOR, Vector
from masmc_ros.robot.tree.task.rotation_vector import (
    angular_motion,
    orientation_error,
    orientation_error_rate,
    rotation_of,
    vector_of,
)
from masmc_ros.robot.tree.tree_model import (
    axis_of,
    base_of,
    frame_of,
    frames_of,
    TreeModel,
    velocities_of,
)

POSE = 6
"""Coordinates of a frame."""

_ROTATED = 3
"""Start of its rotation vector among them."""

_ERROR, _ERROR_RATE, _RATE = range(3)
"""Leading entries of a `Tracking`, by rows of all coordinates."""


@formula
def _entry(arguments: tuple[TreeModel, Array, int], i: int) -> float:
    model, values, row = arguments
    return values[row, axis_of(model, i)]


@formula
def _of_task(model: TreeModel, values: Array, row: int) -> Numbers:
    """Return the task axes of a row of all coordinates."""
    entries: Numbers = from_index(_entry, model.axes, (model, values, row))
    return entries


@formula
def _joints(model: TreeModel) -> int:
    """Return the number of controlled joints."""
    return velocities_of(model) - base_of(model)


@formula
def _coordinates(model: TreeModel) -> int:
    """Return the number of coordinates."""
    return POSE * frames_of(model) + _joints(model)


@formula
def _put(model: TreeModel, values: Numbers, row: int, out: Array) -> None:
    """Write the task's axes into a row of all coordinates."""
    entries = array_of(values)
    for i in range(len(model.axes)):
        out[row, axis_of(model, i)] = entries[i]


@kernel
def frame_pose(model: TreeModel, posture: Posture, frame: int) -> tuple[Rotation, Vector]:
    """Return rotation and origin of one of the task's frames in the world's."""
    body, rotation, offset = frame_of(model, frame)
    own = read_part(posture.frames, body, 0, ROTATION)
    world = to_world(posture)
    origin = add(read_part(posture.frames, body, 9, VECTOR), rotate(own, offset))
    return (
        product(world, product(own, rotation)),
        add((posture.x, posture.y, 0.0), rotate(world, origin)),
    )


@kernel
def task_position(model: TreeModel, posture: Posture, position: Numbers) -> Numbers:
    """Return origins and rotation vectors of frames, and positions of joints."""
    coordinates = scratch(1, _coordinates(model))
    for frame in range(frames_of(model)):
        r, p = frame_pose(model, posture, frame)
        write_part(coordinates, 0, POSE * frame, p)
        write_part(coordinates, 0, POSE * frame + _ROTATED, vector_of(r))
    first = POSE * frames_of(model)
    for joint in range(_joints(model)):
        coordinates[0, first + joint] = joint_position(posture, joint)
    return _of_task(model, coordinates, 0)


@kernel
def task_error(
    model: TreeModel, posture: Posture, position: Numbers, desired: Numbers
) -> Numbers:
    """
    Return the distances of origins and joints.

    For the rotation of a frame, it is the axis from R_d to R times the sine of the angle.
    """
    # The desired values, which are then replaced by the errors.
    off = scratch(1, _coordinates(model))
    clear(off)
    _put(model, desired, 0, off)
    for frame in range(frames_of(model)):
        at, turned = POSE * frame, POSE * frame + _ROTATED
        r, p = frame_pose(model, posture, frame)
        aim = rotation_of(read_part(off, 0, turned, VECTOR))
        write_part(off, 0, at, elementwise(minus, p, read_part(off, 0, at, VECTOR)))
        write_part(off, 0, turned, orientation_error(r, aim))
    first = POSE * frames_of(model)
    for joint in range(_joints(model)):
        off[0, first + joint] = joint_position(posture, joint) - off[0, first + joint]
    return _of_task(model, off, 0)


@called_kernel
def task_velocity(model: TreeModel, posture: Posture, motion: Numbers) -> Numbers:
    """Return velocities of origins, angular velocities, and the rates of joints."""
    coordinates, nu = scratch(1, _coordinates(model)), array_of(motion)
    for frame in range(frames_of(model)):
        body, _, offset = frame_of(model, frame)
        v, w = point_velocity(model, posture, nu, body, offset)
        write_part(coordinates, 0, POSE * frame, v)
        write_part(coordinates, 0, POSE * frame + _ROTATED, w)
    first, base = POSE * frames_of(model), base_of(model)
    for joint in range(_joints(model)):
        coordinates[0, first + joint] = nu[base + joint]
    return _of_task(model, coordinates, 0)


@called_kernel
def forces_from_task(
    model: TreeModel, posture: Posture, force: Numbers, template: Numbers
) -> Numbers:
    """Return J' F."""
    pull = scratch(1, _coordinates(model))
    clear(pull)
    _put(model, force, 0, pull)
    base, size = base_of(model), velocities_of(model)
    generalised = scratch(size)
    clear(generalised)
    for k in range(base, size):
        generalised[k] = pull[0, POSE * frames_of(model) + k - base]
    for frame in range(frames_of(model)):
        body, _, offset = frame_of(model, frame)
        at = POSE * frame
        pushed, turned = read_part(pull, 0, at, VECTOR), read_part(pull, 0, at + _ROTATED, VECTOR)
        add_point_forces(model, posture, body, offset, pushed, turned, generalised)
    return to_vector(generalised, template)


@formula
def _take(model: TreeModel, frame: int, own: Array, columns: Array) -> None:
    """Write the task axes of a frame's Jacobian (n, 6) into the Jacobian of the task."""
    for i in range(len(model.axes)):
        axis = axis_of(model, i) - POSE * frame
        if (axis >= 0) & (axis < POSE):
            for k in range(len(own)):
                columns[k, i] = own[k, axis]


@kernel
def write_task_jacobian(model: TreeModel, posture: Posture, columns: Array) -> None:
    """Write the columns (n, m) of J."""
    base, own = base_of(model), scratch(len(columns), POSE)
    clear(columns)
    for frame in range(frames_of(model)):
        body, _, offset = frame_of(model, frame)
        write_jacobian(model, posture, body, offset, own)
        _take(model, frame, own, columns)
    for i in range(len(model.axes)):
        joint = axis_of(model, i) - POSE * frames_of(model)
        if joint >= 0:
            columns[base + joint, i] = 1.0


@kernel
def write_task_jacobian_rate(
    model: TreeModel, posture: Posture, velocity: Array, columns: Array
) -> None:
    """Write the time derivative of J at velocities nu (n)."""
    own = scratch(len(columns), POSE)
    clear(columns)
    for frame in range(frames_of(model)):
        body, _, offset = frame_of(model, frame)
        write_jacobian_rate(model, posture, velocity, body, offset, own)
        _take(model, frame, own, columns)


@called_kernel
def tracking(
    model: TreeModel,
    posture: Posture,
    position: Numbers,
    motion: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tracking:
    """Return the tracking state; desired rotations are rotation vectors and their derivatives."""
    size, nu = _coordinates(model), array_of(motion)
    wanted, state = scratch(3, size), scratch(3, size)
    clear(wanted)
    _put(model, desired[0], 0, wanted)
    _put(model, desired[1], 1, wanted)
    _put(model, desired[2], 2, wanted)
    for frame in range(frames_of(model)):
        body, _, offset = frame_of(model, frame)
        at, turned = POSE * frame, POSE * frame + _ROTATED
        r, p = frame_pose(model, posture, frame)
        v, w = point_velocity(model, posture, nu, body, offset)
        phi = read_part(wanted, 0, turned, VECTOR)
        aim = rotation_of(phi)
        omega, alpha = angular_motion(
            phi, read_part(wanted, 1, turned, VECTOR), read_part(wanted, 2, turned, VECTOR)
        )
        # Angular velocities replace the derivatives of the rotation vector.
        write_part(wanted, 1, turned, omega)
        write_part(wanted, 2, turned, alpha)
        rate = elementwise(minus, v, read_part(wanted, 1, at, VECTOR))
        write_part(state, _ERROR, at, elementwise(minus, p, read_part(wanted, 0, at, VECTOR)))
        write_part(state, _ERROR, turned, orientation_error(r, aim))
        write_part(state, _ERROR_RATE, at, rate)
        write_part(state, _ERROR_RATE, turned, orientation_error_rate(r, w, aim, omega))
        write_part(state, _RATE, at, rate)
        write_part(state, _RATE, turned, elementwise(minus, w, omega))
    base, first = base_of(model), POSE * frames_of(model)
    for joint in range(_joints(model)):
        at = first + joint
        rate_error = nu[base + joint] - wanted[1, at]
        state[_ERROR, at] = joint_position(posture, joint) - wanted[0, at]
        state[_ERROR_RATE, at] = rate_error
        state[_RATE, at] = rate_error
    return Tracking(
        _of_task(model, state, _ERROR),
        _of_task(model, state, _ERROR_RATE),
        _of_task(model, state, _RATE),
        _of_task(model, wanted, 1),
        _of_task(model, wanted, 2),
    )
