# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Operational space control: the first axes of the task first, the others in their null space.

A = J H^-1 J' and b = xddot_d - K_d edot - K_p e - Jdot v are split into the first axes (1) and the
others (2). With Lambda_1 = A_11^-1 and S = A_22 - A_21 Lambda_1 A_12,

    F_2 = S^-1 (b_2 - A_21 Lambda_1 b_1),    F_1 = Lambda_1 (b_1 - A_12 F_2),    f = J' F + V v,

which is J_1' Lambda_1 b_1 + N_1' J_2' F_2 + V v with N_1 = I - H^-1 J_1' Lambda_1 J_1, the
dynamically consistent projector of O. Khatib, "A unified approach for motion and force control of
robot manipulators: the operational space formulation", IEEE Journal of Robotics and Automation 3,
1987; reference [3] of the paper. S is the mobility that the first axes leave to the others. F_2 is
damped where S is small, and F_1 is exact for any F_2. J as a whole is not inverted.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Columns, Joints, Numbers
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import elementwise, from_index, unit
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import (
    DAMPING,
    motion_acceleration,
    spring,
    STIFFNESS,
)
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, plus, zero
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths, MechanismInertia, MechanismPosture

_LEAST_SHARE = 1.0e-6
"""Share of its mobility that a first axis must keep next to previous axes, or it is dropped."""

_DAMPED_SHARE = 1.0e-2
"""The same for the other axes, whose forces would grow without limit close to a singularity."""


class Settings(fields.Settings, group='null_space'):
    """Settings of the law."""

    null_space_first_axes: int = gain(
        2, 'Number of task axes, from the first on, that the others must not disturb', minimum=1
    )
    null_space_k_p: Axes = gain(STIFFNESS, 'Stiffness K_p per mass', '1/s²')
    null_space_k_d: Axes = gain(DAMPING, 'Damping K_d per mass', '1/s')


@formula
def _mobility_column(
    arguments: tuple[Lengths, MechanismPosture, MechanismInertia, Numbers, Numbers], j: int
) -> Numbers:
    """Return a column of J H^-1 J'."""
    model, posture, h, axes, template = arguments
    f = mechanism.forces_from_task(model, posture, unit(axes, j), template)
    return mechanism.task_velocity(model, posture, mechanism.inertia_solve(model, h, f))


@kernel
def prioritised_force(mobility: Columns, wanted: Numbers, first: int) -> Numbers:
    """
    Return F in N on the task's axes.

    Parameters
    ----------
    mobility
        Columns of A, 1/kg.
    wanted
        b in m/s².
    first
        Number of axes with priority, at most the number of axes.

    """
    n = len(wanted)
    work, force = scratch(n, n + 1), scratch(n)
    for i in range(n):
        work[i, n] = wanted[i]
        for j in range(n):
            work[i, j] = mobility[j][i]
    # Elimination of the first axes leaves S. A is semi-definite.
    for i in range(n):
        share = _LEAST_SHARE if i < first else _DAMPED_SHARE
        pivot, least = work[i, i], share * mobility[i][i]
        # 1 / pivot down to the least one, from where on it falls to zero.
        floored = pivot if pivot > least else least
        inverse = pivot / (floored * floored) if floored > 0.0 else 0.0
        work[i, i] = inverse
        for k in range(i + 1, n):
            factor = work[k, i] * inverse
            for j in range(i + 1, n):
                work[k, j] -= factor * work[i, j]
            work[k, n] -= factor * work[i, n]
    for reverse in range(n):
        i = n - 1 - reverse
        value = work[i, n]
        for j in range(i + 1, n):
            value -= work[i, j] * force[j]
        force[i] = value * work[i, i]
    return to_vector(force, wanted)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    model, posture = tick.model, tick.posture
    commanded = spring(tick, settings.null_space_k_d, settings.null_space_k_p)
    # For zero task acceleration, J times the acceleration is -Jdot v.
    still = motion_acceleration(tick, elementwise(zero, commanded))
    wanted = elementwise(plus, commanded, mechanism.task_velocity(model, posture, still))
    h = mechanism.inertia(model, posture, tick.nominal)
    mobility = from_index(
        _mobility_column, tick.surface, (model, posture, h, tick.surface, tick.velocity)
    )
    task_force = prioritised_force(mobility, wanted, settings.null_space_first_axes)
    f = mechanism.coriolis(model, posture, tick.nominal, tick.velocity)
    if len(tick.velocity) > len(tick.surface):
        # The free motion of the task follows the posture: H a minus its part in the task.
        moved = mechanism.task_velocity(model, posture, still)
        task_force = elementwise(
            minus, task_force, prioritised_force(mobility, moved, len(tick.surface))
        )
        f = elementwise(plus, f, mechanism.inertia_times(model, h, still))
    pushed = mechanism.forces_from_task(model, posture, task_force, tick.velocity)
    return mechanism.joint_torques(model, elementwise(plus, f, pushed))


NULL_SPACE = Law(
    'null_space',
    torque,
    Settings,
    post_update=project,
    summary='operational space control: the first axes first, the others in their null space',
    source='[3] of the paper; Khatib 1987',
    uses_switching=False,
)
