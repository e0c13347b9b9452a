# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Motion and forces of a robot that has more velocities than its task.

The velocities minimise a weighted norm, with secondary velocities z and mobilities W^-1, which go
to zero in a margin before a joint's ends,

    nu_r = z + W^-1 J' y,   (J W^-1 J' + lambda^2) y = xdot_r - J z,

where lambda is 0 unless the task is singular. If a joint would exceed its speed limit, nu_r is
divided by a common factor rho. a_r is the exact derivative for a constant lambda, minus kappa
sigma: H kappa sigma damps the null space with the inertia of the robot, which is stable for any
kappa, unlike gains without inertia.

lambda^2 = b (1 - p / b)^2 grows from zero as the smallest pivot p of J W^-1 J' falls below b, the
larger of `least_pivot` and (DAMPED_TIME xdot_r)^2. If any joint has a speed limit, the task is
therefore damped before a joint speed of about 1 / DAMPED_TIME, in rad/s or m/s.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Columns, Numbers
from masmc_ros.jit.arrays import array_of, changeable, to_vector
from masmc_ros.jit.compiled import called_kernel, formula, kernel
from masmc_ros.jit.scratch import clear, copy_into, lasting, scratch
from masmc_ros.jit.tuples import from_index
from masmc_ros.numerics.elimination import factor, solve
from masmc_ros.robot.tree.dynamics import write_inertia
from masmc_ros.robot.tree.kinematics import joint_position, Posture
from masmc_ros.robot.tree.task.task import write_task_jacobian, write_task_jacobian_rate
from masmc_ros.robot.tree.tree_model import (
    base_of,
    damped_time_of,
    damping_of,
    inverse_speeds_begin,
    least_pivot_of,
    limits_of,
    mobility_begins,
    posture_gain_of,
    rest_of,
    TreeModel,
    velocities_of,
)
from masmc_ros.robot.tree.wheels import into_wheels


@formula
def _mobility(model: TreeModel, posture: Posture, k: int, rate: float) -> tuple[float, float]:
    """Return the mobility of a velocity, and its derivative at a rate of the joint."""
    mobility = model.numbers[mobility_begins(model) + k]
    lower, upper, margin = limits_of(model, k)
    if margin == 0.0:
        return mobility, 0.0
    position = joint_position(posture, k - base_of(model))
    below, above = position - lower, upper - position
    d = min(below, above) / margin
    if d >= 1.0:
        return mobility, 0.0
    if d <= 0.0:
        return 0.0, 0.0
    slope = 6.0 * d * (1.0 - d) / margin
    toward = rate if below < above else -rate
    return mobility * (d * d * (3.0 - 2.0 * d)), mobility * (slope * toward)


@kernel
def _write_mobilities(
    model: TreeModel, posture: Posture, rates: Array, weights: Array, growths: Array
) -> None:
    """Write W^-1 and its derivative at rates nu, both (n)."""
    for k in range(len(weights)):
        weights[k], growths[k] = _mobility(model, posture, k, rates[k])


@kernel
def _factored(
    model: TreeModel, columns: Array, weights: Array, square: float, factorised: Array
) -> bool:
    """
    Write the factors of J W^-1 J' + lambda^2, and return True if the task is singular.

    `square` is the squared task velocity.
    """
    m, bound = len(model.axes), least_pivot_of(model)
    _write_compliance(model, columns, weights, factorised)
    factor(factorised)
    least = factorised[0, 0]
    for i in range(m):
        least = min(least, factorised[i, i])
    is_singular = not least > bound
    time = damped_time_of(model)
    bound = max(bound, time * time * square)
    if not least > bound:
        short = 1.0 - max(least, 0.0) / bound
        damping = bound * short * short
        _write_compliance(model, columns, weights, factorised)
        for i in range(m):
            factorised[i, i] += damping
        factor(factorised)
    return is_singular


@formula
def _write_compliance(model: TreeModel, columns: Array, weights: Array, compliance: Array) -> None:
    """Write J W^-1 J'."""
    m = len(model.axes)
    clear(compliance)
    for k in range(len(columns)):
        for i in range(m):
            part = weights[k] * columns[k, i]
            for j in range(m):
                compliance[i, j] += part * columns[k, j]


@formula
def _along(model: TreeModel, columns: Array, k: int, y: Array) -> float:
    """Return entry k of J' y."""
    total = 0.0
    for i in range(len(model.axes)):
        total += columns[k, i] * y[i]
    return total


@kernel
def _limit_speeds(model: TreeModel, v_r: Array, a_r: Array) -> None:
    """Divide nu_r by the excess over the speed limit of the fastest joint, and derive a_r."""
    size, first = len(v_r), inverse_speeds_begin(model)
    speeds = scratch(size)
    copy_into(speeds, v_r)
    into_wheels(model, speeds, False)
    excess, fastest = 1.0, 0
    for k in range(size):
        ratio = abs(speeds[k]) * model.numbers[first + k]
        if ratio > excess:
            excess, fastest = ratio, k
    if excess > 1.0:
        sign = 1.0 if speeds[fastest] > 0.0 else -1.0
        copy_into(speeds, a_r)
        into_wheels(model, speeds, False)
        change = sign * speeds[fastest] * model.numbers[first + fastest] / excess
        for k in range(size):
            a_r[k] = (a_r[k] - change * v_r[k]) / excess
            v_r[k] /= excess


