# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Computed torque: inverse model of joint velocities that follow an outer loop.

    z = rates - rates_r,    wdot = z
    tau = H (a_r - K_d z - K_p w) + V v

where v_r and a_r of (14), an outer kinematic loop of bandwidth sigma, replace desired velocities.
With sigma 0 the law does not use the position. The paper names computed torque, its reference
[2], without equations.
"""

from __future__ import annotations

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.integral import integrated
from masmc_ros.law.parts.inverse_dynamics import (
    DAMPING,
    limited_motion,
    model_forces,
    rate_error,
    STIFFNESS,
)
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='computed_torque'):
    """Settings of the law."""

    computed_torque_k_d: Joints = gain(DAMPING, 'Gain K_d of the joint velocities', '1/s')
    computed_torque_k_p: Joints = gain(STIFFNESS, 'Gain K_p of their integral', '1/s²')


class Memory(fields.Memory):
    """Memory of the law."""

    computed_torque_integral: Joints = field("w, integral of the rates' error", 'rad')


@formula
def _corrected(z: float, w: float, k_d: float, k_p: float) -> float:
    """Return K_d z + K_p w of one joint."""
    return k_d * z + k_p * w


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    correction = elementwise(
        _corrected,
        rate_error(tick),
        memory.computed_torque_integral,
        settings.computed_torque_k_d,
        settings.computed_torque_k_p,
    )
    a = elementwise(minus, tick.reference_acceleration, mechanism.motion(tick.model, correction))
    return mechanism.joint_torques(tick.model, model_forces(tick, tick.nominal, a))


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Integrate the velocity error, with back-calculation from the commanded torque."""
    a = limited_motion(tick, tick.nominal, raw, torque)
    w = elementwise(
        integrated,
        memory.computed_torque_integral,
        rate_error(tick),
        mechanism.joint_rates(tick.model, a),
        settings.computed_torque_k_d,
        settings.computed_torque_k_p,
        tick.period,
    )
    memory.computed_torque_integral = w


COMPUTED_TORQUE = Law(
    'computed_torque',
    torque,
    (*Settings, SIGMA),
    Memory,
    learn,
    project,
    summary="the model inverted in the joints' rates, which follow an outer kinematic loop",
    source='[2] of the paper; computed torque of velocities, with their integral',
    uses_switching=False,
)
