# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Constant model of a tree, as one vector of numbers.

Records store it as the lengths of a mechanism, because the compiler takes long for each separate
array.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.jit.arrays import read_along
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.robot.tree.spatial import ROTATION, Rotation, VECTOR, Vector
import numpy as np
from numpy.typing import ArrayLike, NDArray

REVOLUTE, PRISMATIC = 0, 1
"""Kinds of joints; a continuous one is revolute without limits."""

FIXED, DIFFERENTIAL, OMNIDIRECTIONAL = 0, 2, 3
"""Types of bases; each value is the number of base velocities."""

MOST_COORDINATES = 48
"""Largest number of positions of a robot, and of axes of its task."""


class Tree(NamedTuple):
    """Bodies; 0 is the base, and every other one comes after its parent."""

    base: int
    """Kind of the base."""
    parent: NDArray[np.int64]
    """(B) number of the parent body; that of the base is not read."""
    kind: NDArray[np.int64]
    """(B) kind of each body's joint."""
    axis: NDArray[np.float64]
    """(B, 3) unit axis in the body's frame."""
    rotation: NDArray[np.float64]
    """(B, 9) of each body's frame in its parent's, with the controlled joint at zero."""
    offset: NDArray[np.float64]
    """(B, 3) of each body's origin in its parent's frame, likewise, in m."""
    armature: NDArray[np.float64]
    """(n, n) constant inertia of rotors and wheels in velocities nu, in kg, kg·m and kg·m²."""
    driver: NDArray[np.int64]
    """
    (B) index of the controlled joint that moves each body; that of the base is not read. The
    controlled joints have the order of their bodies.
    """
    multiplier: NDArray[np.float64]
    """(B) rate of each body's joint per rate of that controlled joint, 1 unless it mimics it."""


class TreeModel(NamedTuple):
    """Tree, its wheels, and its task."""

    numbers: Array
    """Result of `packed`."""
    axes: tuple[float, ...] = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    """Places of the task's axes among the coordinates of `task.py`, for their number."""


DAMPED_TIME = 0.5
"""Inverse of the speed in rad/s or m/s above which a robot with speed limits is damped."""

AXIS_COUNT, AXES = 9, 10
"""Places of the number of task axes and of their indices."""

_BODY = 37
_FRAME = 13


def packed(
    tree: Tree,
    wheel_rates: ArrayLike,
    frames: Sequence[tuple[int, Sequence[float], Sequence[float]]],
    axes: Sequence[int],
    mobility: ArrayLike,
    posture: ArrayLike,
    limits: tuple[ArrayLike, ArrayLike, ArrayLike],
    posture_gain: float,
    damping: float,
    least_pivot: float,
    speed_limits: ArrayLike | None = None,
    drift_rate: float = 0.0,
) -> NDArray[np.float64]:
    """
    Return the numbers of a `TreeModel`.

    Parameters
    ----------
    tree
        bodies and joints, n velocities in all.
    wheel_rates
        (m, m) rates of the wheels from those of the base, m = 0, 2 or 3 by its kind.
    frames : sequence
        of the task: body of each, and the frame's rotation and offset in m in the body's.
    axes : sequence
        of the task: places among the coordinates of `task.py`.
    mobility
        Share (n) of each velocity in the task: inverse weights.
    posture
        Preferred positions (n) in the null space of the task, in rad or m.
    limits
        Lower and upper ends (n) of the joint positions in rad or m, and the margins before them in
        which the motion for the task fades to zero; a margin of 0 disables the ends.
    posture_gain
        Rate of the motion to the preferred positions, in 1/s.
    damping
        Rate kappa in 1/s of velocities in the null space towards their reference.
    least_pivot
        Pivot of J W^-1 J' below which the task is singular and its inverse damped.
    speed_limits
        Largest speeds (n) of wheels and joints in v_r, in rad/s or m/s; infinite without a limit,
        None if there are no limits.
    drift_rate
        Rate of the drift estimate in 1/s; 0 disables it.

    Returns
    -------
        Vector of all numbers.

    """
    wheels = np.asarray(wheel_rates, dtype=np.float64).reshape(tree.base, tree.base)
    speeds = np.full(len(tree.armature), np.inf)
    speeds[:] = np.inf if speed_limits is None else speed_limits
    axes_above, *turned = _turned(tree)
    bodies = np.column_stack([
        tree.parent, tree.kind, tree.base + tree.driver, tree.multiplier,
        tree.multiplier[:, None] * axes_above, *turned, tree.offset,
    ])  # fmt: skip
    parts: tuple[ArrayLike, ...] = (
        (len(tree.parent), tree.base, len(frames), posture_gain, damping, least_pivot,
         drift_rate, DAMPED_TIME if np.isfinite(speeds).any() else 0.0, len(speeds), len(axes)),
        axes, bodies, mobility, posture, wheels,
        np.linalg.inv(wheels) if len(wheels) else wheels, tree.armature, *limits,
        1.0 / speeds,
        *(part for frame in frames for part in frame),
    )  # fmt: skip
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


