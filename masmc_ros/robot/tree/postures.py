# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Kinematics and gravity of many postures of a tree, in NumPy.

Commands use it to describe a robot and to choose its start, without compiled code. Postures are
positions (m, n) of the controlled joints in rad or m; all vectors are in the frame of the base.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.robot.tree.assembly import TreeRobot
from masmc_ros.robot.tree.dynamics import GRAVITY
from masmc_ros.robot.tree.link_inertia import Frame
from masmc_ros.robot.tree.tree_model import DIFFERENTIAL, FIXED, PRISMATIC
import numpy as np

_SWEEPS = 4
"""Sweeps over all joints of the search for largest values."""

_SAMPLES = 17
"""Positions of a joint with mimic joints in the search."""

_OTHERS = 3
"""Further postures from which the search starts."""

_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)


class Placed(NamedTuple):
    """Bodies of m postures in the frame of the base."""

    rotation: Array
    """(m, B, 3, 3)."""
    origin: Array
    """(m, B, 3) in m."""
    axis: Array
    """(m, B, 3) of the joint of each body; zero for the base."""


def placed(robot: TreeRobot, positions: Array) -> Placed:
    """Return the bodies at positions (m, n)."""
    tree, count = robot.tree, len(positions)
    bodies = len(tree.parent)
    rotation = np.zeros((count, bodies, 3, 3))
    rotation[:, 0] = np.eye(3)
    origin, axes = np.zeros((count, bodies, 3)), np.zeros((count, bodies, 3))
    for body in range(1, bodies):
        above = rotation[:, tree.parent[body]]
        at = tree.multiplier[body] * positions[:, tree.driver[body]]
        axis = tree.axis[body]
        own = above @ tree.rotation[body].reshape(3, 3)
        axes[:, body] = own @ axis
        origin[:, body] = origin[:, tree.parent[body]] + above @ tree.offset[body]
        if tree.kind[body] == PRISMATIC:
            origin[:, body] += at[:, None] * axes[:, body]
            rotation[:, body] = own
        else:
            x, y, z = axis
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            s, c = np.sin(at)[:, None, None], np.cos(at)[:, None, None]
            rotation[:, body] = own @ (np.eye(3) + s * cross + (1.0 - c) * (cross @ cross))
    return Placed(rotation, origin, axes)


def frame_of(bodies: Placed, frame: Frame) -> tuple[Array, Array]:
    """Return rotations (m, 3, 3) and origins (m, 3) in m of a frame."""
    rotation = bodies.rotation[:, frame.body]
    own = np.reshape(frame.rotation, (3, 3))
    return rotation @ own, bodies.origin[:, frame.body] + rotation @ np.array(frame.offset)


def jacobian(robot: TreeRobot, bodies: Placed, frame: Frame) -> Array:
    """Return the Jacobian (m, 6, velocities) of a frame: velocity, then angular velocity."""
    tree = robot.tree
    _, tip = frame_of(bodies, frame)
    out = np.zeros((len(tip), 6, len(tree.armature)))
    if tree.base != FIXED:
        out[:, 0, 0] = 1.0
        out[:, 0, tree.base - 1], out[:, 1, tree.base - 1] = -tip[:, 1], tip[:, 0]
        out[:, 5, tree.base - 1] = 1.0
        if tree.base != DIFFERENTIAL:
            out[:, 1, 1] = 1.0
    body = frame.body
    while body > 0:
        axis = tree.multiplier[body] * bodies.axis[:, body]
        k = tree.base + tree.driver[body]
        if tree.kind[body] == PRISMATIC:
            out[:, :3, k] += axis
        else:
            out[:, :3, k] += np.cross(axis, tip - bodies.origin[:, body])
            out[:, 3:, k] += axis
        body = int(tree.parent[body])
    return out


