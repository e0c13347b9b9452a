# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tracking of a run: task positions and tracking error (13) over time, and its settling time."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.robot.declaration import Point
import numpy as np

SMALL = 1.0e3
"""Factor of errors in mm and mrad, and of slip in mm/s, for tables and plots."""


@dataclass(frozen=True)
class Tracking:
    """
    Task coordinates are those of the robot's axes, m; times in s from the first state.

    Attributes
    ----------
    times
        (K) of the errors.
    error
        (K, axes) e = x - x_d; K = 0 if the log lacks it.
    actual
        (N, axes) x at every state; None if the log lacks it.
    desired
        (N, axes) x_d at every state, NaN without a reference; None if the log lacks it.

    """

    times: Array
    error: Array
    actual: Array | None
    desired: Array | None

    def small_errors(self, point: Point) -> Array:
        """Return the errors (K, m) of a point in mm or mrad."""
        return self.error[:, point.axes] * SMALL


class Compared(NamedTuple):
    """One run of a comparison."""

    label: str
    run: Run
    tracked: Tracking

    def errors(self, point: Point) -> tuple[Array, Array] | None:
        """Return times and errors of a point; None if the robot does not have the point."""
        is_known = point in self.run.mechanism.points
        return (self.tracked.times, self.tracked.small_errors(point)) if is_known else None


def tracking(run: Run) -> Tracking:
    """
    Return the tracking of a run.

    The error is that of the controller if the log has it. Otherwise it is computed from the
    states and the reference, for which the log must contain the parameters of the robot. If only
    the actual or only the desired positions are known, the others follow from the error.
    """
    robot = run_robot(run)
    actual = None if robot is None else robot.task_positions(run.position)
    axes = len(run.mechanism.axes)
    desired = None if run.reference is None else run.reference[:, :axes]
    published = run.telemetry.get('error')
    if published is not None:
        times, error = published.times, published.values
    elif robot is not None and desired is not None:
        known = np.isfinite(desired).all(axis=1)
        times = run.times[known]
        error = robot.task_errors(run.position[known], desired[known])
    else:
        return Tracking(np.zeros(0), np.zeros((0, axes)), actual, desired)
    if actual is None and desired is not None:
        actual = desired + _at(run.times, times, error)
    elif desired is None and actual is not None:
        desired = actual - _at(run.times, times, error)
    return Tracking(times - run.times[0], error, actual, desired)


def _at(wanted: Array, times: Array, values: Array) -> Array:
    """Interpolate linearly; NaN outside the times and without times."""
    if not len(times):
        return np.full((len(wanted), values.shape[1]), np.nan)
    columns = [np.interp(wanted, times, v, left=np.nan, right=np.nan) for v in values.T]
    return np.stack(columns, axis=1)


BAND = 0.02
"""Band around zero as a part of the first error: 2 %, as for a step response."""

FLOOR = 1.0e-3
"""Smallest band in m, for runs that start on their reference."""

STAY = 0.5
"""Part of the time since the last change of parameters for which the error must stay, at its end.

Otherwise an oscillation that happens to be near zero when the log ends would be settled: under
smc the paper's run has such a burst once in ten seconds, the period of its path.
"""

LEAST_STAY = 0.25
"""The same as a part of the whole time, for changes shortly before the end."""


def settling_band(errors: Array) -> float:
    """Return the band in m of errors (n, m) in m, n > 0: BAND of the first, at least FLOOR."""
    return float(np.maximum(BAND * np.linalg.norm(errors[0]), FLOOR))


def settling_time(times: Array, errors: Array, changed: float = -math.inf) -> float | None:
    """
    Return the time after which |e| stays in the band until the log ends.

    The settling time of a step response (Ogata, Modern Control Engineering), with the error in
    place of the distance from the final value.

    Parameters
    ----------
    times
        (n) s, ascending.
    errors
        (n, m) m; NaN is outside the band.
    changed
        time of the last change of parameters, s.

    Returns
    -------
        s from the first error; infinity if it does not settle, or does not stay long enough
        (see STAY, LEAST_STAY); None without errors.

    """
    if not len(errors):
        return None
    outside = np.flatnonzero(~(np.linalg.norm(errors, axis=1) <= settling_band(errors)))
    first = int(outside[-1]) + 1 if len(outside) else 0
    settled = float(times[first]) if first < len(times) else math.inf
    return settled_after(float(times[0]), settled, float(times[-1]), changed)


def settled_after(start: float, settled: float, end: float, changed: float = -math.inf) -> float:
    """
    Return the settling time in s of an error that stays in the band from the time `settled` on.

    `start` and `end` are the times of the first and of the last error; `settled` is infinite if
    the last one is outside of the band.
    """
    stay = max(STAY * (end - max(start, changed)), LEAST_STAY * (end - start))
    return settled - start if end - settled >= stay else math.inf
