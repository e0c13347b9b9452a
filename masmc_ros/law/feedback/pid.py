# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
PID control in task space, without a model: spring, damper and integral on each axis.

    tau = J' u,    u = -K_p e - K_d edot - K_i w,    wdot = e
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.integral import integrated
from masmc_ros.law.parts.inverse_dynamics import limited_force, task_force_torque
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='pid'):
    """Settings of the law."""

    pid_k_p: Axes = gain(2000.0, 'Stiffness K_p', 'N/m')
    pid_k_d: Axes = gain(200.0, 'Damping K_d', 'N·s/m')
    pid_k_i: Axes = gain(5000.0, 'Gain K_i of the integral', 'N/(m·s)')


class Memory(fields.Memory):
    """Memory of the law."""

    pid_integral: Axes = field('w, integral of the error', 'm·s')


@formula
def _force(error: float, rate: float, w: float, k_p: float, k_d: float, k_i: float) -> float:
    """Return u of one axis in N."""
    return -k_p * error - k_d * rate - k_i * w


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    u = elementwise(
        _force,
        tick.error,
        tick.error_rate,
        memory.pid_integral,
        settings.pid_k_p,
        settings.pid_k_d,
        settings.pid_k_i,
    )
    return task_force_torque(tick, u)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Integrate the error, with back-calculation from the commanded torque."""
    w = elementwise(
        integrated,
        memory.pid_integral,
        tick.error,
        limited_force(tick, raw, torque),
        settings.pid_k_p,
        settings.pid_k_i,
        tick.period,
    )
    memory.pid_integral = w


PID = Law(
    'pid',
    torque,
    Settings,
    Memory,
    learn,
    project,
    summary='a spring, a damper and an integral on each axis of the task, without a model',
    source='Takegaki and Arimoto 1981; Arimoto and Miyazaki 1984',
    uses_switching=False,
)