def task_jacobian(
    robot: TreeRobot, bodies: Placed, frames: Sequence[Frame], places: Sequence[int]
) -> Array:
    """
    Return the Jacobian (m, axes, velocities) of a task.

    Parameters
    ----------
    robot, bodies
        Robot and its bodies.
    frames, places
        Frames of the task, and indices of its axes among the coordinates of all frames and then of
        the joints.

    """
    base, size = robot.tree.base, len(robot.tree.armature)
    joints = np.broadcast_to(np.eye(size)[base:], (len(bodies.origin), size - base, size))
    rows = [jacobian(robot, bodies, frame) for frame in frames]
    return np.concatenate([*rows, joints], axis=1)[:, list(places)]


def least_pivot(columns: Array, mobility: Array) -> Array:
    """
    Return the smallest pivot (m) of J W^-1 J', the measure of singularity of the laws.

    Parameters
    ----------
    columns
        J (m, axes, velocities).
    mobility
        W^-1 (m, velocities).

    """
    matrix = np.einsum('mik,mk,mjk->mij', columns, mobility, columns)
    least = np.full(len(matrix), np.inf)
    for i in range(matrix.shape[1]):
        pivot = matrix[:, i, i]
        least = np.minimum(least, pivot)
        row = matrix[:, i, i + 1:] / np.where(pivot > 0.0, pivot, np.inf)[:, None]
        matrix[:, i + 1:, i + 1:] -= row[:, :, None] * matrix[:, i, None, i + 1:]
    return least


def gravity_torques(robot: TreeRobot, bodies: Placed) -> Array:
    """Return the torques and forces (m, n) of the joints that hold the robot against gravity."""
    tree = robot.tree
    mass = robot.inertial_parameters[:, 0].copy()
    centre = robot.inertial_parameters[:, 1:4]
    # First moments about the origin of the base, of each body with all bodies that it carries.
    moment = np.einsum('mbij,bj->mbi', bodies.rotation, centre) + mass[:, None] * bodies.origin
    for body in range(len(mass) - 1, 0, -1):
        mass[tree.parent[body]] += mass[body]
        moment[:, tree.parent[body]] += moment[:, body]
    arm = moment - mass[:, None] * bodies.origin
    up = np.array([0.0, 0.0, GRAVITY])
    turning = np.einsum('mbi,mbi->mb', bodies.axis, np.cross(arm, up))
    along = mass * GRAVITY * bodies.axis[:, :, 2]
    own = np.where(tree.kind == PRISMATIC, along, turning) * tree.multiplier
    torques = np.zeros((len(own), len(robot.joints)))
    for body in range(1, len(mass)):
        torques[:, tree.driver[body]] += own[:, body]
    return torques


def spread(count: int, size: int) -> Array:
    """Return points (count, size) of the unit cube by the sequence of Halton."""
    points = np.zeros((count, size))
    for k in range(size):
        prime = _PRIMES[k % len(_PRIMES)]
        for i in range(count):
            # Joints beyond the primes have the points in another order.
            number, share = i + 1 + k // len(_PRIMES), 1.0
            while number:
                share /= prime
                points[i, k] += share * (number % prime)
                number //= prime
    return points


