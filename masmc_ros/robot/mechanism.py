# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Interface of a mechanism, between the laws and the plant and a type of robot.

A mechanism has actuated *joints*; *positions*, first of the base pose and then of the joints;
*axes* of its task, at most as many as joints; and *parameters* theta, in which its dynamics are
linear. Its equations use velocities of its choice, `motion`, a constant linear map of the joint
rates, and the forces conjugate to them.

A `Mechanism` (`declaration.py`) declares names and numbers, and the module with the formulas: all
of this file, under the same names. The type of `model`, the named tuple of the mechanism's
constant lengths, selects them. All are pure and use SI units, radians and, for a task, the world
frame by REP-103. Vectors are tuples; their types (`Axes`, `Joints`, ...) name their sizes, which
the dry run of a mechanism checks. With the size `jit.record.AT_RUN_TIME`, one compiled code
serves mechanisms of all sizes, and vectors are those of `jit.vectors`. `template` is a vector
of the kind and length of the result. Built-in mechanisms are next to this file; plug-ins use entry
points (`mechanisms.py`).

A mechanism without redundancy and without speed limits needs neither `reference_damping` nor
`reachable_surface` nor `compensated` nor `follow_drift`: their bodies here are the defaults.

`shared_formulas.py` has the formulas from `task_error` to `task_inertia` for a task of as many
axes as joints, whose errors are differences of coordinates; a mechanism with one imports them.

In addition to the formulas the module has, in plain Python or as kernels over arrays:

    MODEL                             the class of the named tuple of lengths
    constants(values)                 lengths and theta, two tuples, of values by the names of the
                                      mechanism's parameters without `robot.`; InputError for an
                                      invalid robot
    start(values, pose, angles)       positions for `initial_pose` and the joint angles
    out_of_reach(lengths, task)       first unreachable row of the task positions (n, axes), and
                                      the reason; None if all are reachable
    base_motion(position, velocity)   poses (n, 7) of `base_link` in `odom`: m and a quaternion
                                      x, y, z, w; twists (n, 6) in `base_link`: m/s, rad/s
    frame_origins(lengths)            position of each frame in its parent, (frames, 3) in m
    frame_transforms(origins, position)   transforms (n, frames, 7) of positions (n, positions)
    description(values, driven, frame_prefix)   URDF, of all values by their whole names, with
                                      these names of the driven joints, a prefix before all links
    outline(lengths, position)        an `Outline`: drawing in top view

If a straight line to the reference could leave the robot's reach, it may have:

    approach_start, approach_sample   kernels in place of those of `reference/approach.py`
    unfolded(body, angles, rates)     formula of a record: whether a law in task space cannot start
                                      from these joint angles and velocities, and angles from
                                      which it can

With a `carrier` in its declaration it has:

    comfortable_reach(lengths)        least and largest distance in m from the carrier to the end
                                      effector, clear of both limits of the arm

and, if its axes are not x and y of the carrier:

    base_axes(path, before, trail)    the axes (n, size) for a path (n, axes) in task coordinates;
                                      `before` has those at its start, or is None.
                                      `trail(path, start, least, most)` returns the places (n, 2)
                                      of a carrier that follows places (n, 2)

*Drift* are accelerations in the null space of the task that the model does not explain. The
disturbance estimate of a law is on the task axes. A robot with more velocities than axes is also
accelerated in the null space of the task. Such a mechanism estimates these accelerations, and a_r
compensates them (`follow_drift`, `compensated`). For any other mechanism the drift stays zero.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Axes, BasePose, Joints, Parameters, Positions
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.dispatch import by_class, by_tag, interface
from masmc_ros.robot.declaration import formulas_of_model, formulas_of_tag
from masmc_ros.robot.formula_types import (
    HasGeometry,
    LawMemory,
    LawSettings,
    Lengths,
    MechanismInertia,
    MechanismPosture,
    MechanismRegressor,
)

_of_record = interface(by_tag('mechanism', formulas_of_tag))
_by_model = by_class(formulas_of_model)
of_model = interface(_by_model)
_of_model_or_default = interface(_by_model, formula)


