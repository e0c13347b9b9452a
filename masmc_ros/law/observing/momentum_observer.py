# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Computed torque in task space, minus the disturbance estimated by a momentum observer.

    tau = H a_c + V v + g - d,    a_c = J^-1 (xddot_d - K_d edot - K_p e - Jdot v)
    d' = K_o (H vdot + V v + g - tau - d)

with the nominal model; d is a force conjugate to v. The observer computes one period in implicit
Euler, with the commanded torque.
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
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='momentum_observer'):
    """Settings of the law."""

    momentum_observer_k_p: Axes = gain(STIFFNESS, 'Stiffness K_p per mass', '1/s²')
    momentum_observer_k_d: Axes = gain(DAMPING, 'Damping K_d per mass', '1/s')
    momentum_observer_rate: float = gain(200.0, 'Rate K_o of the observer; 0: no observer', '1/s')


class Memory(fields.Memory):
    """Memory of the law."""

    momentum_observer_disturbance: Joints = field('d, conjugate to v')
    momentum_observer_drive: Joints = field('tau - V v - g of the tick before')
    momentum_observer_velocity: Joints = field('v of the tick before', initial=math.nan)


@formula
def _observed(d: float, inertial: float, drive: float, share: float) -> float:
    """Return the next d of one velocity; it is unmodified for unknown values."""
    moved = d + share * (inertial - drive - d)
    return moved if moved == moved else d


@formula
def _forces(a: float, b: float, disturbance: float) -> float:
    return a + b - disturbance


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m, and update the disturbance estimate."""
    h = mechanism.inertia(tick.model, tick.posture, tick.nominal)
    before = last_acceleration(tick, memory.momentum_observer_velocity)
    rate = 0.0 if is_on(settings) else settings.momentum_observer_rate
    gain = tick.period * rate
    d = elementwise(
        _observed,
        memory.momentum_observer_disturbance,
        mechanism.inertia_times(tick.model, h, before),
        memory.momentum_observer_drive,
        gain / (1.0 + gain),
    )
    memory.momentum_observer_disturbance = d
    acceleration = spring(tick, settings.momentum_observer_k_d, settings.momentum_observer_k_p)
    wanted = mechanism.inertia_times(tick.model, h, motion_acceleration(tick, acceleration))
    model = mechanism.coriolis(tick.model, tick.posture, tick.nominal, tick.velocity)
    return mechanism.joint_torques(tick.model, elementwise(_forces, wanted, model, d))


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Store drive forces and velocity for the next tick."""
    model = mechanism.coriolis(tick.model, tick.posture, tick.nominal, tick.velocity)
    drive = elementwise(minus, mechanism.forces(tick.model, torque), model)
    memory.momentum_observer_drive = drive
    memory.momentum_observer_velocity = tick.velocity


MOMENTUM_OBSERVER = Law(
    'momentum_observer',
    torque,
    Settings,
    Memory,
    learn,
    project,
    summary='inverse model in task space, less the disturbance estimated from the momentum',
    source='De Luca and Mattone 2003',
    uses_switching=False,
)
