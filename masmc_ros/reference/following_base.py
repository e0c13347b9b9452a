# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path of the base that follows a path of the end effector, for paths that leave it out.

The point of the base that carries the arm is pulled by the end effector as a trailer on a rope: it
rests while the end effector is at a comfortable distance, and otherwise moves along the straight
line between them. This curve is the tractrix. Therefore the base drives forwards towards the end
effector, and the arm stays clear of its stretched and folded postures. If the end effector comes
too close, the point retreats, and a base that cannot drive sideways turns round first. From a
start at another distance it moves to a comfortable one on the way.

The axes of the base in the task are those of this point, or follow from it and from the direction
of the end effector: `base_axes` of the mechanism, for the heading of a tree.

The path of these axes has minimum jerk (`minimum_jerk.py`) and passes the curve at knots, so
corners are rounded; it starts and ends at rest.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots
from masmc_ros.robot.robot import Robot
import numpy as np

_SPACING = 0.8
"""Largest time in s between two knots of the base, over which a corner of the curve is rounded."""

_SHORTEST = 0.05
"""Smallest time in s between two knots."""

_STEP = 0.25
"""Largest way of the end effector between two knots, relative to the comfortable distance."""

_PARTS = 16
"""Steps of the curve between two knots."""

_SAME = 1e-3
"""Time in s between two knots below which they are one, since short pieces amplify rounding.

The pieces of the base on both sides of a knot differ in the fifth derivative only.
"""

_DIRECTION = 0.01
"""Way in m of the end effector that determines the direction in which it starts."""


def follow_tip(
    robot: Robot, times: Array, knots: Array, start: Array | None = None
) -> tuple[Array, Array]:
    """
    Return times (m) and knots (m, 3 axes) of a path to which that of the base is added.

    Parameters
    ----------
    robot
        Robot with a carrier.
    times
        Times (n) in s of the path, ascending.
    knots
        Knots (n, 3 axes) of the path with derivatives; those of the carrier are ignored.
    start
        Task coordinates (axes) at the start; None for a place behind the end effector.

    """
    axes = knots.shape[1] // 3
    mechanism = robot.mechanism
    assert mechanism.carrier is not None
    own = mechanism.carrier.axes
    size = mechanism.carrier.size
    first, last = times[0], times[-1]
    if first == last:
        held = knots.copy()
        held[:, own] = _base_axes(robot, knots[:, :axes], start)
        return times, held
    tip = mechanism.places[0].plane
    way = sample_knots(times, knots, _between(times))[:, tip]
    count = _count(way, last - first, _comfortable(robot)[1])
    coarse = np.linspace(first, last, 1 + count)
    path = sample_knots(times, knots, np.linspace(first, last, 1 + _PARTS * count))[:, :axes]
    curve = _base_axes(robot, path, start)
    base = np.hstack([curve[::_PARTS], np.zeros((len(coarse), 2 * size))])
    smooth_knots(coarse, base)
    # With the knots of both, every piece remains the polynomial that it is.
    near = np.clip(np.searchsorted(times, coarse), 1, len(times) - 1)
    gaps = np.minimum(np.abs(times[near - 1] - coarse), np.abs(times[near] - coarse))
    union = np.sort(np.concatenate([times, coarse[gaps > _SAME]]))
    whole = sample_knots(times, knots, union)
    whole[np.searchsorted(union, times)] = knots
    samples = sample_knots(coarse, base, union)
    for order in range(3):
        whole[:, order * axes + own.start:order * axes + own.stop] = (
            samples[:, order * size:(order + 1) * size]
        )
    return union, whole


class KnotPath:
    """Type of trajectory through knots that may lack the axes of the carrier."""

    _times: Array
    """Times (n) in s."""
    _knots: Array
    """Knots (n, 3 axes) with derivatives."""
    _lacks_base: bool

    def complete(self, robot: Robot) -> str:
        """Add the path of the base if the knots lack it, and return a sentence on it."""
        if not self._lacks_base:
            return ''
        self._times, self._knots = follow_tip(robot, self._times, self._knots)
        return _note(robot, self._knots)