@_of_record
def model_of(record: HasGeometry) -> Lengths:
    """Return the lengths in a record of this mechanism, in its own named tuple."""


@of_model
def posture(model: Lengths, position: Positions) -> MechanismPosture:
    """Return the sines and cosines of the positions for the other formulas."""


@of_model
def posture_of_joints(model: Lengths, angles: Joints) -> MechanismPosture:
    """Return the posture of joint angles (joints), with the base at the origin."""


@of_model
def motion(model: Lengths, rates: Joints) -> Joints:
    """Return the mechanism's velocities from the joints' rates."""


@of_model
def joint_rates(model: Lengths, motion: Joints) -> Joints:
    """Return the joints' rates (or their derivatives) from velocities (or theirs)."""


@of_model
def joint_torques(model: Lengths, forces: Joints) -> Joints:
    """Map generalised forces to joint torques (equal power)."""


@of_model
def forces(model: Lengths, torques: Joints) -> Joints:
    """Map joint torques to generalised forces (equal power)."""


@of_model
def position_rates(model: Lengths, posture: MechanismPosture, rates: Joints) -> Positions:
    """Return the derivative of the positions from the joints' rates."""


@of_model
def task_position(model: Lengths, posture: MechanismPosture, position: Positions) -> Axes:
    """Return the task's coordinates x, as many as axes."""


@of_model
def task_velocity(model: Lengths, posture: MechanismPosture, motion: Joints) -> Axes:
    """Return J v."""


class Tracking(NamedTuple):
    """
    Tracking of the desired task motion by a state.

    Task velocities are J v: rates of coordinates or, for rotations of a frame, components of its
    angular velocity, which are not the rates of coordinates.
    """

    error: Axes  # e, zero if x = x_d
    error_derivative: Axes  # de/dt
    velocity_error: Axes  # J v less the desired velocity
    velocity: Axes  # desired
    acceleration: Axes  # desired, its derivative


@of_model
def task_error(
    model: Lengths, posture: MechanismPosture, position: Positions, desired: Axes
) -> Axes:
    """Return e, of the positions and of x_d."""


@of_model
def tracking(
    model: Lengths,
    posture: MechanismPosture,
    position: Positions,
    motion: Joints,
    desired: tuple[Axes, Axes, Axes],
) -> Tracking:
    """Return the tracking of x_d and its first and second derivatives by a state."""


@of_model
def reference_motion(
    model: Lengths,
    posture: MechanismPosture,
    position: Positions,
    motion: Joints,
    velocity: Axes,
    acceleration: Axes,
) -> tuple[Joints, Joints, bool]:
    """
    Return v_r and a_r, which are always finite, and True if J is close to singular.

    Without a singularity, J v_r is `velocity`, and a_r is the derivative of v_r along the true
    motion for the task acceleration. The mechanism determines the motion in the null space of the
    task, with damping in a_r.
    """


@_of_model_or_default
def reference_damping(model: Lengths) -> float:
    """Return kappa in 1/s, with which a_r is the derivative of v_r less kappa (v - v_r)."""
    return 0.0


@_of_model_or_default
def reachable_surface(
    model: Lengths,
    posture: MechanismPosture,
    motion: Joints,
    reference: Joints,
    surface: Axes,
) -> Axes:
    """Return J (v - v_r): s, without the part that limits and singularities prevent in v_r."""
    return surface


@_of_model_or_default
def compensated(model: Lengths, acceleration: Joints, drift: Joints) -> Joints:
    """Return a_r - drift (joints): `acceleration` is a_r, `drift` is `memory.drift`."""
    return acceleration


@_of_model_or_default
def follow_drift(
    model: Lengths,
    posture: MechanismPosture,
    settings: LawSettings,
    memory: LawMemory,
    motion: Joints,
    reference: Joints,
    surface: Axes,
    missing: Joints,
) -> None:
    """
    Update the estimated drift in the memory after a tick.

    Parameters
    ----------
    model, posture
        Lengths, and posture of the measured state.
    settings, memory
        Those of the law; `memory.drift` (joints) is an acceleration of the velocities v.
    motion, reference
        Velocities v, and v_r of the tick.
    surface
        Sliding surface s (axes).
    missing
        Joint torques (joints) that limits removed: requested minus commanded.

    """