def _turned(tree: Tree) -> tuple[NDArray[np.float64], ...]:
    """
    Return each joint's axis in the parent's frame, and matrices of its body's rotation.

    By Rodrigues the rotation is one of them, and another times the joint angle's cosine, and a
    third times its sine; with no angle, the sum of the first two.
    """
    rotation = tree.rotation.reshape(-1, 3, 3)
    axis = np.zeros_like(tree.axis)
    around, across = np.zeros_like(rotation), np.zeros_like(rotation)
    for i in range(3):
        # Separate operations on entries are bitwise identical on every machine.
        x, y, z = tree.axis.T
        row = rotation[:, i]
        axis[:, i] = row[:, 0] * x + row[:, 1] * y + row[:, 2] * z
        around[:, i] = axis[:, i, None] * tree.axis
        across[:, i, 0] = row[:, 1] * z - row[:, 2] * y
        across[:, i, 1] = row[:, 2] * x - row[:, 0] * z
        across[:, i, 2] = row[:, 0] * y - row[:, 1] * x
    count = len(rotation)
    return (
        axis,
        around.reshape(count, 9),
        (rotation - around).reshape(count, 9),
        across.reshape(count, 9),
    )


@formula
def axis_of(model: TreeModel, i: int) -> int:
    """Return the index of one task axis; for loops, in which tuples are slow."""
    return int(model.numbers[AXES + i])


@formula
def bodies_of(model: TreeModel) -> int:
    """Return the number of bodies, including the base."""
    return int(model.numbers[0])


@formula
def base_of(model: TreeModel) -> int:
    """Return the type of the base, which is the number of its velocities."""
    return int(model.numbers[1])


@formula
def velocities_of(model: TreeModel) -> int:
    """Return the number of velocities nu."""
    return int(model.numbers[8])


@formula
def is_coupled(model: TreeModel) -> bool:
    """Return True if joints mimic others, so that a velocity moves several bodies."""
    return velocities_of(model) < base_of(model) + bodies_of(model) - 1


@formula
def frames_of(model: TreeModel) -> int:
    """Return the number of frames in the task."""
    return int(model.numbers[2])


@formula
def posture_gain_of(model: TreeModel) -> float:
    """Return the rate of joints to their preferred positions, in 1/s."""
    return model.numbers[3]


@formula
def damping_of(model: TreeModel) -> float:
    """Return kappa in 1/s."""
    return model.numbers[4]


@formula
def least_pivot_of(model: TreeModel) -> float:
    """Return the pivot below which the task is singular."""
    return model.numbers[5]


@formula
def drift_rate_of(model: TreeModel) -> float:
    """Return the rate of the drift estimate in 1/s; 0 without one."""
    return model.numbers[6]


@formula
def damped_time_of(model: TreeModel) -> float:
    """Return the inverse of the speed above which the task is damped; 0 without limits."""
    return model.numbers[7]


@formula
def _body_start(model: TreeModel, body: int) -> int:
    return AXES + len(model.axes) + _BODY * body


@formula
def parent_of(model: TreeModel, body: int) -> int:
    """Return the number of the parent of a body."""
    return int(model.numbers[_body_start(model, body)])


