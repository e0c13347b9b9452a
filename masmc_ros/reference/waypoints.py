# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path through points at certain times, from rest to rest, with or without stops at the points.

Without stops, the path has minimum jerk: the smallest integral of the squared third derivative of
all paths through the points at their times that start and end at rest. The source is Todorov and
Jordan 1998, "Smoothness maximization along a predefined path accurately predicts the speed
profiles of complex arm movements". The path is a spline of degree five whose derivatives are
continuous up to the fourth. With stops, it consists of straight lines, each with minimum jerk
(Flash and Hogan 1985).
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.reference.following_base import KnotPath
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots
from masmc_ros.reference.reference import Declared
from masmc_ros.reference.rotations import continued_vectors, orientation_of
from masmc_ros.robot.declaration import Mechanism
import numpy as np

_QUATERNIONS = Parameter(
    'waypoints.quaternions', (),
    'Orientations at the points as x, y, z, w. The points have no rotation vectors then; empty: '
    'rotation vectors in the points', kind='doubles',
)  # fmt: skip


_BASE_FOLLOWS = 'base_follows'


def _parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    units = ', '.join(dict.fromkeys(axis.unit for axis in mechanism.axes))
    quaternions = () if orientation_of(mechanism) is None else (_QUATERNIONS,)
    base_follows = () if mechanism.carrier is None else (
        Parameter(
            f'waypoints.{_BASE_FOLLOWS}', False,
            'The points have the coordinates of the end effector only, and the base follows it',
        ),
    )  # fmt: skip
    return (
        Parameter(
            'waypoints.times', (0.0,), 'Times at which the path passes the points, ascending',
            unit='s', minimum=0.0,
        ),
        Parameter(
            'waypoints.points', mechanism.default('line_sine.offset', 'axes'),
            'Coordinates of the points, one point after the other, with a number for each task '
            'axis', unit=units,
        ),
        *quaternions,
        *base_follows,
        Parameter(
            'waypoints.stops', False,
            'Stop at each point and connect the points by straight lines',
        ),
    )  # fmt: skip


class Waypoints(KnotPath):
    """Motion that holds the first point until its time, passes the others, and holds the last."""

    parameters: ClassVar[Declared] = staticmethod(_parameters)

    def __init__(self, values: Values) -> None:
        """Initialise from checked values without the type's prefix; each time has a point."""
        self._times = np.array(values['times'], dtype=np.float64)
        points = np.array(values['points'], dtype=np.float64).reshape(len(self._times), -1)
        self._knots = np.hstack([points, np.zeros((len(points), 2 * points.shape[1]))])
        if not values['stops']:
            smooth_knots(self._times, self._knots)
        self._lacks_base: bool = values.get(_BASE_FOLLOWS, False)

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> Waypoints:
        """Return the path; raise InputError if times and points do not match the task."""
        times, axes = values['times'], mechanism.axes
        quaternions = values.get('quaternions', ())
        rotation = orientation_of(mechanism) if quaternions else None
        base = mechanism.carrier if values.get(_BASE_FOLLOWS, False) else None
        kept = np.ones(len(axes), dtype=np.bool_)
        for point in filter(None, (rotation, base)):
            kept[point.axes] = False
        own = [axis.name for axis, is_kept in zip(axes, kept, strict=True) if is_kept]
        if not times:
            raise InputError('waypoints.times = []: expected a time for each point')
        for before, time in pairwise(times):
            if not before < time:
                raise InputError(
                    f'waypoints.times: {yaml_text(time)} follows {yaml_text(before)}; expected '
                    'times that ascend'
                )
        count, expected = len(values['points']), len(times) * len(own)
        if count != expected:
            raise InputError(
                f'waypoints.points: {count} numbers; expected {expected}, for each of '
                f'{len(times)} times one of {", ".join(own)}'
            )
        if rotation is None and base is None:
            return cls(values)
        # The axes of the base are added later.
        points = np.zeros((len(times), len(axes)))
        points[:, kept] = np.reshape(values['points'], (len(times), -1))
        if rotation is not None:
            if len(quaternions) != 4 * len(times):
                raise InputError(
                    f'waypoints.quaternions: {len(quaternions)} numbers; expected '
                    f'{4 * len(times)}, x, y, z, w for each of {len(times)} times'
                )
            start = np.array(mechanism.default('line_sine.offset', 'axes')[rotation.axes])
            numbers = np.array(quaternions, dtype=np.float64).reshape(len(times), -1)
            points[:, rotation.axes] = continued_vectors(numbers, start, 'waypoint')
        return cls({**values, 'points': points})

    def sample(self, times: Array) -> Array:
        """Return (n, 3 axes) samples at times (n) in s."""
        return sample_knots(self._times, self._knots, times)
