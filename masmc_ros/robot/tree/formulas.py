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
The contract of mechanisms for a tree of bodies, its task the pose of a frame.

Positions are x, y and yaw of the base in the world (where it stands, if it is fixed), then the
positions of the wheels, and of the joints in the tree's order. Velocities are nu of `dynamics`.
The task are x, y, z of the frame's origin in m and its rotation vector in rad, in the world's
frame; its velocities, the origin's in m/s and the angular velocity in rad/s.

A robot has more velocities than the task, and chooses those that cost least: with what else it
would like to do, z, and mobilities W^-1,

    nu_r = z + W^-1 J' y,   (J W^-1 J' + lambda^2) y = xdot_r - J z,

lambda being 0 where the task is not singular. a_r is the exact derivative for a constant lambda,
less kappa sigma: H kappa sigma damps what the task does not see with the robot's own inertia,
which is stable for any kappa, where gains that know no inertia are not.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.numerics.arrays import read_row, taken, write_row
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.numerics.record import get
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import each, tabulate
from masmc_ros.robot.gradient_step import gradient_step
from masmc_ros.robot.mechanism import Numbers, Tracking
from masmc_ros.robot.tree import dynamics
from masmc_ros.robot.tree.dynamics import FIXED, GRAVITY, place, Placement, point_jacobian
from masmc_ros.robot.tree.model import ONE, TreeModel, unpacked
from masmc_ros.robot.tree.natural_adaptation import bounded, natural_step
from masmc_ros.robot.tree.rotation_vector import (
    angular_motion,
    orientation_error,
    orientation_error_rate,
    rotation_of,
    vector_of,
)
from masmc_ros.robot.tree.spatial import (
    add,
    MOMENTS,
    product,
    rotate,
    ROTATION,
    Rotation,
    turn,
    Vector,
)
import numpy as np

MODEL = TreeModel

POSE = 3
"""Coordinates of the base."""

AXES = 6
"""Of the task."""

ADAPTATIONS = ('natural', 'gradient')
NATURAL = 0
"""Places of what `adaptation` chooses among."""

class Regressor(NamedTuple):
    """Y(q, v, v_r, a_r), which is never formed."""

    placement: Placement
    motion: Numbers
    reference: Numbers
    acceleration: Numbers


@formula
def model_of(record: Any, lane: int) -> TreeModel:
    """Return what a record holds."""
    found: TreeModel = unpacked(record['geometry'], lane)
    return found


@kernel
def _vector(values: Numbers) -> Any:
    """Return a tuple as an array (n, 1)."""
    out = np.empty((len(values), 1))
    for i in range(len(values)):
        out[i, 0] = values[i]
    return out


@kernel
def _placed(model: TreeModel, x: float, y: float, yaw: float, position: Any, first: int) -> Any:
    """Return where the bodies are; the joints' positions begin at `first`."""
    tree = model.tree
    bodies = len(tree.parent)
    shift = 0 if tree.base == FIXED else POSE
    joints = np.empty((shift + bodies - 1, 1))
    if shift:
        joints[0, 0], joints[1, 0], joints[2, 0] = x, y, yaw
    for i in range(bodies - 1):
        joints[shift + i, 0] = position[first + tree.base + i]
    placement = Placement(np.empty((bodies, 9, 1)), np.empty((bodies, 3, 1)))
    place(tree, joints, placement)
    if tree.base == FIXED:
        s, c = sin_cos(yaw)
        write_row(placement.rotation, 0, 0, 0, turn((0.0, 0.0, 1.0), s, c))
        write_row(placement.offset, 0, 0, 0, (x, y, 0.0))
    return placement


@formula
def posture(model: TreeModel, position: Numbers) -> Placement:
    """Return where the bodies are in their parents' frames."""
    found: Placement = _placed(model, position[0], position[1], position[2], position, POSE)
    return found


@formula
def posture_of_joints(model: TreeModel, angles: Numbers) -> Placement:
    """Return the same with the base at the origin."""
    found: Placement = _placed(model, 0.0, 0.0, 0.0, angles, 0)
    return found


