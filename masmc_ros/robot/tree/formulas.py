# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Interface of mechanisms for a tree of bodies with tasks of frame poses and joint positions.

Positions are x, y and yaw of the base in the world, constant if it is fixed. The positions of the
wheels follow, then those of the joints in the order of the tree. Velocities are nu of `dynamics`.
Task, redundancy and physical consistency are in separate files.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.arrays import array_of, changeable, to_vector
from masmc_ros.jit.compiled import called_kernel, formula, kernel
from masmc_ros.jit.lanes import in_place, part_in_place
from masmc_ros.jit.scratch import copy_into, lasting, scratch
from masmc_ros.jit.tuples import elementwise, joined
from masmc_ros.numerics.elimination import factor, solve
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.numerics.scalars import minus, zero
from masmc_ros.robot.formula_types import HasGeometry, LawSettings
from masmc_ros.robot.shared_formulas import gradient_step
from masmc_ros.robot.tree import dynamics
from masmc_ros.robot.tree.articulated import write_accelerations
from masmc_ros.robot.tree.consistency import consistency_normal, weakest_motion
from masmc_ros.robot.tree.dynamics import GRAVITY, inertia
from masmc_ros.robot.tree.friction import add_friction, write_friction_gradient
from masmc_ros.robot.tree.kinematics import base_motion, place, Posture
from masmc_ros.robot.tree.natural_adaptation import adapted
from masmc_ros.robot.tree.task.null_space_drift import compensated, follow_drift, reachable_surface
from masmc_ros.robot.tree.task.redundancy import (
    motion_from_task,
    reference_motion,
    task_inertia,
)
from masmc_ros.robot.tree.task.task import (
    forces_from_task,
    task_error,
    task_position,
    task_velocity,
    tracking,
)
from masmc_ros.robot.tree.tree_model import (
    AXES,
    AXIS_COUNT,
    base_of,
    bodies_of,
    damping_of,
    TreeModel,
)
from masmc_ros.robot.tree.wheels import into_base, into_wheels

__all__ = [
    'compensated',
    'consistency_normal',
    'follow_drift',
    'forces_from_task',
    'inertia',
    'motion_from_task',
    'reachable_surface',
    'reference_motion',
    'task_error',
    'task_inertia',
    'task_position',
    'task_velocity',
    'tracking',
    'weakest_motion',
]

MODEL = TreeModel

POSE = 3
"""Coordinates of the base."""

ADAPTATIONS = ('natural', 'gradient')
NATURAL = 0
"""Indices of the choices of `adaptation`."""


class _TreeParameters:
    """Parameter of laws of trees, declared in `tree_mechanism`."""

    adaptation: int


class _Settings(LawSettings, _TreeParameters):
    """Settings with the parameter of trees."""


class Regressor(NamedTuple):
    """Y(q, v, v_r, a_r), which is never formed."""

    posture: Posture
    motions: Array
    """(B, MOTION) of the bodies: `dynamics.write_motions`."""
    reference: Numbers
    acceleration: Numbers


@formula
def model_of(record: HasGeometry) -> TreeModel:
    """Return the model in a record."""
    numbers = in_place(record, 'geometry')
    count = int(numbers[AXIS_COUNT])
    return TreeModel(numbers, part_in_place(record, 'geometry', AXES, count))


@kernel
def posture(model: TreeModel, position: Numbers) -> Posture:
    """Return the positions of the bodies."""
    return place(model, position[0], position[1], position[2], position, POSE + base_of(model))


@kernel
def posture_of_joints(model: TreeModel, angles: Numbers) -> Posture:
    """Return the positions of the bodies with the base at the origin."""
    return place(model, 0.0, 0.0, 0.0, angles, base_of(model))


@kernel
def motion(model: TreeModel, rates: Numbers) -> Numbers:
    """Return nu from the rates of wheels and joints."""
    values = changeable(rates)
    into_base(model, values, False)
    return to_vector(values, rates)


@kernel
def joint_rates(model: TreeModel, motion: Numbers) -> Numbers:
    """Return the rates of wheels and joints."""
    values = changeable(motion)
    into_wheels(model, values, False)
    return to_vector(values, motion)


@kernel
def joint_torques(model: TreeModel, forces: Numbers) -> Numbers:
    """Return the torques of wheels and joints."""
    values = changeable(forces)
    into_wheels(model, values, True)
    return to_vector(values, forces)


@kernel
def forces(model: TreeModel, torques: Numbers) -> Numbers:
    """Return the forces conjugate to nu."""
    values = changeable(torques)
    into_base(model, values, True)
    return to_vector(values, torques)


@kernel
def _pose_rates(model: TreeModel, posture: Posture, rates: Numbers) -> Numbers:
    values = changeable(rates)
    into_base(model, values, False)
    w, v = base_motion(base_of(model), values)
    s, c = posture.sine, posture.cosine
    return c * v[0] - s * v[1], s * v[0] + c * v[1], w[2]


@formula
def position_rates(model: TreeModel, posture: Posture, rates: Numbers) -> Numbers:
    """Return the derivative of the positions."""
    return joined(_pose_rates(model, posture, rates), rates)