def largest(
    robot: TreeRobot,
    objectives: Callable[[Placed], Array],
    count: int,
    starts: Array,
) -> Array:
    """
    Return the largest values of functions over the ranges of the joints.

    Along a revolute joint the functions are a sine, along a prismatic one they are largest at an
    end; along a joint with mimic joints they are sampled. The search is a coordinate ascent from
    several postures.

    Parameters
    ----------
    robot
        Robot with its limits; prismatic joints without limits stay.
    objectives
        Function that returns the values (m, count).
    count
        Number of functions.
    starts
        Postures (s, n).

    """
    lower, upper = arm_limits(robot)
    postures = np.repeat(starts[None], count, axis=0)
    functions = np.arange(count)[:, None]

    def values(changed: Array) -> Array:
        """Return the value of each function (count, s, options) at its own postures."""
        shape = changed.shape[:-1]
        every = objectives(placed(robot, changed.reshape(-1, changed.shape[-1])))
        own = every.reshape(*shape, count)
        return np.take_along_axis(own, functions[:, :, None, None], axis=3)[..., 0]

    thirds = 2.0 * math.pi / 3.0 * np.arange(3)
    for _ in range(_SWEEPS):
        for k in range(postures.shape[2]):
            ends = np.array([lower[k], upper[k]])
            is_prismatic = robot.joints[k].kind == 'prismatic'
            is_coupled = np.count_nonzero(robot.tree.driver[1:] == k) > 1
            if is_prismatic or is_coupled:
                if not np.isfinite(ends).all():
                    if is_prismatic:
                        continue
                    ends = np.array([-math.pi, math.pi])
                points = np.linspace(ends[0], ends[1], _SAMPLES if is_coupled else 2)
                options = np.broadcast_to(points, (*postures.shape[:2], len(points)))
                changed = np.repeat(postures[:, :, None], len(points), axis=2)
                changed[..., k] = options
                value = values(changed)
            else:
                changed = np.repeat(postures[:, :, None], 3, axis=2)
                changed[..., k] = thirds
                sample = values(changed)
                mean = sample.mean(axis=2, keepdims=True)
                cosine = 2.0 / 3.0 * (sample * np.cos(thirds)).sum(axis=2, keepdims=True)
                sine = 2.0 / 3.0 * (sample * np.sin(thirds)).sum(axis=2, keepdims=True)
                top = np.arctan2(sine, cosine)
                options = np.concatenate([top, top + math.pi], axis=2)
                if np.isfinite(ends).all():
                    turned = lower[k] + (options - lower[k]) % (2.0 * math.pi)
                    inside = np.where(turned <= upper[k], turned, lower[k])
                    both = np.broadcast_to(ends, (*top.shape[:2], 2))
                    options = np.concatenate([inside, both], axis=2)
                value = mean + cosine * np.cos(options) + sine * np.sin(options)
            best = np.abs(value).argmax(axis=2)[..., None]
            postures[..., k] = np.take_along_axis(options, best, axis=2)[..., 0]
    values_at_best: Array = np.abs(values(postures[:, :, None])).max(axis=(1, 2))
    return values_at_best


def largest_gravity_torques(robot: TreeRobot, start: Array) -> Array:
    """
    Return the largest gravity torques and forces (n) that a search over the ranges finds.

    `start` (n) is one of the postures from which the search starts.
    """
    count = len(robot.joints)
    return largest(
        robot, lambda bodies: gravity_torques(robot, bodies), count, _search_starts(robot, start)
    )


def reach(robot: TreeRobot, link: str, start: Array) -> float:
    """Return the largest distance in m of a link from the first joint on the way to it."""
    frame = robot.frames[link]
    first = frame.body
    if first == 0:
        return 0.0
    while robot.tree.parent[first] > 0:
        first = int(robot.tree.parent[first])

    def squares(bodies: Placed) -> Array:
        _, origin = frame_of(bodies, frame)
        sums: Array = ((origin - bodies.origin[:, first])**2).sum(axis=1)[:, None]
        return sums

    return float(np.sqrt(largest(robot, squares, 1, _search_starts(robot, start))[0]))


def _search_starts(robot: TreeRobot, start: Array) -> Array:
    """Return postures from which a search over the ranges starts."""
    lower, upper = arm_limits(robot)
    is_bounded = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(is_bounded, lower, -math.pi), np.where(is_bounded, upper, math.pi)
    others = low + (high - low) * spread(_OTHERS, len(low))
    return np.vstack([start, np.where(is_bounded, 0.5 * (low + high), 0.0), others])


def arm_limits(robot: TreeRobot) -> tuple[Array, Array]:
    """Return the lower and upper ends (n) of the ranges of the controlled joints."""
    first = len(robot.limits.lower) - len(robot.joints)
    return robot.limits.lower[first:], robot.limits.upper[first:]