@formula
def _mapped(of: tuple[Any, bool, Numbers], i: int) -> float:
    """Return an entry of a vector of which a matrix or its transpose maps the base's part."""
    matrix, transposed, values = of
    size = len(matrix)
    if i >= size:
        return values[i]
    total = 0.0
    for j in range(size):
        total += (matrix[j, i] if transposed else matrix[i, j]) * values[j]
    return total


@formula
def motion(model: TreeModel, rates: Numbers) -> Numbers:
    """Return nu from the rates of wheels and joints."""
    return tabulate(_mapped, rates, (model.base_rates, False, rates))


@formula
def joint_rates(model: TreeModel, motion: Numbers) -> Numbers:
    """Return the rates of wheels and joints."""
    return tabulate(_mapped, motion, (model.wheel_rates, False, motion))


@formula
def joint_torques(model: TreeModel, forces: Numbers) -> Numbers:
    """Return the torques of wheels and joints."""
    return tabulate(_mapped, forces, (model.base_rates, True, forces))


@formula
def forces(model: TreeModel, torques: Numbers) -> Numbers:
    """Return the forces conjugate to nu."""
    return tabulate(_mapped, torques, (model.wheel_rates, True, torques))


@formula
def _position_rate(of: tuple[TreeModel, Placement, Numbers], i: int) -> float:
    """Return the rate of a position."""
    model, placement, rates = of
    base = model.tree.base
    if i >= POSE:
        return rates[i - POSE]
    if base == FIXED:
        return 0.0
    nu = tabulate(_mapped, rates, (model.base_rates, False, rates))
    across = 0.0 if base < POSE else nu[1]
    if i == POSE - 1:
        return nu[base - 1]
    return placement.rotation[0, 3 * i, 0] * nu[0] + placement.rotation[0, 3 * i + 1, 0] * across


@formula
def position_rates(model: TreeModel, posture: Placement, rates: Numbers) -> Numbers:
    """Return the derivative of the positions."""
    return tabulate(_position_rate, (0.0, 0.0, 0.0, *rates), (model, posture, rates))


@kernel
def _tip(model: TreeModel, placement: Placement) -> tuple[Rotation, Vector]:
    """Return rotation and origin of the task's frame in the world's."""
    tree = model.tree
    r = taken(model.tip_rotation, ROTATION)
    p = taken(model.tip_offset, (0.0, 0.0, 0.0))
    body = model.tip
    while True:
        own = read_row(placement.rotation, body, 0, 0, ROTATION)
        p = add(read_row(placement.offset, body, 0, 0, (0.0, 0.0, 0.0)), rotate(own, p))
        r = product(own, r)
        if body == 0:
            return r, p
        body = tree.parent[body]


@kernel
def _jacobian(model: TreeModel, placement: Placement, motion: Any) -> Any:
    """Return J (6, n, 1) and its derivative for velocities (n, 1)."""
    tree = model.tree
    bodies, size = len(tree.parent), len(motion)
    poses = Placement(np.empty((bodies, 9, 1)), np.empty((bodies, 3, 1)))
    dynamics.world_poses(tree, placement, poses)
    jacobian, derivative = np.empty((AXES, size, 1)), np.empty((AXES, size, 1))
    point = np.empty((3, 1))
    for i in range(3):
        point[i, 0] = model.tip_offset[i]
    point_jacobian(tree, poses, motion, model.tip, point, jacobian, derivative)
    return jacobian, derivative


@formula
def _first(values: Numbers) -> Vector:
    return values[0], values[1], values[2]


@formula
def _last(values: Numbers) -> Vector:
    return values[3], values[4], values[5]


@kernel
def task_position(model: TreeModel, posture: Placement, position: Numbers) -> Numbers:
    """Return the origin and the rotation vector of the frame."""
    r, p = _tip(model, posture)
    phi = vector_of(r)
    return p[0], p[1], p[2], phi[0], phi[1], phi[2]


