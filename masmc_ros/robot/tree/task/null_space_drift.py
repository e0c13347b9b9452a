# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0


"""
Drift of a tree: estimated accelerations in the null space of its task.

Without drift and disturbances, sigma = nu - nu_r decays with the rate kappa of `damping`. The
estimate follows the measured deviation from this decay,

    drift <- N (drift + L / T (sigma - (1 - kappa T) sigma_before)),   N = 1 - W^-1 J' A^-1 J,

with A = J W^-1 J' + lambda^2 of `redundancy`. L is that of a Kalman filter of a constant: 1/2 at
first, then 1/3, 1/4, ..., down to the gain for `drift_rate`. The estimate therefore compensates an
initial model error within a few ticks, and averages velocity noise afterwards.

The estimate is constant while the law approaches the surface, because its forces accelerate the
robot. To avoid wind-up, it is also constant while a torque is at the same limit for more than
LONGEST_LIMITED. Noise alone drives torques from one limit to the other.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.tuples import dot, elementwise, least
from masmc_ros.numerics.scalars import minus, times
from masmc_ros.robot.formula_types import LawMemory, LawSettings
from masmc_ros.robot.tree.kinematics import Posture
from masmc_ros.robot.tree.task.redundancy import motion_from_task
from masmc_ros.robot.tree.task.task import task_velocity
from masmc_ros.robot.tree.tree_model import damping_of, drift_rate_of, TreeModel
import numpy as np

REACHED = 0.1
"""Largest |s| in m/s and rad/s with which drift is estimated."""

LONGEST_LIMITED = 0.01
"""Longest time in s of a torque at the same limit during which drift is estimated."""


@formula
def reachable_surface(
    model: TreeModel, posture: Posture, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return J (nu - nu_r) (axes) in m/s or rad/s, of the velocities `motion` and `reference`."""
    reachable: Numbers = task_velocity(model, posture, elementwise(minus, motion, reference))
    return reachable


@formula
def compensated(model: TreeModel, acceleration: Numbers, drift: Numbers) -> Numbers:
    """Return a_r - drift: both are derivatives of nu, (joints) in m/s² or rad/s²."""
    return elementwise(minus, acceleration, drift)


@formula
def _corrected(drift: float, measured: float, predicted: float, gain_per_period: float) -> float:
    return drift + gain_per_period * (measured - predicted)


@formula
def _limited(time: float, missing: float, period: float) -> float:
    """Return the time of a torque at the same limit in s, positive at the upper one."""
    upper = (time if time > 0.0 else 0.0) + period
    lower = (time if time < 0.0 else 0.0) - period
    return upper if missing > 0.0 else (lower if missing < 0.0 else 0.0)


@formula
def _ahead(time: float, longest: float) -> float:
    return longest - abs(time)


@kernel
def _unseen(model: TreeModel, posture: Posture, motion: Numbers) -> Numbers:
    """Return N nu, the velocities in the null space of the task."""
    seen = task_velocity(model, posture, motion)
    return elementwise(minus, motion, motion_from_task(model, posture, seen, motion))


@formula
def follow_drift(
    model: TreeModel,
    posture: Posture,
    settings: LawSettings,
    memory: LawMemory,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
    missing: Numbers,
) -> None:
    """Update the estimated drift in the memory; it is zero with commanded rates."""
    rate = drift_rate_of(model)
    if (rate > 0.0) & (settings.takes_rates == 0):
        period, gain = settings.period, memory.drift_gain
        error = elementwise(minus, motion, reference)
        predicted = memory.drift_predicted
        is_reached = dot(surface, surface) <= REACHED * REACHED
        if is_reached & (predicted[0] == predicted[0]):
            drift = memory.drift
            drift = elementwise(_corrected, drift, error, predicted, gain / period)
            memory.drift = _unseen(model, posture, drift)
            slowest = rate * period / (1.0 + rate * period)
            memory.drift_gain = max(slowest, gain / (1.0 + gain))
        limited = elementwise(_limited, memory.drift_limited, missing, period)
        memory.drift_limited = limited
        persists = least(elementwise(_ahead, limited, LONGEST_LIMITED)) < 0.0
        share = np.nan if persists else 1.0 - damping_of(model) * period
        memory.drift_predicted = elementwise(times, error, share)
