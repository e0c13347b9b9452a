# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The contract of a mechanism: what the laws and the plant ask of a kind of robot.

A mechanism has *joints* that take a torque, *positions*, the first of which are the base's
pose and the others the joints' positions, *axes* of its task, as many as joints or fewer, and
*parameters* theta in which its dynamics are linear. Its equations are written in velocities of
its own choice, `motion`, a constant linear map of the joints' rates, with the forces conjugate to
them.

What it is called and has, without formulas, is a `Mechanism` (`declaration.py`), which names the
module with the formulas: all of this file, under these names. They are chosen by the type of
`model`, the named tuple of the mechanism's constant lengths. All are pure; vectors are tuples, SI
units, radians; world frame and REP-103 where a formula speaks of a task. `template` is a vector as
long as the result. Built-in mechanisms are next to this file, others come by entry points
(`registry.py`).

A mechanism without redundancy and without speed limits needs neither `reachable_surface` nor
`compensated` nor `follow_drift`: those of `drift.py` stand in.

`square_task.py` has the formulas from `task_error` to `task_inertia` for a task of as many axes as
joints, whose errors are differences of coordinates; a mechanism with one imports them.

In addition to the formulas the module has, in plain Python or as kernels over arrays:

    MODEL                             the class of the named tuple of lengths
    constants(values)                 lengths and theta, two tuples, of values by the names of the
                                      mechanism's parameters without `robot.`; InputError for what
                                      is no robot
    start(values, pose, angles)       positions where `initial_pose` and the joints' angles are so
    out_of_reach(lengths, task)       first row of the task's positions (n, axes) that cannot be,
                                      and what is wrong with it; None where all can be
    base_motion(position, velocity)   poses (n, 7) of `base_link` in `odom`: m and a quaternion
                                      x, y, z, w; twists (n, 6) in `base_link`: m/s, rad/s
    frame_origins(lengths)            where each frame is in its parent, (frames, 3) in m
    frame_transforms(origins, position)   transforms (n, frames, 7) of positions (n, positions)
    description(values, driven, frame_prefix)   URDF, of all values by their whole names, with
                                      these names of the driven joints, a prefix before all links
    outline(lengths, position)        an `Outline`: what it looks like from above

It may have, where a straight line to the reference could leave the robot's reach:

    approach_start, approach_sample   kernels in place of those of `reference/approach.py`
    regular_posture(angles, rates)    joint angles from which a law in task space can start; None
                                      if it can from those given, with these velocities
"""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.dispatch import by_class, by_tag, interface
from masmc_ros.robot.declaration import formulas_of_model, formulas_of_tag
from masmc_ros.robot.drift import acceleration_itself, no_drift, surface_itself

"""
A vector; its length is the mechanism's number of what it has an entry for.

It is a tuple; theta and what has as many entries are arrays where those are more than
`numerics.tuples.LONGEST`, and formulas return an array then where `template` is one.
"""

_of_record = interface(by_tag('mechanism', formulas_of_tag))
of_model = interface(by_class(formulas_of_model))


@_of_record
def model_of(record: Any, lane: int) -> Any:
    """Return the lengths that a record of this mechanism holds."""


@of_model
def posture(model: Any, position: Numbers) -> Any:
    """Return what the other formulas need of the positions: sines and cosines."""


@of_model
def posture_of_joints(model: Any, angles: Numbers) -> Any:
    """Return the same with the base at the origin, from the joints' angles alone."""


@of_model
def motion(model: Any, rates: Numbers) -> Numbers:
    """Return the mechanism's velocities from the joints' rates."""


@of_model
def joint_rates(model: Any, motion: Numbers) -> Numbers:
    """Return the joints' rates (or their derivatives) from velocities (or theirs)."""


@of_model
def joint_torques(model: Any, forces: Numbers) -> Numbers:
    """Return the joints' torques that do the work of forces."""


@of_model
def forces(model: Any, torques: Numbers) -> Numbers:
    """Return the forces that do the work of the joints' torques."""


@of_model
def position_rates(model: Any, posture: Any, rates: Numbers) -> Numbers:
    """Return the derivative of the positions from the joints' rates."""


@of_model
def task_position(model: Any, posture: Any, position: Numbers) -> Numbers:
    """Return the task's coordinates x, as many as axes."""


@of_model
def task_velocity(model: Any, posture: Any, motion: Numbers) -> Numbers:
    """Return J v."""


class Tracking(NamedTuple):
    """
    How a state follows what is desired of the task.

    Velocities of the task are what J v is: rates of coordinates, or where an axis turns a frame,
    components of its angular velocity, which are no coordinate's rates.
    """

    error: Numbers  # e, zero where x is x_d
    error_derivative: Numbers  # de/dt
    velocity_error: Numbers  # J v less the desired velocity
    velocity: Numbers  # desired
    acceleration: Numbers  # desired, its derivative


@of_model
def task_error(model: Any, posture: Any, position: Numbers, desired: Numbers) -> Numbers:
    """Return e, of the positions and of x_d."""


@of_model
def tracking(
    model: Any,
    posture: Any,
    position: Numbers,
    motion: Numbers,
    desired: tuple[Numbers, Numbers, Numbers],
) -> Tracking:
    """Return how a state follows x_d and its first and second derivatives."""