@kernel
def task_error(
    model: TreeModel, posture: Placement, position: Numbers, desired: Numbers
) -> Numbers:
    """Return the origin's distance, and the axis from R_d to R times the angle's sine."""
    r, p = _tip(model, posture)
    turned = orientation_error(r, rotation_of(_last(desired)))
    return (
        p[0] - desired[0], p[1] - desired[1], p[2] - desired[2], turned[0], turned[1], turned[2]
    )


@kernel
def _times(matrix: Any, x: Any) -> Numbers:
    """Return a matrix (6, n, 1) times a vector (n), which may be a tuple."""
    total = np.zeros(AXES)
    for i in range(AXES):
        for j in range(len(x)):
            total[i] += matrix[i, j, 0] * x[j]
    return total[0], total[1], total[2], total[3], total[4], total[5]


@kernel
def task_velocity(model: TreeModel, posture: Placement, motion: Numbers) -> Numbers:
    """Return the origin's velocity and the angular velocity."""
    jacobian, _ = _jacobian(model, posture, _vector(motion))
    found: Numbers = _times(jacobian, motion)
    return found


@kernel
def tracking(
    model: TreeModel,
    posture: Placement,
    position: Numbers,
    motion: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tracking:
    """Return how the frame follows; what is desired is a rotation vector and its derivatives."""
    r, p = _tip(model, posture)
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


@kernel
def _compliance(model: TreeModel, left: Any, right: Any) -> Any:
    """Return left W^-1 right' (6, 6, 1)."""
    out = np.zeros((AXES, AXES, 1))
    for i in range(AXES):
        for j in range(AXES):
            for k in range(left.shape[1]):
                out[i, j, 0] += left[i, k, 0] * model.mobility[k] * right[j, k, 0]
    return out


@kernel
def _factored(model: TreeModel, jacobian: Any) -> tuple[Any, bool]:
    """Return the factors of J W^-1 J' + lambda^2, and whether the task is singular."""
    matrix = _compliance(model, jacobian, jacobian)
    found = matrix.copy()
    dynamics.factor(found, ONE)
    least = found[0, 0, 0]
    for i in range(AXES):
        least = min(least, found[i, i, 0])
    is_singular = not least > model.least_pivot
    if is_singular:
        # lambda^2 grows from zero to the pivot's bound as the pivot goes to zero.
        short = 1.0 - max(least, 0.0) / model.least_pivot
        for i in range(AXES):
            matrix[i, i, 0] += model.least_pivot * short * short
        dynamics.factor(matrix, ONE)
        found = matrix
    return found, is_singular


@kernel
def is_singular(model: TreeModel, posture: Placement) -> bool:
    """Tell whether the least pivot of J W^-1 J' is too small."""
    jacobian, _ = _jacobian(model, posture, np.zeros((len(model.mobility), 1)))
    _, found = _factored(model, jacobian)
    return found


@kernel
def reference_motion(
    model: TreeModel,
    posture: Placement,
    position: Numbers,
    motion: Numbers,
    velocity: Numbers,
    acceleration: Numbers,
) -> tuple[Numbers, Numbers]:
    """Return nu_r and a_r - kappa (nu - nu_r)."""
    size, base, gain = len(motion), model.tree.base, model.posture_gain
    nu = _vector(motion)
    jacobian, derivative = _jacobian(model, posture, nu)
    factors, _ = _factored(model, jacobian)
    # z and its derivative: the joints tend to their posture, the base to nothing.
    z, z_dot = np.zeros(size), np.zeros(size)
    for k in range(base, size):
        z[k] = -gain * (position[POSE + k] - model.posture[k])
        z_dot[k] = -gain * nu[k, 0]
    y, y_dot = np.empty((AXES, 1)), np.empty((AXES, 1))
    for i in range(AXES):
        y[i, 0] = velocity[i]
        for k in range(size):
            y[i, 0] -= jacobian[i, k, 0] * z[k]
    dynamics.solve(factors, y, ONE)
    # The derivative of the equation for y: A ydot = d(xdot_r - J z)/dt - Adot y.
    one, other = _compliance(model, derivative, jacobian), _compliance(model, jacobian, derivative)
    for i in range(AXES):
        y_dot[i, 0] = acceleration[i]
        for k in range(size):
            y_dot[i, 0] -= derivative[i, k, 0] * z[k] + jacobian[i, k, 0] * z_dot[k]
        for j in range(AXES):
            y_dot[i, 0] -= (one[i, j, 0] + other[i, j, 0]) * y[j, 0]
    dynamics.solve(factors, y_dot, ONE)
    v_r, a_r = np.empty(size), np.empty(size)
    for k in range(size):
        along, change = 0.0, 0.0
        for i in range(AXES):
            along += jacobian[i, k, 0] * y[i, 0]
            change += derivative[i, k, 0] * y[i, 0] + jacobian[i, k, 0] * y_dot[i, 0]
        v_r[k] = z[k] + model.mobility[k] * along
        a_r[k] = z_dot[k] + model.mobility[k] * change - model.damping * (nu[k, 0] - v_r[k])
    return taken(v_r, motion), taken(a_r, motion)


@formula
def motion_error(
    model: TreeModel, posture: Placement, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return nu - nu_r."""
    return each(minus, motion, reference)


@kernel
def _task_inertia(model: TreeModel, placement: Placement, theta: Numbers) -> Any:
    """Return (J H^-1 J')^-1 (6, 6), a little damped where that is singular."""
    size = len(model.mobility)
    jacobian, _ = _jacobian(model, placement, np.zeros((size, 1)))
    h = inertia(model, placement, theta)
    dynamics.factor(h, ONE)
    compliance = np.zeros((AXES, AXES, 1))
    column = np.empty((size, 1))
    for j in range(AXES):
        for k in range(size):
            column[k, 0] = jacobian[j, k, 0]
        dynamics.solve(h, column, ONE)
        for i in range(AXES):
            for k in range(size):
                compliance[i, j, 0] += jacobian[i, k, 0] * column[k, 0]
    least = model.least_pivot * compliance[0, 0, 0]
    for i in range(AXES):
        compliance[i, i, 0] += 1.0e-3 * least
    dynamics.factor(compliance, ONE)
    out = np.empty((AXES, AXES))
    column = np.empty((AXES, 1))
    for j in range(AXES):
        column[:] = 0.0
        column[j, 0] = 1.0
        dynamics.solve(compliance, column, ONE)
        for i in range(AXES):
            out[i, j] = column[i, 0]
    return out


@formula
def _entry_of(of: tuple[Any, int], i: int) -> float:
    return of[0][i, of[1]]


@formula
def _column_of(of: tuple[Any, Numbers], j: int) -> Numbers:
    return tabulate(_entry_of, of[1], (of[0], j))


@formula
def task_inertia(model: TreeModel, posture: Placement, theta: Numbers, surface: Numbers) -> Any:
    """Return (J H^-1 J')^-1 by its columns, kg, kg m and kg m^2."""
    return tabulate(_column_of, surface, (_task_inertia(model, posture, theta), surface))


@kernel
def motion_from_task(
    model: TreeModel, posture: Placement, rates: Numbers, like: Numbers
) -> Numbers:
    """Return W^-1 J' (J W^-1 J' + lambda^2)^-1 xdot."""
    size = len(model.mobility)
    jacobian, _ = _jacobian(model, posture, np.zeros((size, 1)))
    factors, _ = _factored(model, jacobian)
    y = _vector(rates)
    dynamics.solve(factors, y, ONE)
    out = np.zeros(size)
    for k in range(size):
        for i in range(AXES):
            out[k] += model.mobility[k] * jacobian[i, k, 0] * y[i, 0]
    return taken(out, like)


@kernel
def forces_from_task(
    model: TreeModel, posture: Placement, force: Numbers, like: Numbers
) -> Numbers:
    """Return J' F."""
    size = len(model.mobility)
    jacobian, _ = _jacobian(model, posture, np.zeros((size, 1)))
    out = np.zeros(size)
    for k in range(size):
        for i in range(AXES):
            out[k] += jacobian[i, k, 0] * force[i]
    return taken(out, like)


@kernel
def _moments(theta: Numbers) -> Any:
    """Return moments (B, 10, 1) of all bodies."""
    out = np.empty((len(theta) // 10, 10, 1))
    for i in range(len(theta)):
        out[i // 10, i % 10, 0] = theta[i]
    return out


@formula
def regressor(
    model: TreeModel,
    posture: Placement,
    motion: Numbers,
    reference: Numbers,
    acceleration: Numbers,
) -> Regressor:
    """Return what Y is made of."""
    return Regressor(posture, motion, reference, acceleration)


@kernel
def regressor_times(model: TreeModel, y: Regressor, theta: Numbers) -> Numbers:
    """Return H a_r + C nu_r + g, with the inertia of rotors and wheels, which is no parameter."""
    acceleration = _vector(y.acceleration)
    out = np.empty((len(y.motion), 1))
    dynamics.inverse_dynamics(
        model.tree,
        _moments(theta),
        y.placement,
        _vector(y.motion),
        _vector(y.reference),
        acceleration,
        GRAVITY,
        out,
    )
    return taken(out[:, 0], y.motion)


@kernel
def _gradients(model: TreeModel, y: Regressor, motion: Numbers) -> Any:
    tree = model.tree
    out = np.empty((len(tree.parent), 10, 1))
    dynamics.moment_gradients(
        tree,
        y.placement,
        _vector(y.motion),
        _vector(y.reference),
        _vector(y.acceleration),
        GRAVITY,
        _vector(motion),
        out,
    )
    return out.reshape(out.size)


@formula
def regressor_transpose_times(
    model: TreeModel, y: Regressor, motion: Numbers, like: Numbers
) -> Numbers:
    """Return Y' v."""
    return taken(_gradients(model, y, motion), like)


@formula
def theta_step(
    model: TreeModel, settings: Any, lane: int, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """
    Return the moments after a step of natural adaptation, or of each number for itself.

    The gain of a body is the entry of `gamma` for its mass; with projection, neither mass nor
    size of a body grows beyond `projection.upper` times the nominal one.
    """
    gamma = get(settings, 'gamma', lane)
    if get(settings, 'adaptation', lane) != NATURAL:
        return each(gradient_step, theta, gradient, gamma, period)
    is_free = get(settings, 'projection_lower', lane) == 0.0
    upper = 1.0e300 if is_free else get(settings, 'projection_upper', lane)
    nominal = get(settings, 'nominal', lane)
    found: Numbers = _natural(theta, nominal, gradient, gamma, period, upper)
    return found


@formula
def keeps_bodies(model: TreeModel, settings: Any, lane: int) -> bool:
    """Tell whether adaptation is natural."""
    return get(settings, 'adaptation', lane) == NATURAL


@kernel
def _natural(
    theta: Numbers,
    nominal: Numbers,
    gradient: Numbers,
    gamma: Numbers,
    period: float,
    upper: float,
) -> Numbers:
    out = np.empty(len(theta))
    moments, along, rest = _moments(theta), _moments(gradient), _moments(nominal)
    for body in range(len(theta) // 10):
        moved = natural_step(
            read_row(moments, body, 0, 0, MOMENTS),
            read_row(along, body, 0, 0, MOMENTS),
            period / gamma[10 * body],
        )
        kept = bounded(moved, read_row(rest, body, 0, 0, MOMENTS), upper)
        for i in range(10):
            out[10 * body + i] = kept[i]
    return taken(out, theta)


@kernel
def inertia(model: TreeModel, posture: Placement, theta: Numbers) -> Any:
    """Return H (n, n, 1)."""
    size = len(model.mobility)
    out = np.empty((size, size, 1))
    dynamics.inertia(model.tree, _moments(theta), posture, out)
    return out


@kernel
def inertia_times(model: TreeModel, inertia: Any, acceleration: Numbers) -> Numbers:
    """Return H nudot."""
    out = np.zeros(len(acceleration))
    for i in range(len(acceleration)):
        for j in range(len(acceleration)):
            out[i] += inertia[i, j, 0] * acceleration[j]
    return taken(out, acceleration)


@kernel
def inertia_solve(model: TreeModel, inertia: Any, forces: Numbers) -> Numbers:
    """Return H^-1 f."""
    factors = inertia.copy()
    dynamics.factor(factors, ONE)
    x = _vector(forces)
    dynamics.solve(factors, x, ONE)
    return taken(x[:, 0], forces)


@kernel
def coriolis(
    model: TreeModel, posture: Placement, theta: Numbers, motion: Numbers
) -> Numbers:
    """Return C nu + g."""
    nu = _vector(motion)
    out = np.empty((len(motion), 1))
    dynamics.inverse_dynamics(
        model.tree, _moments(theta), posture, nu, nu, np.zeros((len(motion), 1)), GRAVITY, out
    )
    return taken(out[:, 0], motion)


@formula
def _pseudo(theta: Any, at: int, i: int, j: int) -> float:
    """Return an entry of a body's pseudo-inertia, whose moments begin at `at`."""
    if i == 3 and j == 3:
        return theta[at]
    if i == 3 or j == 3:
        return theta[at + 1 + min(i, j)]
    if i == j:
        return theta[at + 4 + i]
    # xy, yz, zx
    return theta[at + 7 + (0 if i + j == 1 else (1 if i + j == 3 else 2))]


@kernel
def _weakest(theta: Numbers) -> tuple[float, Numbers]:
    """Return the least pivot of the bodies' pseudo-inertias: see `weakest_motion`."""
    pivot, found = 1.0, (0.0, 0.0, 0.0, 0.0, 0.0)
    lower, x = np.zeros((4, 4)), np.zeros(4)
    for body in range(len(theta) // 10):
        at = 10 * body
        total = 0.0
        for i in range(10):
            total += abs(theta[at + i])
        if total == 0.0:
            continue
        # From the mass on: rows and columns 3, 0, 1, 2.
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
            found = (0.0, 0.0, 0.0, 1.0, float(body))
    return pivot, found


@formula
def weakest_motion(model: TreeModel, theta: Numbers) -> tuple[float, Numbers]:
    """Return the first pivot that is not positive, x of that body's pseudo-inertia, the body."""
    found: tuple[float, Numbers] = _weakest(theta)
    return found


@formula
def _normal(x: Numbers, i: int) -> float:
    """Return the derivative of x' P x by a moment."""
    if i // 10 != int(x[4]):
        return 0.0
    k = i % 10
    if k == 0:
        return x[3] * x[3]
    if k < 4:
        return 2.0 * x[k - 1] * x[3]
    if k < 7:
        return x[k - 4] * x[k - 4]
    return 2.0 * x[k - 7] * x[(k - 6) % 3]


@formula
def consistency_normal(model: TreeModel, x: Numbers, like: Numbers) -> Numbers:
    """Return the vector n with n' theta = x' P x."""
    return tabulate(_normal, like, x)


@formula
def rate_command(model: TreeModel, motion: Numbers) -> Numbers:
    """Return nu."""
    return motion


@formula
def commanded_joint_rates(model: TreeModel, command: Numbers) -> Numbers:
    """Return the rates of wheels and joints."""
    return joint_rates(model, command)


@formula
def dead_reckoned(model: TreeModel, pose: Numbers, turned: Numbers) -> Numbers:
    """Return the base's pose after wheels have turned, exact for the mean of both headings."""
    base = model.tree.base
    if base == FIXED:
        return pose
    moved = motion(model, turned)
    turn_by = moved[base - 1]
    across = 0.0 if base < POSE else moved[1]
    s, c = sin_cos(pose[2] + 0.5 * turn_by)
    return (
        pose[0] + moved[0] * c - across * s, pose[1] + moved[0] * s + across * c, pose[2] + turn_by
    )


@formula
def counts_turns(model: TreeModel, resolution: Numbers) -> bool:
    """Tell whether the wheels' encoders have a finite resolution."""
    found = False
    for i in range(model.tree.base):
        found = found or resolution[i] > 0.0
    return found
