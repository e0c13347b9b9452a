# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import math

from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import largest_slip, least_normal_force
from masmc_ros.numerics.aliases import Array
from masmc_ros.report.measure.parameters import run_changes
from masmc_ros.report.measure.settling import settling_time
from masmc_ros.report.measure.tracking import Tracking, tracking
from masmc_ros.robot.declaration import Point
from masmc_ros.robot.registry import DEFAULT
import numpy as np
from numpy.typing import NDArray

Window = tuple[float, float]


@dataclass(frozen=True)
class Reached:
    """
    Distances of a point from its reference; None if the log lacks the data.

    Attributes
    ----------
    rms
        root mean square of the distance, in the point's unit.
    largest
        largest distance, likewise.
    settling
        s from the first error until the distance stays small for good, see `settling_time`;
        infinity where it does not.

    """

    rms: float | None
    largest: float | None
    settling: float | None


@dataclass(frozen=True)
class Metrics:
    """
    Errors and torques of a run over the window begin <= t < end, SI units.

    The settling times are over the whole run. A value is None if the log lacks its data.

    Attributes
    ----------
    begin
        s from the first state.
    end
        s from the first state.
    points
        of each of the robot's points.
    joints
        number of commanded torques.
    torque_rms
        root mean square of the Euclidean norm of the commanded torques, N m.
    torque_variation
        total variation of the commands per time, summed over the joints,
        sum_i sum_k |tau_i,k+1 - tau_i,k| / (end - begin), N m/s: small for a smooth
        command, large for one that chatters.
    estimate_norm
        Euclidean norm of the last estimate of the base inertial parameters,
        whose units are mixed (kg, kg m2, kg m).
    fastest_slip
        of the wheels on the ground, over the whole run, m/s; None without data.
    least_normal_force
        on it, over the whole run, N; None likewise.

    """

    begin: float
    end: float
    points: Mapping[Point, Reached]
    joints: int
    torque_rms: float | None
    torque_variation: float | None
    estimate_norm: float | None
    fastest_slip: float | None = None
    least_normal_force: float | None = None

    def of(self, key: str) -> Reached:
        """Return what a point reached, by its key."""
        return next(reached for point, reached in self.points.items() if point.key == key)


def metrics(run: Run, *, window: Window | None = None, tracked: Tracking | None = None) -> Metrics:
    """
    Compute the metrics of a logged run.

    Parameters
    ----------
    run
        the run.
    window
        begin <= t < end in s from the first state; by default the second half.
    tracked
        the run's tracking, if it is known already.

    """
    tracked = tracking(run) if tracked is None else tracked
    begun = run.times[0]
    estimate = run.telemetry.get('estimate')
    reached = measure(
        tracked.times,
        tracked.error,
        run.torque.times - begun,
        run.torque.values,
        None if estimate is None else estimate.values,
        window or second_half(run.times - begun),
        max((change.time for change in run_changes(run)), default=-math.inf),
        run.mechanism.points,
    )
    if run.contact is None:
        return reached
    told = run.contact.values
    return replace(
        reached, fastest_slip=largest_slip(told), least_normal_force=least_normal_force(told)
    )


def second_half(times: Array) -> Window:
    """Return the second half of the time (n) from 0 to the last of `times`, s."""
    end = float(times[-1])
    return end / 2, end


def measure(
    times: Array,
    error: Array,
    torque_times: Array,
    torque: Array,
    estimate: Array | None,
    window: Window,
    changed: float = -math.inf,
    points: Sequence[Point] = DEFAULT.points,
) -> Metrics:
    """
    Compute the metrics of signals.

    Parameters
    ----------
    times
        (K) of the errors, s.
    error
        (K, axes) in m.
    torque_times
        (M) of the commands, s.
    torque
        (M, joints) in N m.
    estimate
        (L, parameters) base inertial parameters over time, or None.
    window
        begin <= t < end, s.
    changed
        time of the last change of parameters, s.
    points
        the robot's.

    """
    begin, end = window
    within = error[_within(times, begin, end)]
    found = {
        point: Reached(
            rms_norm(within[:, point.axes]) if len(within) else None,
            largest_norm(within[:, point.axes]) if len(within) else None,
            settling_time(times, error[:, point.axes], changed),
        )
        for point in points
    }
    torque = torque[_within(torque_times, begin, end)]
    if estimate is not None and not len(estimate):
        estimate = None
    return Metrics(
        begin=begin,
        end=end,
        points=found,
        joints=torque.shape[1],
        torque_rms=rms_norm(torque) if len(torque) else None,
        torque_variation=total_variation(torque) / (end - begin) if len(torque) else None,
        estimate_norm=None if estimate is None else float(np.linalg.norm(estimate[-1])),
    )


def rms_norm(vectors: Array) -> float:
    """Return the root mean square of the Euclidean norms of (n, m) vectors, n > 0."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def largest_norm(vectors: Array) -> float:
    """Return the largest Euclidean norm of (n, m) vectors, n > 0."""
    return float(np.sqrt(np.max(np.sum(vectors**2, axis=1))))


def total_variation(samples: Array) -> float:
    """Return the total variation of (n, m) samples, summed over the m columns."""
    return float(np.sum(np.abs(np.diff(samples, axis=0))))


def _within(times: Array, begin: float, end: float) -> NDArray[np.bool_]:
    return (begin <= times) & (times < end)
