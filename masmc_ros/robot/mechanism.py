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
The contract of a mechanism: what the laws and the plant ask of a robot.

A mechanism has *joints* that take a torque, *positions* of which the first few are the base's
pose and the others the joints' angles, *axes* of its task, as many as joints, and *parameters*
theta in which its dynamics are linear. Its equations are written in velocities of its own
choice, `motion`, a constant linear map of the joints' rates, with the forces conjugate to them.

The formulas below are chosen by the type of `model`, the named tuple of the mechanism's
constant lengths; each robot's file has formulas of these names. All are pure; vectors are
tuples, SI units, radians; world frame and REP-103 where a formula speaks of a task.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from masmc_ros.numerics.dispatch import by_class, by_tag, contract

Numbers = tuple[float, ...]
"""A vector; its length is the mechanism's number of what it has an entry for."""


@dataclass(frozen=True)
class Mechanism:
    """One kind of robot: its sizes, and its formulas by their names in this file."""

    name: str
    sizes: Mapping[str, int]
    """Numbers of `axes`, `joints`, `base` positions, `positions`, `parameters`, `lengths`."""
    model: type
    """Class of the named tuple of its lengths."""
    formulas: Any
    """Module with the formulas."""
    entries: Mapping[str, str] = field(default_factory=dict)
    """What parameters of a size have an entry for each of: 'on JOINT, JOINT'; by size."""
    drives: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Limits of drives that fit it: `torque_limit` (N m), `torque_rate_limit` (N m/s)."""


_BY_NAME: dict[str, Mechanism] = {}
_BY_CLASS: dict[type, Any] = {}


def register(mechanism: Mechanism) -> Mechanism:
    """Make a mechanism known to compiled code."""
    _BY_NAME[mechanism.name] = mechanism
    _BY_CLASS[mechanism.model] = mechanism.formulas
    return mechanism


_of_record = contract(by_tag('mechanism', lambda name: _BY_NAME[name].formulas))
_of_model = contract(by_class(lambda model: _BY_CLASS[model]))


@_of_record
def model_of(record: Any, lane: int) -> Any:
    """Return the lengths that a record of this mechanism holds."""


@_of_model
def posture(model: Any, position: Numbers) -> Any:
    """Return what the other formulas need of the positions: sines and cosines."""


@_of_model
def posture_of_joints(model: Any, angles: Numbers) -> Any:
    """Return the same with the base at the origin, from the joints' angles alone."""


@_of_model
def motion(model: Any, rates: Numbers) -> Numbers:
    """Return the mechanism's velocities from the joints' rates."""


@_of_model
def joint_rates(model: Any, motion: Numbers) -> Numbers:
    """Return the joints' rates (or their derivatives) from velocities (or theirs)."""


@_of_model
def joint_torques(model: Any, forces: Numbers) -> Numbers:
    """Return the joints' torques that do the work of forces."""


@_of_model
def forces(model: Any, torques: Numbers) -> Numbers:
    """Return the forces that do the work of the joints' torques."""


@_of_model
def position_rates(model: Any, posture: Any, rates: Numbers) -> Numbers:
    """Return the derivative of the positions from the joints' rates."""


@_of_model
def task_position(model: Any, posture: Any, position: Numbers) -> Numbers:
    """Return the task's coordinates x."""


@_of_model
def task_velocity(model: Any, posture: Any, motion: Numbers) -> Numbers:
    """Return J v."""


@_of_model
def task_drift(model: Any, posture: Any, motion: Numbers, reference: Numbers) -> Numbers:
    """Return Jdot(v) v_r."""


@_of_model
def motion_from_task(model: Any, posture: Any, rates: Numbers) -> Numbers:
    """Return J^-1 xdot, finite everywhere; damped where `is_singular`."""


@_of_model
def forces_from_task(model: Any, posture: Any, force: Numbers) -> Numbers:
    """Return J' F."""


@_of_model
def task_from_forces(model: Any, posture: Any, forces: Numbers) -> Numbers:
    """Return J^-T f."""


@_of_model
def is_singular(model: Any, posture: Any) -> bool:
    """Tell whether J cannot be inverted as it is."""


@_of_model
def regressor(
    model: Any, posture: Any, motion: Numbers, reference: Numbers, acceleration: Numbers
) -> Any:
    """Return Y(q, v, v_r, a_r): H a_r + V v_r = Y theta."""


@_of_model
def regressor_times(model: Any, y: Any, theta: Numbers) -> Numbers:
    """Return Y theta, forces."""


@_of_model
def regressor_transpose_times(model: Any, y: Any, motion: Numbers) -> Numbers:
    """Return Y' v, an entry per parameter."""


@_of_model
def inertia(model: Any, posture: Any, theta: Numbers) -> Any:
    """Return H."""


@_of_model
def inertia_times(model: Any, inertia: Any, acceleration: Numbers) -> Numbers:
    """Return H vdot, forces."""


@_of_model
def inertia_solve(model: Any, inertia: Any, forces: Numbers) -> Numbers:
    """Return H^-1 f."""


@_of_model
def coriolis(model: Any, posture: Any, theta: Numbers, motion: Numbers) -> Numbers:
    """Return V v, forces; Hdot - 2 V is skew-symmetric."""


@_of_model
def weakest_motion(model: Any, theta: Numbers) -> tuple[float, Numbers]:
    """
    Return the first pivot of the inertia's consistency matrix that is not positive, and x.

    x' Q(theta) x is that pivot. Where all are positive, bodies can have theta, and it is the
    last one.
    """


@_of_model
def consistency_normal(model: Any, x: Numbers) -> Numbers:
    """Return the vector n with n' theta = x' Q(theta) x."""


@_of_model
def rate_command(model: Any, motion: Numbers) -> Numbers:
    """Return the velocities as drives are commanded: the base's own, then the joints' rates."""


@_of_model
def commanded_joint_rates(model: Any, command: Numbers) -> Numbers:
    """Return the joints' rates that a command of rates comes to."""


@_of_model
def dead_reckoned(model: Any, pose: Numbers, turned: Numbers) -> Numbers:
    """Return the base's pose after the joints have turned by so many radians."""


@_of_model
def counts_turns(model: Any, resolution: Numbers) -> bool:
    """Tell whether the encoders by which the base's pose is reckoned have a finite resolution."""