def _note(robot: Robot, knots: Array) -> str:
    mechanism = robot.mechanism
    assert mechanism.carrier is not None
    axes = mechanism.axes[mechanism.carrier.axes]
    names = ', '.join(axis.name for axis in axes)
    at = zip(knots[0, mechanism.carrier.axes], axes, strict=True)
    start = ', '.join(f'{round(value, 6) + 0.0:.4g} {axis.unit}' for value, axis in at)
    return (
        f'the path lacks {names}, so the base follows the {mechanism.places[0].name} within its '
        f'comfortable reach; it starts at {start}'
    )


def _comfortable(robot: Robot) -> tuple[float, float]:
    """Return the least and largest comfortable distance in m."""
    reach: tuple[float, float] = robot.mechanism.formulas.comfortable_reach(robot.geometry)
    return reach


def _between(times: Array) -> Array:
    """Return five times in each piece, whose ends include all knots."""
    parts = np.linspace(0.0, 1.0, 5)[:-1]
    inner = times[:-1, None] + np.diff(times)[:, None] * parts
    return np.append(inner.ravel(), times[-1])


def _count(way: Array, duration: float, most: float) -> int:
    """Return the number of pieces of the base's path for a way (n, 2) of the end effector."""
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    pieces = max(duration / _SPACING, length / (_STEP * most))
    return max(1, math.ceil(min(pieces, duration / _SHORTEST)))


def _base_axes(robot: Robot, path: Array, before: Array | None) -> Array:
    """
    Return the axes (n, size) of the base for a path (n, axes) in task coordinates.

    `before` (axes) are those at the start of the motion.
    """
    mechanism = robot.mechanism
    assert mechanism.carrier is not None
    axes_of = getattr(mechanism.formulas, 'base_axes', None)
    if axes_of is not None:
        axes: Array = axes_of(path, before, _trailed)
        return axes
    start = None if before is None else before[mechanism.carrier.plane]
    return _trailed(path[:, mechanism.places[0].plane], start, *_comfortable(robot))


def _trailed(path: Array, start: Array | None, least: float, most: float) -> Array:
    """
    Return the positions (n, 2) of a point that follows a path (n, 2).

    `least` and `most` are its distances in m. Without a start (2) it starts behind the path.
    """
    if start is None:
        start = path[0] - 0.5 * (least + most) * _direction(path)
    positions: Array = _tractrix(np.ascontiguousarray(path), start, least, most)
    return positions


def _direction(path: Array) -> Array:
    """Return the unit vector (2) in which a path (n, 2) starts."""
    away = path - path[0]
    distance = np.linalg.norm(away, axis=1)
    is_far = distance > min(_DIRECTION, 0.5 * distance.max())
    way = away[np.argmax(is_far)] if is_far.any() else np.array([1.0, 0.0])
    direction: Array = way / np.linalg.norm(way)
    return direction


@kernel
def _tractrix(path: Array, start: Array, least: float, most: float) -> Array:
    """
    Return the positions (n, 2) of a point that a path (n, 2) pulls, or pushes, from a start.

    A start at another distance is allowed: the limit becomes that of the rest by the end.
    """
    out = np.empty((len(path), 2))
    x, y = start[0], start[1]
    along, across = path[0, 0] - x, path[0, 1] - y
    first = math.sqrt(along * along + across * across)
    closer, farther = min(first - least, 0.0), max(first - most, 0.0)
    for k in range(len(path)):
        left = 1.0 - k / max(len(path) - 1, 1)
        along, across = path[k, 0] - x, path[k, 1] - y
        distance = math.sqrt(along * along + across * across)
        nearest = min(max(distance, least + left * closer), most + left * farther)
        if distance > 0.0:
            part = (distance - nearest) / distance
            x += part * along
            y += part * across
        else:
            x -= nearest
        out[k, 0], out[k, 1] = x, y
    return out
