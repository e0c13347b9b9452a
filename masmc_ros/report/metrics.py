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

"""What a run reached, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
import math

from masmc_ros.log.read.reader import Run
from masmc_ros.report.parameters import run_changes
from masmc_ros.report.settling import settling_time
from masmc_ros.report.tracking import Tracking, tracking
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Window = tuple[float, float]


@dataclass(frozen=True)
class Metrics:
    """
    Errors and torques of a run over the window begin <= t < end, SI units.

    The settling times are over the whole run. What the log does not tell is None.

    Attributes
    ----------
    begin
        s from the first state.
    end
        s from the first state.
    end_effector_rms
        root mean square of |e_E|, the distance to the desired point, m.
    end_effector_max
        largest |e_E|, m.
    platform_rms
        root mean square of |e_F|, m.
    platform_max
        largest |e_F|, m.
    end_effector_settling
        s from the first error until |e_E| stays small for good, see
        `settling_time`; infinity where it does not.
    platform_settling
        likewise of |e_F|.
    torque_rms
        root mean square of the Euclidean norm of the four commanded torques, N m.
    torque_variation
        total variation of the commands per time, summed over the joints,
        sum_i sum_k |tau_i,k+1 - tau_i,k| / (end - begin), N m/s: small for a smooth
        command, large for one that chatters.
    estimate_norm
        Euclidean norm of the last estimate of the base inertial parameters,
        whose units are mixed (kg, kg m2, kg m).

    """

    begin: float
    end: float
    end_effector_rms: float | None
    end_effector_max: float | None
    platform_rms: float | None
    platform_max: float | None
    end_effector_settling: float | None
    platform_settling: float | None
    torque_rms: float | None
    torque_variation: float | None
    estimate_norm: float | None


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
    return measure(
        tracked.times,
        tracked.error,
        run.torque_times - begun,
        run.torque,
        run.parameter_estimate,
        window or second_half(run.times - begun),
        max((change.time for change in run_changes(run)), default=-math.inf),
    )


def second_half(times: Floats) -> Window:
    """Return the second half of the time (n) from 0 to the last of `times`, s."""
    end = float(times[-1])
    return end / 2, end


def measure(
    times: Floats,
    error: Floats,
    torque_times: Floats,
    torque: Floats,
    estimate: Floats | None,
    window: Window,
    changed: float = -math.inf,
) -> Metrics:
    """
    Compute the metrics of signals.

    Parameters
    ----------
    times
        (K) of the errors, s.
    error
        (K, 4) of x_E, y_E, x_F, y_F in m.
    torque_times
        (M) of the commands, s.
    torque
        (M, 4) in N m.
    estimate
        (L, 7) base inertial parameters over time, or None.
    window
        begin <= t < end, s.
    changed
        time of the last change of parameters, s.

    """
    begin, end = window
    settling = [settling_time(times, part, changed) for part in (error[:, :2], error[:, 2:])]
    error = error[_within(times, begin, end)]
    torque = torque[_within(torque_times, begin, end)]
    if estimate is not None and not len(estimate):
        estimate = None
    return Metrics(
        begin=begin,
        end=end,
        end_effector_rms=rms_norm(error[:, :2]) if len(error) else None,
        end_effector_max=largest_norm(error[:, :2]) if len(error) else None,
        platform_rms=rms_norm(error[:, 2:]) if len(error) else None,
        platform_max=largest_norm(error[:, 2:]) if len(error) else None,
        end_effector_settling=settling[0],
        platform_settling=settling[1],
        torque_rms=rms_norm(torque) if len(torque) else None,
        torque_variation=total_variation(torque) / (end - begin) if len(torque) else None,
        estimate_norm=None if estimate is None else float(np.linalg.norm(estimate[-1])),
    )


def rms_norm(vectors: Floats) -> float:
    """Return the root mean square of the Euclidean norms of (n, m) vectors, n > 0."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def largest_norm(vectors: Floats) -> float:
    """Return the largest Euclidean norm of (n, m) vectors, n > 0."""
    return float(np.sqrt(np.max(np.sum(vectors**2, axis=1))))


def total_variation(samples: Floats) -> float:
    """Return the total variation of (n, m) samples, summed over the m columns."""
    return float(np.sum(np.abs(np.diff(samples, axis=0))))


def _within(times: Floats, begin: float, end: float) -> NDArray[np.bool_]:
    return (begin <= times) & (times < end)
