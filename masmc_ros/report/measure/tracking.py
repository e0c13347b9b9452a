# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tracking of a run: task positions and tracking error (13) over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from masmc_ros.log.read.reader import Run
from masmc_ros.numerics.aliases import Array
from masmc_ros.report.measure.parameters import run_robot
import numpy as np


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
        (N, axes) x_d at every state, NaN where there is none; None likewise.

    """

    times: Array
    error: Array
    actual: Array | None
    desired: Array | None


class Compared(NamedTuple):
    """One run of a comparison."""

    label: str
    run: Run
    tracked: Tracking


def tracking(run: Run) -> Tracking:
    """
    Return the tracking of a run.

    The error is the controller's own where the log has it, and computed from the states and
    the reference where not: for that, the log must tell the robot's parameters. Of actual and
    desired positions, one that is missing follows from the other and the error.
    """
    robot = run_robot(run)
    actual = None if robot is None else robot.task_positions(run.position)
    axes = len(run.mechanism.axes)
    desired = None if run.reference is None else run.reference[:, :axes]
    told = run.telemetry.get('error')
    if told is not None:
        times, error = told.times, told.values
    elif actual is not None and desired is not None:
        known = np.isfinite(desired).all(axis=1)
        times, error = run.times[known], (actual - desired)[known]
    else:
        return Tracking(np.zeros(0), np.zeros((0, axes)), actual, desired)
    if actual is None and desired is not None:
        actual = desired + _at(run.times, times, error)
    elif desired is None and actual is not None:
        desired = actual - _at(run.times, times, error)
    return Tracking(times - run.times[0], error, actual, desired)


def _at(wanted: Array, times: Array, values: Array) -> Array:
    """Interpolate linearly; NaN outside of the times and where there are none."""
    if not len(times):
        return np.full((len(wanted), values.shape[1]), np.nan)
    columns = [np.interp(wanted, times, v, left=np.nan, right=np.nan) for v in values.T]
    return np.stack(columns, axis=1)
