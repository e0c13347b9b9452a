# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Elastic joints: a spring with a damper between the rotor of a motor and its link.

With the angle theta of the rotor and q of the link (M. W. Spong, Journal of Dynamic Systems,
Measurement, and Control 109(4), 1987; the rotors only spin),

    B theta'' = tau_m - tau_k,   H q'' + ... = tau_k + tau_d,
    tau_k = K (theta - q) + D (theta' - q').

Stiction acts on the rotor, whose angle the encoders measure. The inertia B of the rotor is that at
the joint, behind the gear.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise, tail
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.scalars import selected
from masmc_ros.plant_model.motion import moved_along, summed, weights_of_stage
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings

LONGEST_STEP = 1.0
"""Largest product of the natural frequency of an elastic joint and the integration step."""


def natural_frequency(stiffness: float, rotor: float, link: float) -> float:
    """
    Return the frequency in rad/s of a joint; 0 for a rigid one.

    Parameters
    ----------
    stiffness
        Stiffness in N·m/rad; 0: rigid.
    rotor, link
        Inertias on the sides of the motor and of the link in kg·m².

    """
    return math.sqrt(stiffness * (1.0 / rotor + 1.0 / link)) if stiffness > 0.0 else 0.0


@formula
def rotor_angles(plant: PlantSettings, memory: PlantMemory) -> Joints:
    """Return the angles (joints) in rad of the rotors; of rigid joints those of the links."""
    angles = tail(memory.position, memory.rates)
    return elementwise(selected, plant.joint_stiffness, memory.rotor_angles, angles)


@formula
def rotor_rates(plant: PlantSettings, memory: PlantMemory) -> Joints:
    """Return the rates (joints) in rad/s of the rotors; of rigid joints those of the links."""
    return elementwise(selected, plant.joint_stiffness, memory.rotor_rates, memory.rates)


@formula
def _transmitted(
    driven: float,
    stiffness: float,
    damping: float,
    twist: float,
    twist_rate: float,
) -> float:
    """Return the torque on the link in N·m: of the spring, or of the motor of a rigid joint."""
    return stiffness * twist + damping * twist_rate if stiffness > 0.0 else driven


@formula
def _difference(rotor: float, link: float) -> float:
    return rotor - link


@formula
def _acceleration(driven: float, transmitted: float, rotor: float) -> float:
    return (driven - transmitted) / rotor


@formula
def twist_joints(plant: PlantSettings, memory: PlantMemory, stage: int, h: float) -> None:
    """
    Compute a stage of the rotors' motion, and replace `driven` by the torque on the links.

    Call it before the stage of the links, and `untwist_joints` after it. Arguments are those of
    `runge_kutta_stage`.
    """
    place, driven = mark(plant), memory.driven
    memory.actuated = driven
    rate = memory.reached_rotor_rates
    angles = tail(memory.reached, memory.reached_rates)
    twist = elementwise(_difference, memory.reached_rotors, angles)
    twist_rate = elementwise(_difference, rate, memory.reached_rates)
    stiffness = plant.joint_stiffness
    torque = elementwise(
        _transmitted, driven, stiffness, plant.joint_damping, twist, twist_rate
    )
    acceleration = elementwise(_acceleration, driven, torque, plant.rotor_inertia)
    memory.driven = torque
    is_first, is_last, weight, part = weights_of_stage(stage, h)
    slopes = elementwise(summed, memory.rotor_slopes, rate, weight, is_first)
    accelerations = elementwise(
        summed, memory.rotor_accelerations, acceleration, weight, is_first
    )
    memory.rotor_slopes = slopes
    memory.rotor_accelerations = accelerations
    memory.reached_rotors = moved_along(memory.rotor_angles, rate, slopes, is_last, part)
    memory.reached_rotor_rates = moved_along(
        memory.rotor_rates, acceleration, accelerations, is_last, part
    )
    if is_last:
        memory.rotor_angles = memory.reached_rotors
        memory.rotor_rates = memory.reached_rotor_rates
    free(plant, place)


@formula
def untwist_joints(memory: PlantMemory) -> None:
    """Restore `driven`, the torque of the motors."""
    memory.driven = memory.actuated