@of_model
def reference_motion(
    model: Any,
    posture: Any,
    position: Numbers,
    motion: Numbers,
    velocity: Numbers,
    acceleration: Numbers,
) -> tuple[Numbers, Numbers, bool]:
    """
    Return v_r and a_r, finite everywhere, and whether J is close to singular.

    J v_r is the task's velocity where nothing is singular, and a_r the derivative of v_r along the
    true motion while the task's acceleration is that given. What the task leaves free is the
    mechanism's, with what damps it in a_r.
    """


@interface(by_class(formulas_of_model), otherwise=surface_itself)
def reachable_surface(
    model: Any, posture: Any, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return J (v - v_r): s, less what limits and singularities keep v_r from."""


@interface(by_class(formulas_of_model), otherwise=acceleration_itself)
def compensated(model: Any, acceleration: Numbers, drift: Numbers) -> Numbers:
    """Return a_r less the estimated drift."""


@interface(by_class(formulas_of_model), otherwise=no_drift)
def follow_drift(
    model: Any,
    posture: Any,
    settings: Any,
    memory: Any,
    lane: int,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
    missing: Numbers,
) -> None:
    """
    Update the estimated drift in the memory after a tick.

    `settings` are the law's, `surface` is s, `missing` are the torques that limits take away.
    """


@of_model
def motion_error(
    model: Any, posture: Any, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return sigma = v - v_r, whose J sigma is the surface s."""


@of_model
def task_inertia(model: Any, posture: Any, theta: Numbers, surface: Numbers) -> Any:
    """Return H_x, what the task feels of the inertia, by its columns; s has as many entries."""


@of_model
def motion_from_task(model: Any, posture: Any, rates: Numbers, template: Numbers) -> Numbers:
    """Return J^-1 xdot, finite everywhere; damped where `is_singular`."""


@of_model
def forces_from_task(model: Any, posture: Any, force: Numbers, template: Numbers) -> Numbers:
    """Return J' F."""


@of_model
def is_singular(model: Any, posture: Any) -> bool:
    """Return True if J of a square task cannot be inverted undamped; called by `square_task`."""


@of_model
def regressor(
    model: Any, posture: Any, motion: Numbers, reference: Numbers, acceleration: Numbers
) -> Any:
    """Return Y(q, v, v_r, a_r): H a_r + V v_r and the forces against gravity = Y theta."""


@of_model
def regressor_times(model: Any, y: Any, theta: Numbers) -> Numbers:
    """Return Y theta, forces."""


@of_model
def regressor_transpose_times(model: Any, y: Any, motion: Numbers, template: Numbers) -> Numbers:
    """Return Y' v, an entry per parameter."""


@of_model
def theta_step(
    model: Any, settings: Any, lane: int, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """
    Return theta after one period of adaptation that follows a gradient, before all else.

    `settings` are the law's, with Gamma as `gamma` and what else the mechanism declares for laws.
    `gradient_step.py` has this formula and the next for theta whose entries are free.
    """


@of_model
def preserves_consistency(model: Any, settings: Any, lane: int) -> bool:
    """Return True if `theta_step` keeps theta physically possible, without a projection."""


@of_model
def inertia(model: Any, posture: Any, theta: Numbers) -> Any:
    """Return H."""


@of_model
def inertia_times(model: Any, inertia: Any, acceleration: Numbers) -> Numbers:
    """Return H vdot, forces."""


@of_model
def inertia_solve(model: Any, inertia: Any, forces: Numbers) -> Numbers:
    """Return H^-1 f."""


@of_model
def coriolis(model: Any, posture: Any, theta: Numbers, motion: Numbers) -> Numbers:
    """Return V v and the forces against gravity; Hdot - 2 V is skew-symmetric."""


@of_model
def joint_accelerations(
    model: Any, posture: Any, theta: Numbers, rates: Numbers, torques: Numbers
) -> Numbers:
    """
    Return the joints' accelerations under torques.

    `forward_dynamics.py` has this formula by those above.
    """


@of_model
def weakest_motion(model: Any, theta: Numbers) -> tuple[float, Numbers]:
    """
    Return the first pivot of the inertia's consistency matrix that is not positive, and x.

    x' Q(theta) x is that pivot. Where all are positive, bodies can have theta, and it is the
    last one.
    """


@of_model
def consistency_normal(model: Any, x: Numbers, template: Numbers) -> Numbers:
    """Return the vector n with n' theta = x' Q(theta) x."""


@of_model
def rate_command(model: Any, motion: Numbers) -> Numbers:
    """Return the velocities as drives are commanded: the base's own, then the joints' rates."""


@of_model
def commanded_joint_rates(model: Any, command: Numbers) -> Numbers:
    """Return the joints' rates that a command of rates comes to."""


@of_model
def dead_reckoned(model: Any, pose: Numbers, turned: Numbers) -> Numbers:
    """Return the base's pose after the joints have turned by so many radians."""


@of_model
def counts_turns(model: Any, resolution: Numbers) -> bool:
    """Return True if the encoders for the base's pose have a finite resolution."""