@formula
def motion_error(
    model: TreeModel, posture: Posture, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return nu - nu_r."""
    return elementwise(minus, motion, reference)


@formula
def regressor(
    model: TreeModel,
    posture: Posture,
    motion: Numbers,
    reference: Numbers,
    acceleration: Numbers,
) -> Regressor:
    """Return the factors of Y."""
    motions = _motions(model, posture, motion, reference, acceleration)
    return Regressor(posture, motions, reference, acceleration)


@called_kernel
def _motions(
    model: TreeModel,
    posture: Posture,
    motion: Numbers,
    reference: Numbers,
    acceleration: Numbers,
) -> Array:
    """Return the motions of the bodies for products with Y."""
    motions = lasting(motion, bodies_of(model), dynamics.MOTION)
    nu, nu_r, a_r = array_of(motion), array_of(reference), array_of(acceleration)
    dynamics.write_motions(model, posture, nu, nu_r, a_r, GRAVITY, motions)
    return motions


@called_kernel
def regressor_times(model: TreeModel, y: Regressor, theta: Numbers) -> Numbers:
    """
    Return H a_r + C nu_r + g and friction.

    It includes the inertia of rotors and wheels, which is no parameter.
    """
    parameters, reference = array_of(theta), array_of(y.reference)
    forces = scratch(len(reference))
    acceleration = array_of(y.acceleration)
    dynamics.write_forces(model, y.posture, parameters, y.motions, acceleration, forces)
    add_friction(model, parameters, reference, 1.0, forces)
    return to_vector(forces, y.reference)


@called_kernel
def regressor_transpose_times(
    model: TreeModel, y: Regressor, motion: Numbers, template: Numbers
) -> Numbers:
    """Return Y' v."""
    reference, along = array_of(y.reference), array_of(motion)
    gradient = scratch(len(template))
    dynamics.write_gradients(model, y.posture, y.motions, along, gradient)
    write_friction_gradient(model, reference, along, gradient)
    return to_vector(gradient, template)


@formula
def theta_step(
    model: TreeModel, settings: _Settings, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """
    Return the parameters after a step of natural adaptation, or of independent adaptation.

    The gain of a body is the entry of `gamma` for its mass; with projection, neither mass nor
    size of a body grows beyond `projection.upper` times the nominal one.
    """
    gamma = settings.gamma
    if settings.adaptation != NATURAL:
        return elementwise(gradient_step, theta, gradient, gamma, period)
    is_free = settings.projection_lower == 0.0
    upper = 1.0e300 if is_free else settings.projection_upper
    nominal = settings.nominal
    return adapted(model, theta, nominal, gradient, gamma, period, upper)


@formula
def preserves_consistency(model: TreeModel, settings: _Settings) -> bool:
    """Return True if the adaptation is natural."""
    return settings.adaptation == NATURAL


@kernel
def inertia_times(model: TreeModel, inertia: Array, acceleration: Numbers) -> Numbers:
    """Return H nudot."""
    values = array_of(acceleration)
    out = scratch(len(values))
    for i in range(len(values)):
        total = 0.0
        for j in range(len(values)):
            total += inertia[i, j] * values[j]
        out[i] = total
    return to_vector(out, acceleration)


@called_kernel
def inertia_solve(model: TreeModel, inertia: Array, forces: Numbers) -> Numbers:
    """Return H^-1 f."""
    factors, x = scratch(len(inertia), len(inertia)), changeable(forces)
    copy_into(factors, inertia)
    factor(factors)
    solve(factors, x)
    return to_vector(x, forces)


@formula
def coriolis(model: TreeModel, posture: Posture, theta: Numbers, motion: Numbers) -> Numbers:
    """Return C nu + g and friction."""
    still = elementwise(zero, motion)
    return regressor_times(model, regressor(model, posture, motion, motion, still), theta)


@kernel
def joint_accelerations(
    model: TreeModel, posture: Posture, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """Return the accelerations of wheels and joints under torques."""
    nu, f, parameters = changeable(rates), changeable(torques), array_of(theta)
    into_base(model, nu, False)
    into_base(model, f, True)
    add_friction(model, parameters, nu, -1.0, f)
    accelerations = scratch(len(nu))
    write_accelerations(model, posture, parameters, nu, f, GRAVITY, accelerations)
    into_wheels(model, accelerations, False)
    return to_vector(accelerations, rates)


@formula
def rate_command(model: TreeModel, motion: Numbers) -> Numbers:
    """Return the velocities nu unchanged, because they are those that the drives follow."""
    return motion


@formula
def reference_damping(model: TreeModel) -> float:
    """Return kappa of a_r in 1/s."""
    return damping_of(model)


@formula
def commanded_joint_rates(model: TreeModel, command: Numbers) -> Numbers:
    """Return the rates of wheels and joints."""
    return joint_rates(model, command)


@kernel
def dead_reckoned(model: TreeModel, pose: Numbers, turned: Numbers) -> Numbers:
    """Return the base pose after a rotation of the wheels, along the mean of both headings."""
    values = changeable(turned)
    into_base(model, values, False)
    w, v = base_motion(base_of(model), values)
    s, c = sin_cos(pose[2] + 0.5 * w[2])
    reached = scratch(POSE)
    reached[0], reached[1] = pose[0] + v[0] * c - v[1] * s, pose[1] + v[0] * s + v[1] * c
    reached[2] = pose[2] + w[2]
    return to_vector(reached, pose)


@kernel
def counts_turns(model: TreeModel, resolution: Numbers) -> bool:
    """Return True if the wheels' encoders have a finite resolution."""
    is_finite, values = False, array_of(resolution)
    for i in range(base_of(model)):
        is_finite = is_finite or values[i] > 0.0
    return is_finite
