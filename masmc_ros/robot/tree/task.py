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
frame, or some of these; its velocities, the origin's in m/s and the angular velocity in rad/s.
"""

from __future__ import annotations

from masmc_ros.numerics.arrays import array_of, read_part, taken
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each, tabulate
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

_ALL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""As long as a pose."""


@formula
def _entry(of: tuple[TreeModel, Numbers], i: int) -> float:
    model, values = of
    return values[int(model.axes[i])]


@formula
def _of_task(model: TreeModel, values: Numbers) -> Numbers:
    """Return of six numbers those that belong to the task's axes."""
    found: Numbers = tabulate(_entry, model.axes, (model, values))
    return found


@formula
def _entry_of_pose(of: tuple[TreeModel, Numbers], axis: int) -> float:
    model, values = of
    found = 0.0
    for i in range(len(values)):
        found = values[i] if int(model.axes[i]) == axis else found
    return found


@formula
def _of_pose(model: TreeModel, values: Numbers) -> Numbers:
    """Return six numbers of those of the task's axes: nothing of what is no task."""
    found: Numbers = tabulate(_entry_of_pose, _ALL, (model, values))
    return found


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
    return _of_task(model, (p[0], p[1], p[2], phi[0], phi[1], phi[2]))


@kernel
def task_error(
    model: TreeModel, posture: Posture, position: Numbers, desired: Numbers
) -> Numbers:
    """Return the origin's distance, and the axis from R_d to R times the angle's sine."""
    r, p = tip_pose(model, posture)
    x = _of_pose(model, desired)
    turned = orientation_error(r, rotation_of(_last(x)))
    return _of_task(
        model, (p[0] - x[0], p[1] - x[1], p[2] - x[2], turned[0], turned[1], turned[2])
    )


@kernel
def _twist(model: TreeModel, posture: Posture, motion: Numbers) -> tuple[Vector, Vector]:
    """Return the origin's velocity and the angular velocity."""
    body, _, offset = tip_of(model)
    return point_velocity(model, posture, array_of(motion), body, offset)


@kernel
def task_velocity(model: TreeModel, posture: Posture, motion: Numbers) -> Numbers:
    """Return the origin's velocity and the angular velocity."""
    v, w = _twist(model, posture, motion)
    return _of_task(model, (v[0], v[1], v[2], w[0], w[1], w[2]))


@kernel
def forces_from_task(
    model: TreeModel, posture: Posture, force: Numbers, like: Numbers
) -> Numbers:
    """Return J' F."""
    body, _, offset = tip_of(model)
    pull = _of_pose(model, force)
    found = point_forces(model, posture, body, offset, _first(pull), _last(pull))
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
    x = _of_pose(model, desired[0])
    v, a = _of_pose(model, desired[1]), _of_pose(model, desired[2])
    phi = _last(x)
    wanted = rotation_of(phi)
    omega_d, alpha_d = angular_motion(phi, _last(v), _last(a))
    moving, around = _twist(model, posture, motion)
    turned = orientation_error(r, wanted)
    turning = orientation_error_rate(r, around, wanted, omega_d)
    velocity = (v[0], v[1], v[2], omega_d[0], omega_d[1], omega_d[2])
    twist = (moving[0], moving[1], moving[2], around[0], around[1], around[2])
    rate = each(minus, twist, velocity)
    return Tracking(
        _of_task(
            model, (p[0] - x[0], p[1] - x[1], p[2] - x[2], turned[0], turned[1], turned[2])
        ),
        _of_task(model, (rate[0], rate[1], rate[2], turning[0], turning[1], turning[2])),
        _of_task(model, rate),
        _of_task(model, velocity),
        _of_task(model, (a[0], a[1], a[2], alpha_d[0], alpha_d[1], alpha_d[2])),
    )
