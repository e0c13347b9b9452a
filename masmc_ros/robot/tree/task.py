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
The pose of a tree's frame, how it moves, and how it follows what is desired.

The task are x, y, z of the frame's origin in m and its rotation vector in rad, in the world's
frame; its velocities, the origin's in m/s and the angular velocity in rad/s.
"""

from __future__ import annotations

from masmc_ros.numerics.arrays import array_of, read_part, taken
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each
from masmc_ros.robot.mechanism import Numbers, Tracking
from masmc_ros.robot.tree.dynamics import point_forces, point_velocity, Posture, to_world
from masmc_ros.robot.tree.model import tip_of, TreeModel
from masmc_ros.robot.tree.rotation_vector import (
    angular_motion,
    orientation_error,
    orientation_error_rate,
    rotation_of,
    vector_of,
)
from masmc_ros.robot.tree.spatial import (
    add,
    product,
    rotate,
    ROTATION,
    Rotation,
    VECTOR,
    Vector,
)

AXES = 6
"""Of the task."""


@kernel
def tip_pose(model: TreeModel, posture: Posture) -> tuple[Rotation, Vector]:
    """Return rotation and origin of the task's frame in the world's."""
    body, rotation, offset = tip_of(model)
    own = read_part(posture.frames, body, 0, ROTATION)
    world = to_world(posture)
    origin = add(read_part(posture.frames, body, 9, VECTOR), rotate(own, offset))
    return (
        product(world, product(own, rotation)),
        add((posture.x, posture.y, 0.0), rotate(world, origin)),
    )


@formula
def _first(values: Numbers) -> Vector:
    return values[0], values[1], values[2]


@formula
def _last(values: Numbers) -> Vector:
    return values[3], values[4], values[5]


@kernel
def task_position(model: TreeModel, posture: Posture, position: Numbers) -> Numbers:
    """Return the origin and the rotation vector of the frame."""
    r, p = tip_pose(model, posture)
    phi = vector_of(r)
    return p[0], p[1], p[2], phi[0], phi[1], phi[2]


@kernel
def task_error(
    model: TreeModel, posture: Posture, position: Numbers, desired: Numbers
) -> Numbers:
    """Return the origin's distance, and the axis from R_d to R times the angle's sine."""
    r, p = tip_pose(model, posture)
    turned = orientation_error(r, rotation_of(_last(desired)))
    return (
        p[0] - desired[0], p[1] - desired[1], p[2] - desired[2], turned[0], turned[1], turned[2]
    )


@kernel
def task_velocity(model: TreeModel, posture: Posture, motion: Numbers) -> Numbers:
    """Return the origin's velocity and the angular velocity."""
    body, _, offset = tip_of(model)
    v, w = point_velocity(model, posture, array_of(motion), body, offset)
    return v[0], v[1], v[2], w[0], w[1], w[2]


@kernel
def forces_from_task(
    model: TreeModel, posture: Posture, force: Numbers, like: Numbers
) -> Numbers:
    """Return J' F."""
    body, _, offset = tip_of(model)
    found = point_forces(model, posture, body, offset, _first(force), _last(force))
    return taken(found, like)


@kernel
def tracking(
    model: TreeModel,
    posture: Posture,
    position: Numbers,
    motion: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tracking:
    """Return how the frame follows; what is desired is a rotation vector and its derivatives."""
    r, p = tip_pose(model, posture)
    phi = _last(desired[0])
    wanted = rotation_of(phi)
    omega_d, alpha_d = angular_motion(phi, _last(desired[1]), _last(desired[2]))
    twist = task_velocity(model, posture, motion)
    turned = orientation_error(r, wanted)
    turning = orientation_error_rate(r, _last(twist), wanted, omega_d)
    x, v, a = desired
    velocity = (v[0], v[1], v[2], omega_d[0], omega_d[1], omega_d[2])
    rate = each(minus, twist, velocity)
    return Tracking(
        (p[0] - x[0], p[1] - x[1], p[2] - x[2], turned[0], turned[1], turned[2]),
        (rate[0], rate[1], rate[2], turning[0], turning[1], turning[2]),
        rate,
        velocity,
        (a[0], a[1], a[2], alpha_d[0], alpha_d[1], alpha_d[2]),
    )
