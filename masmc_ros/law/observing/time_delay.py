# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Time-delay control: the unmodelled forces of the last period are assumed in this one.

    tau_k = tau_{k-1} + H (a_c - vdot_{k-1}),    a_c = J^-1 (xddot_d - K_d edot - K_p e - Jdot v)

tau_{k-1} is the commanded torque. The torque is H a_c + n, where n = tau_{k-1} - H vdot_{k-1} are
all forces except H vdot: of velocities, gravity, disturbances, and errors of H.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.delay_compensation import is_on
from masmc_ros.law.parts.inverse_dynamics import (
    DAMPING,
    motion_acceleration,
    spring,
    STIFFNESS,
)
from masmc_ros.law.parts.last_period import last_acceleration
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, plus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='time_delay'):
    """Settings of the law."""

    time_delay_k_p: Axes = gain(STIFFNESS, 'Stiffness K_p per mass', '1/s²')
    time_delay_k_d: Axes = gain(DAMPING, 'Damping K_d per mass', '1/s')


class Memory(fields.Memory):
    """Memory of the law."""

    time_delay_velocity: Joints = field('v of the tick before', initial=math.nan)


@formula
def _known(measured: float, modelled: float) -> float:
    """Return the measured value, or that of the model without a previous tick."""
    return measured if measured == measured else modelled


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    acceleration = spring(tick, settings.time_delay_k_d, settings.time_delay_k_p)
    h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
    before = last_acceleration(tick, memory.time_delay_velocity)
    commanded = mechanism.forces(tick.model, memory.commanded)
    left = elementwise(minus, commanded, mechanism.inertia_times(tick.model, h, before))
    model = mechanism.coriolis(tick.model, tick.posture, tick.nominal, tick.velocity)
    wanted = mechanism.inertia_times(tick.model, h, motion_acceleration(tick, acceleration))
    others = model if is_on(settings) else elementwise(_known, left, model)
    f = elementwise(plus, wanted, others)
    return mechanism.joint_torques(tick.model, f)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Store the velocity for the next tick."""
    memory.time_delay_velocity = tick.velocity


TIME_DELAY = Law(
    'time_delay',
    torque,
    Settings,
    Memory,
    learn,
    project,
    summary='the last torque, corrected by what the acceleration then lacked',
    source='Youcef-Toumi and Ito 1990; Hsia and Gao 1990',
    uses_switching=False,
)