@of_model
def motion_error(
    model: Lengths,
    posture: MechanismPosture,
    motion: Joints,
    reference: Joints,
    surface: Axes,
) -> Joints:
    """Return sigma = v - v_r, whose J sigma is the surface s."""


@of_model
def task_inertia(
    model: Lengths, posture: MechanismPosture, theta: Parameters, surface: Axes
) -> tuple[Axes, ...]:
    """Return the columns of the task inertia H_x; `surface` has as many entries."""


@of_model
def motion_from_task(
    model: Lengths, posture: MechanismPosture, rates: Axes, template: Joints
) -> Joints:
    """Return J^-1 xdot, finite everywhere; damped if `is_singular`."""


@of_model
def forces_from_task(
    model: Lengths, posture: MechanismPosture, force: Axes, template: Joints
) -> Joints:
    """Return J' F."""


@of_model
def regressor(
    model: Lengths,
    posture: MechanismPosture,
    motion: Joints,
    reference: Joints,
    acceleration: Joints,
) -> MechanismRegressor:
    """Return Y(q, v, v_r, a_r): H a_r + V v_r and the forces against gravity = Y theta."""


@of_model
def regressor_times(model: Lengths, y: MechanismRegressor, theta: Parameters) -> Joints:
    """Return Y theta, forces."""


@of_model
def regressor_transpose_times(
    model: Lengths, y: MechanismRegressor, motion: Joints, template: Parameters
) -> Parameters:
    """Return Y' v, an entry per parameter."""


@of_model
def theta_step(
    model: Lengths, settings: LawSettings, theta: Parameters, gradient: Parameters, period: float
) -> Parameters:
    """
    Return theta after one period of adaptation along a gradient, before leakage and projection.

    `settings` are those of the law, with Gamma as `gamma` and the mechanism's law parameters.
    `shared_formulas.py` has this formula and the next one for independent parameters.
    """


@of_model
def preserves_consistency(model: Lengths, settings: LawSettings) -> bool:
    """Return True if `theta_step` keeps theta physically possible, without a projection."""


@of_model
def inertia(model: Lengths, posture: MechanismPosture, theta: Parameters) -> MechanismInertia:
    """Return the inertia matrix H."""


@of_model
def inertia_times(model: Lengths, inertia: MechanismInertia, acceleration: Joints) -> Joints:
    """Return H vdot, forces."""


@of_model
def inertia_solve(model: Lengths, inertia: MechanismInertia, forces: Joints) -> Joints:
    """Return H^-1 f."""


@of_model
def coriolis(
    model: Lengths, posture: MechanismPosture, theta: Parameters, motion: Joints
) -> Joints:
    """Return V v and the forces against gravity; Hdot - 2 V is skew-symmetric."""


@of_model
def joint_accelerations(
    model: Lengths, posture: MechanismPosture, theta: Parameters, rates: Joints, torques: Joints
) -> Joints:
    """
    Return the joints' accelerations under torques.

    `shared_formulas.py` computes it with the formulas above.
    """


@of_model
def weakest_motion(model: Lengths, theta: Parameters) -> tuple[float, Joints]:
    """
    Return the first pivot of the inertia's consistency matrix that is not positive, and x.

    x' Q(theta) x is that pivot. If all are positive, theta is physically consistent, and it is the
    last pivot.
    """


@of_model
def consistency_normal(model: Lengths, x: Joints, template: Parameters) -> Parameters:
    """Return the vector n with n' theta = x' Q(theta) x."""


@of_model
def rate_command(model: Lengths, motion: Joints) -> Joints:
    """Return the command of the drives: base velocities, then rates of the other joints."""


@of_model
def commanded_joint_rates(model: Lengths, command: Joints) -> Joints:
    """Return the joint rates of a command of rates."""


@of_model
def dead_reckoned(model: Lengths, pose: BasePose, turned: Joints) -> BasePose:
    """Return the base pose after a rotation of the joints in rad."""


@of_model
def counts_turns(model: Lengths, resolution: Joints) -> bool:
    """Return True if the encoders for the base's pose have a finite resolution."""

