# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Fastest timing of a path within the speeds and accelerations of the joints, by toppra.

The joints move along the path as in its preview; only the time at each place changes (Pham and
Pham 2018, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis").
toppra's accelerations step. Polynomials of degree five between the places have larger ones, so the
result is slowed until it keeps the limits.

The path parameter s is the time of the preview. It is a further coordinate of the motion, whose
limits bound the timing where all joints rest.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, remedy
from masmc_ros.reference.joint_path import places_between
from masmc_ros.reference.minimum_jerk import sample_knots
from masmc_ros.report.measure.path_preview import Preview
import numpy as np

_PLACES = 400
"""Largest number of places at which the timing is determined."""

_FASTEST, _QUICKEST = 50.0, 500.0
"""Largest first and second derivative of s, where all joints rest."""

_AT_REST = 2e-3
"""Part of the largest speed below which the joints rest at the start and at the end. toppra has no
solution for longer rests; a motion from rest misses its ends by 1e-6 of its length."""

_UNLIMITED = 1e3
"""Speed in rad/s or m/s that stands for no limit."""


def fastest_samples(seen: Preview, acceleration: float) -> tuple[Array, Array]:
    """
    Return times (n) and samples (n, 3 axes) of the fastest motion along a path.

    Parameters
    ----------
    seen
        Preview of the path from its start on.
    acceleration
        Largest acceleration of all joints in rad/s2 or m/s2.

    Raises
    ------
    InputError
        If the robot does not start on the path at rest, or if no timing keeps the limits.
    UserError
        If toppra is not installed.

    """
    try:
        from toppra import algorithm, constraint, SplineInterpolator
    except ModuleNotFoundError as error:
        raise remedy(error) from None
    if seen.times[0] > 0.0:
        raise InputError(
            'the robot does not start on the path at rest; expected a path from its start, which '
            'masmc robot prints, for a timing'
        )
    speed = np.linalg.norm(seen.velocity, axis=1)
    moving = np.flatnonzero(speed > _AT_REST * speed.max())
    if not len(moving):
        return seen.times[[0, -1]], seen.reference[[0, -1]]
    rows = np.unique(np.linspace(moving[0], moving[-1], _PLACES).round().astype(np.int64))
    s = seen.times[rows]
    moved = np.column_stack([seen.position[rows], s])
    speeds = np.append(np.minimum(seen.mechanism.speed_limits, _UNLIMITED), _FASTEST)
    changes = np.append(np.full(moved.shape[1] - 1, acceleration), _QUICKEST)
    path = SplineInterpolator(s, moved)
    timing = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(np.column_stack([-speeds, speeds])),
            constraint.JointAccelerationConstraint(np.column_stack([-changes, changes])),
        ],
        path,
        gridpoints=s,
    )
    _, rates, _ = timing.compute_parameterization(0.0, 0.0)
    if rates is None or not np.isfinite(rates).all():
        raise InputError(
            f'toppra has no timing of the path within the speeds of the joints and '
            f'{acceleration:g} rad/s² or m/s²; expected a larger acceleration'
        )
    steps = 2.0 * np.diff(s) / (rates[1:] + rates[:-1])
    times = np.append(0.0, np.cumsum(steps))
    # The derivative of the rate steps from place to place; the samples have its means.
    rises = np.diff(rates) / steps
    change = np.zeros(len(s))
    change[1:-1] = 0.5 * (rises[1:] + rises[:-1])
    position, slope, bend = np.split(seen.reference[rows], 3, axis=1)
    joints = _timed(moved, path(s, 1), path(s, 2), rates, change)
    fine = sample_knots(times, joints, places_between(times))
    _, fine_speeds, fine_changes = (np.abs(part).max(axis=0) for part in np.split(fine, 3, axis=1))
    excess = max((fine_speeds / speeds).max(), math.sqrt((fine_changes / changes).max()), 1.0)
    return excess * times, _timed(
        position, slope, bend, rates / excess, change / excess**2
    )


def _timed(
    position: Array, slope: Array, bend: Array, rates: Array, change: Array
) -> Array:
    """
    Return samples (n, 3 k) of a motion along a curve.

    Parameters
    ----------
    position, slope, bend
        Curve (n, k) and its derivatives by s.
    rates, change
        Derivatives (n) of s by the time.

    """
    rate = rates[:, None]
    return np.hstack([position, slope * rate, bend * rate**2 + slope * change[:, None]])