@called_kernel
def reference_motion(
    model: TreeModel,
    posture: Posture,
    position: Numbers,
    motion: Numbers,
    velocity: Numbers,
    acceleration: Numbers,
) -> tuple[Numbers, Numbers, bool]:
    """Return nu_r, a_r - kappa (nu - nu_r), and True if the task is close to singular."""
    base, gain, damping = base_of(model), posture_gain_of(model), damping_of(model)
    nu, at = array_of(motion), array_of(position)
    y, y_dot = changeable(velocity), changeable(acceleration)
    size, pose, m = len(nu), len(at) - len(nu), len(model.axes)
    columns, changes, factors = scratch(size, m), scratch(size, m), scratch(m, m)
    weights, growths = scratch(size), scratch(size)
    write_task_jacobian(model, posture, columns)
    write_task_jacobian_rate(model, posture, nu, changes)
    _write_mobilities(model, posture, nu, weights, growths)
    # z and its derivative: joints move to their preferred positions, the base does not.
    z, z_dot = scratch(size), scratch(size)
    clear(z)
    clear(z_dot)
    for k in range(base, size):
        z[k] = -gain * (at[pose + k] - rest_of(model, k))
        z_dot[k] = -gain * nu[k]
    v_r, a_r = scratch(size), scratch(size)
    for k in range(size):
        for i in range(len(model.axes)):
            y[i] -= columns[k, i] * z[k]
    square = 0.0
    for i in range(m):
        square += y[i] * y[i]
    singular = _factored(model, columns, weights, square, factors)
    solve(factors, y)
    # The derivative of the equation for y: A ydot = d(xdot_r - J z)/dt - Adot y.
    for k in range(size):
        along = _along(model, columns, k, y)
        v_r[k] = z[k] + weights[k] * along
        change = z_dot[k] + weights[k] * _along(model, changes, k, y) + growths[k] * along
        a_r[k] = change
        for i in range(len(model.axes)):
            y_dot[i] -= changes[k, i] * v_r[k] + columns[k, i] * change
    solve(factors, y_dot)
    for k in range(size):
        a_r[k] += weights[k] * _along(model, columns, k, y_dot)
    _limit_speeds(model, v_r, a_r)
    for k in range(size):
        a_r[k] -= damping * (nu[k] - v_r[k])
    return to_vector(v_r, motion), to_vector(a_r, motion), singular


@called_kernel
def motion_from_task(
    model: TreeModel, posture: Posture, rates: Numbers, template: Numbers
) -> Numbers:
    """Return W^-1 J' (J W^-1 J' + lambda^2)^-1 xdot."""
    size, m = velocities_of(model), len(model.axes)
    columns, weights, factors = scratch(size, m), scratch(size), scratch(m, m)
    y, still, growths = changeable(rates), scratch(size), scratch(size)
    clear(still)
    write_task_jacobian(model, posture, columns)
    _write_mobilities(model, posture, still, weights, growths)
    _factored(model, columns, weights, 0.0, factors)
    solve(factors, y)
    out = scratch(size)
    for k in range(size):
        out[k] = weights[k] * _along(model, columns, k, y)
    return to_vector(out, template)


@called_kernel
def _task_inertia(model: TreeModel, posture: Posture, theta: Numbers) -> Array:
    """Return (J H^-1 J')^-1 (m, m), slightly damped if it is singular."""
    m, size = len(model.axes), velocities_of(model)
    columns, h = scratch(size, m), scratch(size, size)
    write_task_jacobian(model, posture, columns)
    write_inertia(model, posture, array_of(theta), h)
    factor(h)
    # L^-1 J', in place of J', D^-1, and J H^-1 J' of both.
    inverses, compliance, out = scratch(size), scratch(m, m), lasting(theta, m, m)
    clear(out)
    for k in range(size):
        for row in range(k):
            part = h[k, row]
            for i in range(m):
                columns[k, i] -= part * columns[row, i]
        inverses[k] = 1.0 / h[k, k]
    _write_compliance(model, columns, inverses, compliance)
    least = least_pivot_of(model) * compliance[0, 0]
    for i in range(m):
        compliance[i, i] += 1.0e-3 * least
    factor(compliance)
    # Rows of L^-T, and the inverse of all.
    rows = scratch(m, m)
    clear(rows)
    for i in range(m):
        rows[i, i] = 1.0
        for row in range(i + 1, m):
            entry = 0.0
            for k in range(i, row):
                entry -= compliance[row, k] * rows[i, k]
            rows[i, row] = entry
    for k in range(m):
        inverse = 1.0 / compliance[k, k]
        for i in range(k + 1):
            part = rows[i, k] * inverse
            for j in range(m):
                out[i, j] += part * rows[j, k]
    return out


@formula
def _entry_of(matrix_and_column: tuple[Array, int], i: int) -> float:
    return matrix_and_column[0][matrix_and_column[1], i]


@formula
def _column_of(matrix_and_surface: tuple[Array, Numbers], j: int) -> Numbers:
    return from_index(_entry_of, matrix_and_surface[1], (matrix_and_surface[0], j))


@formula
def task_inertia(model: TreeModel, posture: Posture, theta: Numbers, surface: Numbers) -> Columns:
    """Return (J H^-1 J')^-1 by its columns, kg, kg·m and kg·m²."""
    return from_index(_column_of, surface, (_task_inertia(model, posture, theta), surface))