@formula
def velocity_of(model: TreeModel, body: int) -> int:
    """Return the index of the velocity that moves a body, other than the base, in its parent."""
    return int(model.numbers[_body_start(model, body) + 2])


@formula
def multiplier_of(model: TreeModel, body: int) -> float:
    """Return the rate of a body's joint per rate of the controlled joint that moves it."""
    return model.numbers[_body_start(model, body) + 3]


@formula
def joint_of(model: TreeModel, body: int) -> tuple[bool, Vector, Vector]:
    """
    Return True for a body's revolute joint, its axis, and the body's origin in its parent.

    The axis has the length of the multiplier.
    """
    numbers = model.numbers
    first = _body_start(model, body)
    axis: Vector = read_along(numbers, first + 4, VECTOR)
    offset: Vector = read_along(numbers, first + 34, VECTOR)
    return numbers[first + 1] == REVOLUTE, axis, offset


@formula
def rotation_of_joint(model: TreeModel, body: int, sine: float, cosine: float) -> Rotation:
    """Return a body's rotation in its parent's frame, of sine and cosine of the joint's angle."""
    numbers = model.numbers
    first = _body_start(model, body) + 7
    around: Rotation = read_along(numbers, first, ROTATION)
    along: Rotation = read_along(numbers, first + 9, ROTATION)
    across: Rotation = read_along(numbers, first + 18, ROTATION)
    return elementwise(_turned_entry, around, along, across, sine, cosine)


@formula
def _turned_entry(
    around: float, along: float, across: float, sine: float, cosine: float
) -> float:
    return around + cosine * along + sine * across


@formula
def _after_bodies(model: TreeModel) -> tuple[int, int, int]:
    """Return the start of the mobility, the number of velocities, and that of the base's."""
    return _body_start(model, bodies_of(model)), velocities_of(model), base_of(model)


@formula
def mobility_begins(model: TreeModel) -> int:
    """Return the start, in the numbers, of the mobility (n) of the velocities for the task."""
    first, _, _ = _after_bodies(model)
    return first


@formula
def rest_of(model: TreeModel, k: int) -> float:
    """Return the preferred position of a joint, in rad or m."""
    first, size, _ = _after_bodies(model)
    return model.numbers[first + size + k]


@formula
def wheel_rates_begin(model: TreeModel) -> int:
    """Return the start of the map (m, m) from base velocities to wheel rates."""
    first, size, _ = _after_bodies(model)
    return first + 2 * size


@formula
def base_rates_begin(model: TreeModel) -> int:
    """Return the start of its inverse."""
    first, size, base = _after_bodies(model)
    return first + 2 * size + base * base


@formula
def limits_of(model: TreeModel, k: int) -> tuple[float, float, float]:
    """Return the ends of a joint's position, and the margin before them: 0 without limits."""
    first, size, base = _after_bodies(model)
    numbers = model.numbers
    at = first + 2 * (size + base * base) + size * size + k
    return numbers[at], numbers[at + size], numbers[at + 2 * size]


@formula
def inverse_speeds_begin(model: TreeModel) -> int:
    """Return the start of the inverse speed limits (n) of wheels and joints."""
    first, size, base = _after_bodies(model)
    return first + 2 * (size + base * base) + size * size + 3 * size


@formula
def frame_of(model: TreeModel, frame: int) -> tuple[int, Rotation, Vector]:
    """Return the body of a task frame, and the pose of the frame on it."""
    first, size, base = _after_bodies(model)
    numbers = model.numbers
    at = first + 2 * (size + base * base) + size * size + 4 * size + _FRAME * frame
    rotation: Rotation = read_along(numbers, at + 1, ROTATION)
    offset: Vector = read_along(numbers, at + 10, VECTOR)
    return int(numbers[at]), rotation, offset


@formula
def rotors_begin(model: TreeModel) -> int:
    """Return the start, in the numbers, of the constant inertia (n, n) of rotors and wheels."""
    first, size, base = _after_bodies(model)
    return first + 2 * (size + base * base)
