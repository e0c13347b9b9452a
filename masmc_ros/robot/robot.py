# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robot: a mechanism with lengths and base inertial parameters, and its kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.params.declaration import Values
from masmc_ros.robot import mechanism as formulas
from masmc_ros.robot.declaration import Mechanism, ODOM_FRAME
from masmc_ros.robot.mechanism_dry_run import check
from masmc_ros.robot.mechanisms import driven_joint_names, mechanism_from
from masmc_ros.robot.moments import second_moments
import numpy as np

_BODY = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('position', 'positions', 'Positions', 'm, rad'),
    Field('rates', 'joints', "The joints' rates", 'rad/s'),
    Field('error', 'axes', 'Coordinates of the task', 'm'),
)


@dataclass(frozen=True, eq=False)
class Robot:
    """Robot with the inputs of the formulas."""

    mechanism: Mechanism
    """Type of the robot."""
    values: Values
    """Parameters of the robot by name, without `robot.`."""
    geometry: Array
    """Lengths in m, in the order of the mechanism's model."""
    theta: Array
    """Base inertial parameters in the mechanism's order."""

    @cached_property
    def body(self) -> Records:
        """Return the record (1) with the mechanism and lengths for kernels."""
        record = new_record(_BODY, self.mechanism.sizes, 1, {'mechanism': self.mechanism.tag})
        fill(record, 'geometry', self.geometry)
        return record

    def task_positions(self, position: Array) -> Array:
        """Return x (n, axes) in m of positions (n, positions) in the order of joint_states."""
        positions: Array = _task_positions(self.body, position)
        return positions

    def task_errors(self, position: Array, desired: Array) -> Array:
        """
        Return the task errors (n, axes) of positions, as laws compute them.

        Parameters
        ----------
        position
            Positions (n, positions) in the order of joint_states.
        desired
            x_d (n, axes) in m and rad.

        """
        errors: Array = _task_errors(self.body, position, desired)
        return errors

    def start(self, pose: tuple[float, ...], angles: tuple[float, ...]) -> tuple[float, ...]:
        """Return the positions of `initial_pose` and of the joints' angles."""
        positions: tuple[float, ...] = self.mechanism.formulas.start(self.values, pose, angles)
        return positions

    @cached_property
    def frame_origins(self) -> Array:
        """Position of each frame in its parent, (frames, 3) in m; zero in the world frame."""
        origins: Array = self.mechanism.formulas.frame_origins(self.geometry)
        return origins

    def frame_transforms(self, position: Array) -> Array:
        """Return the transforms (n, frames, 7) of positions (n, positions), m and quaternions."""
        transforms: Array = self.mechanism.formulas.frame_transforms(self.frame_origins, position)
        return transforms

    @property
    def payload_factors(self) -> Array:
        """Return the changes (parameters, 10) of theta by a payload's moments on the last link."""
        factors: Array = self._of_payload('payload_factors')
        return factors

    @property
    def tip_on_link(self) -> tuple[Array, Array]:
        """Return rotation (3, 3) and origin (3) in m of the tip's frame in that of its link."""
        rotation, origin = self._of_payload('tip_on_link')
        return rotation, origin

    def theta_with_payload(self, mass: float, centre: Array, inertia: Array) -> Array:
        """
        Return the base inertial parameters (parameters) with a payload at the tip.

        Parameters
        ----------
        mass
            Mass in kg.
        centre
            Centre of mass (3) in the frame of the tip, m.
        inertia
            Moments of inertia xx, yy, zz, xy, yz, zx (6) about the centre of mass, in the
            directions of the frame of the tip, kg·m².

        Raises
        ------
        InputError
            If the type of robot has no description of payloads.

        """
        rotation, origin = self.tip_on_link
        place = origin + rotation @ centre
        second = rotation @ second_moments(inertia) @ rotation.T + mass * np.outer(place, place)
        moments = [mass, *(mass * place), *second[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]]
        changed: Array = self.theta + self.payload_factors @ moments
        return changed

    def _of_payload(self, function: str) -> Any:
        """Return the result of a formula about the payload."""
        formula = getattr(self.mechanism.formulas, function, None)
        if formula is None:
            raise InputError(
                f'payload: robots of robot.mechanism {self.mechanism.name} have no {function}; '
                'expected a payload of 0 kg'
            )
        return formula(self.geometry)

    @property
    def height(self) -> float:
        """Height of the first point above the ground in m: that of its frame."""
        heights = {ODOM_FRAME: 0.0}
        origins = self.frame_origins[:, 2].tolist()
        for (parent, child), height in zip(self.mechanism.frames, origins, strict=True):
            heights[child] = heights[parent] + height
        return heights[self.mechanism.point_frame or child]


def robot_of(values: Values) -> Robot:
    """Return the robot of a node's checked values; raise InputError for an invalid robot."""
    return robot_with(mechanism_from(values), values)


def robot_with(mechanism: Mechanism, values: Values) -> Robot:
    """Return the robot of a known type; see `robot_of`."""
    own = {short: values[name] for name, short in _names(mechanism)}
    check(mechanism, own)
    lengths, theta = mechanism.formulas.constants(own)
    return Robot(mechanism, own, np.array(lengths), np.array(theta))


@lru_cache(maxsize=16)
def _names(mechanism: Mechanism) -> tuple[tuple[str, str], ...]:
    """Return the parameters of a robot, and the same without `robot.`."""
    names = (parameter.name for parameter in mechanism.parameters)
    return tuple((name, name.removeprefix('robot.')) for name in names)


def robot_description(values: Values, frame_prefix: str = '') -> str:
    """
    Return the URDF of the robot of a node's checked values.

    `frame_prefix` precedes the name of every link, so links and frames have equal names. Raises
    InputError for an invalid robot.
    """
    driven = driven_joint_names(values)
    urdf: str = mechanism_from(values).formulas.description(values, driven, frame_prefix)
    return urdf


@kernel
def _task_positions(body: Records, position: Array) -> Array:
    robot = lane_of(body[0], 0)
    template = robot.position
    model = formulas.model_of(robot)
    out = np.empty((len(position), len(robot.error)))
    place = mark(robot)
    for k in range(len(position)):
        free(robot, place)
        at = to_vector(position[k], template)
        x = formulas.task_position(model, formulas.posture(model, at), at)
        for i in range(len(x)):
            out[k, i] = x[i]
    check_workspace(robot)
    return out


@kernel
def _task_errors(body: Records, position: Array, desired: Array) -> Array:
    robot = lane_of(body[0], 0)
    model = formulas.model_of(robot)
    out = np.empty((len(position), len(robot.error)))
    place = mark(robot)
    for k in range(len(position)):
        free(robot, place)
        at, aim = to_vector(position[k], robot.position), to_vector(desired[k], robot.error)
        e = formulas.task_error(model, formulas.posture(model, at), at, aim)
        for i in range(len(e)):
            out[k, i] = e[i]
    check_workspace(robot)
    return out
