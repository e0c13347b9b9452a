# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0


"""
Drift of a tree: estimated accelerations in the directions that its task does not see.

Without them and disturbances, sigma = nu - nu_r decays with the rate kappa of `damping`. What it
does instead from tick to tick is measured, and the estimate follows it,

    drift <- N (drift + L / T (sigma - (1 - kappa T) sigma_before)),   N = 1 - W^-1 J' A^-1 J,

with A = J W^-1 J' + lambda^2 of `redundancy`. L is that of a Kalman filter of a constant: 1/2 at
first, then 1/3, 1/4, ..., down to what follows changes at `drift_rate`. So a model that is wrong
from the start costs a few ticks, and noise of the velocities is averaged afterwards.

While a law still reaches for the surface, its own forces accelerate the robot, and nothing is
estimated. Nor is anything while a torque stays at the same limit for more than LONGEST_LIMITED,
which would wind the estimate up. Noise alone drives torques from one limit to the other.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.record import get, put
from masmc_ros.numerics.scalars import minus
from masmc_ros.numerics.tuples import dot, elementwise, least
from masmc_ros.robot.tree.kinematics import Posture
from masmc_ros.robot.tree.model import damping_of, drift_rate_of, TreeModel
from masmc_ros.robot.tree.task.redundancy import motion_from_task
from masmc_ros.robot.tree.task.task import task_velocity
import numpy as np

REACHED = 0.1
"""Largest |s| in m/s and rad/s with which drift is estimated."""

LONGEST_LIMITED = 0.01
"""Longest time in s of a torque at the same limit during which drift is estimated."""


@formula
def reachable_surface(
    model: TreeModel, posture: Posture, motion: Numbers, reference: Numbers, surface: Numbers
) -> Numbers:
    """Return J (nu - nu_r)."""
    reachable: Numbers = task_velocity(model, posture, elementwise(minus, motion, reference))
    return reachable


@formula
def compensated(model: TreeModel, acceleration: Numbers, drift: Numbers) -> Numbers:
    """Return a_r less the estimated drift."""
    return elementwise(minus, acceleration, drift)


@formula
def _corrected(drift: float, measured: float, predicted: float, gain_per_period: float) -> float:
    return drift + gain_per_period * (measured - predicted)


@formula
def _decayed(error: float, share: float) -> float:
    return share * error


@formula
def _limited(time: float, missing: float, period: float) -> float:
    """Return how long a torque is at the same limit, positive at its upper one."""
    upper = (time if time > 0.0 else 0.0) + period
    lower = (time if time < 0.0 else 0.0) - period
    return upper if missing > 0.0 else (lower if missing < 0.0 else 0.0)


@formula
def _ahead(time: float, longest: float) -> float:
    return longest - abs(time)


@kernel
def _unseen(model: TreeModel, posture: Posture, motion: Numbers) -> Numbers:
    """Return N nu, the part of velocities that the task does not see."""
    seen = task_velocity(model, posture, motion)
    return elementwise(minus, motion, motion_from_task(model, posture, seen, motion))


@formula
def follow_drift(
    model: TreeModel,
    posture: Posture,
    settings: Any,
    memory: Any,
    lane: int,
    motion: Numbers,
    reference: Numbers,
    surface: Numbers,
    missing: Numbers,
) -> None:
    """Update the estimated drift in the memory; drives that follow rates have none."""
    rate = drift_rate_of(model)
    if (rate > 0.0) & (get(settings, 'takes_rates', lane) == 0):
        period, gain = get(settings, 'period', lane), get(memory, 'drift_gain', lane)
        error = elementwise(minus, motion, reference)
        predicted = get(memory, 'drift_predicted', lane)
        is_reached = dot(surface, surface) <= REACHED * REACHED
        if is_reached & (predicted[0] == predicted[0]):
            drift = get(memory, 'drift', lane)
            drift = elementwise(_corrected, drift, error, predicted, gain / period)
            put(memory, 'drift', lane, _unseen(model, posture, drift))
            slowest = rate * period / (1.0 + rate * period)
            put(memory, 'drift_gain', lane, max(slowest, gain / (1.0 + gain)))
        limited = elementwise(_limited, get(memory, 'drift_limited', lane), missing, period)
        put(memory, 'drift_limited', lane, limited)
        persists = least(elementwise(_ahead, limited, LONGEST_LIMITED)) < 0.0
        share = np.nan if persists else 1.0 - damping_of(model) * period
        put(memory, 'drift_predicted', lane, elementwise(_decayed, error, share))
