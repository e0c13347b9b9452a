# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Effects of motors and joints: their selection when the plant is compiled, stiction, elastic joints.

Effects are the lag of motors, stiction and elastic joints. A plant without effects has separate
compiled code, because the branches of the full code take a seventh of the time of a run. Without
effects, both codes give bitwise identical results. Robots from a URDF always have the full code:
their ticks take much longer than the branches.

*Stiction* is friction near standstill, beyond the Coulomb friction of the robot.

Bristles of the LuGre model (C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, IEEE
Transactions on Automatic Control 40(3), 1995) deflect by z,

    dz/dt = v - sigma_0 |v| z / g(v),   tau_f = -(sigma_0 z + sigma_1 c(v)^2 dz/dt),
    g(v) = F_s c(v),   c(v) = 1 / (1 + (v / v_s)^2),

with the Stribeck curve of D. P. Hess and A. Soom (Journal of Tribology 112(1), 1990) for g. A step
of implicit Euler in z is stable at any velocity and, with sigma_1 <= 8 F_s / v_s, only removes
energy from the robot and the bristles.

*Elastic joints* have a spring with a damper between the rotor of a motor and its link.

With the angle theta of the rotor and q of the link (M. W. Spong, Journal of Dynamic Systems,
Measurement, and Control 109(4), 1987; the rotors only spin),

    B theta'' = tau_m - tau_k,   H q'' + ... = tau_k + tau_d,
    tau_k = K (theta - q) + D (theta' - q').

Stiction acts on the rotor, whose angle the encoders measure. The inertia B of the rotor is that at
the joint, behind the gear.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

from masmc_ros.aliases import Joints, Record
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.tuples import elementwise, tail
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.scalars import selected
from masmc_ros.plant_model.motion import moved_along, summed, weights_of_stage
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings

OFF, ON = '', 'effects'
"""Tags of records without and with effects."""


@formula
def _loses_in_a_lane(plant: Record) -> bool:
    lanes = 0
    for lane in range(lane_count(plant)):
        lanes += lane_of(plant, lane).has_losses
    return lanes > 0


@formula
def _twists_in_a_lane(plant: Record) -> bool:
    lanes = 0
    for lane in range(lane_count(plant)):
        lanes += lane_of(plant, lane).is_elastic
    return lanes > 0


_EFFECTS = {
    OFF: SimpleNamespace(),
    ON: SimpleNamespace(has_losses=_loses_in_a_lane, is_elastic=_twists_in_a_lane),
}
"""Formulas by the tag `effects` of the settings of a plant; those of OFF are the bodies below."""

_dispatch = interface(by_tag('effects', _EFFECTS.__getitem__), formula)


@_dispatch
def has_losses(plant: Record) -> bool:
    """Return True if motors lag or joints stick in any lane."""
    return False


@_dispatch
def is_elastic(plant: Record) -> bool:
    """Return True if a joint is elastic in any lane."""
    return False


_PER_STEP = 0.1
"""Largest product of the natural frequency of a joint on its bristles and the step."""

_DEFLECTION = 1e-3
"""Deflection in rad at which bristles yield, or more with a long step."""

_DAMPING_RATIO = 0.5


def bristle_gains(
    level: float, velocity: float, inertia: float, h: float
) -> tuple[float, float]:
    """
    Return sigma_0 in N·m/rad and sigma_1 in N·m·s/rad of a joint.

    Parameters
    ----------
    level, velocity
        F_s in N·m and v_s in rad/s.
    inertia
        Inertia of the joint, its diagonal entry of H, in kg·m².
    h
        Integration step in s.

    """
    if level == 0.0:
        return 0.0, 0.0  # also for an infinite inertia, whose damping would be NaN
    stiffness = min(level / _DEFLECTION, inertia * (_PER_STEP / h) ** 2)
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * inertia)
    return stiffness, min(damping, 8.0 * level / velocity)


@formula
def stuck(
    deflection: float,
    rate: float,
    level: float,
    velocity: float,
    stiffness: float,
    damping: float,
    h: float,
) -> tuple[float, float]:
    """
    Return the deflection of the bristles in rad after a step, and the friction torque in N·m.

    Parameters
    ----------
    deflection
        Deflection z at the start of the step in rad.
    rate
        Joint rate v in rad/s.
    level, velocity
        F_s in N·m and v_s in rad/s; F_s = 0: no stiction.
    stiffness, damping
        sigma_0 in N·m/rad and sigma_1 in N·m·s/rad of `bristle_gains`.
    h
        Length of the step in s.

    """
    sticks = level > 0.0
    share = 1.0 / (1.0 + (rate / velocity) * (rate / velocity))
    yielding = stiffness * abs(rate) / ((level if sticks else 1.0) * share)
    after = (deflection + h * rate) / (1.0 + h * yielding)
    torque = -(stiffness * after + damping * share * share * (after - deflection) / h)
    return (after, torque) if sticks else (0.0, 0.0)


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
