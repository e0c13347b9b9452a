# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of the plant: forward dynamics, integrated by classic Runge-Kutta steps."""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula, subroutine
from masmc_ros.jit.tuples import elementwise
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.scalars import plus
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings
from masmc_ros.robot import mechanism
from masmc_ros.robot.formula_types import Lengths

State = tuple[Numbers, Numbers]
"""Positions, and the joints' rates."""


@formula
def _moved(value: float, h: float, rate: float) -> float:
    """Return value + h rate."""
    return value + h * rate


@formula
def summed(total: float, slope: float, weight: float, is_first: bool) -> float:
    """Return the sum of the slopes so far with their weights."""
    return slope if is_first else total + weight * slope


@formula
def _chosen(slope: float, total: float, is_last: bool) -> float:
    return total if is_last else slope


@formula
def weights_of_stage(stage: int, h: float) -> tuple[bool, bool, float, float]:
    """
    Return whether a stage is the first or the last one, the weight of its slope, and the step.

    Parameters
    ----------
    stage
        Number of the stage, from 0.
    h
        Length of the step in s.

    """
    is_first, is_last = stage == 0, stage == 3
    weight = 1.0 if is_last else 2.0
    # Length of the motion from the start: to the next stage, or to the end along all slopes.
    part = h / 6.0 if is_last else (h if stage == 2 else 0.5 * h)
    return is_first, is_last, weight, part


@formula
def moved_along(
    value: Numbers, slope: Numbers, slopes: Numbers, is_last: bool, part: float
) -> Numbers:
    """
    Return a vector at the next stage, or at the end of the step.

    Parameters
    ----------
    value
        Its value at the start of the step.
    slope, slopes
        Derivative at this stage, and the weighted sum of all.
    is_last, part
        Of `weights_of_stage`.

    """
    return elementwise(_moved, value, part, elementwise(_chosen, slope, slopes, is_last))


@formula
def derivative(
    model: Lengths, theta: Numbers, position: Numbers, rates: Numbers, torque: Numbers
) -> State:
    """
    Return the derivatives (positions) and (joints) of positions and joint rates, (8) and (10).

    Parameters
    ----------
    model
        Lengths of the mechanism.
    theta
        Base inertial parameters (parameters).
    position
        Positions (positions) in m and rad.
    rates
        Joint rates (joints) in rad/s or m/s.
    torque
        Joint torques (joints) in N·m or N, with the disturbance.

    """
    posture = mechanism.posture(model, position)
    return (
        mechanism.position_rates(model, posture, rates),
        mechanism.joint_accelerations(model, posture, theta, rates, torque),
    )


@subroutine
def runge_kutta_stage(plant: PlantSettings, memory: PlantMemory, stage: int, h: float) -> None:
    """
    Compute one of the four stages of a step; after the last one, `reached` is the end of the step.

    Each stage is a short loop over all lanes: a processor computes the next lanes while it waits
    for results of the current ones.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant, one lane.
    stage
        Number of the stage, from 0.
    h
        Length of the step in s.

    """
    place = mark(plant)
    is_first, is_last, weight, part = weights_of_stage(stage, h)
    slope, acceleration = derivative(
        mechanism.model_of(plant),
        plant.theta,
        memory.reached,
        memory.reached_rates,
        elementwise(plus, memory.driven, memory.disturbance),
    )
    slopes = elementwise(summed, memory.slopes, slope, weight, is_first)
    accelerations = elementwise(summed, memory.accelerations, acceleration, weight, is_first)
    memory.slopes = slopes
    memory.accelerations = accelerations
    memory.reached = moved_along(memory.position, slope, slopes, is_last, part)
    memory.reached_rates = moved_along(
        memory.rates, acceleration, accelerations, is_last, part
    )
    free(plant, place)
