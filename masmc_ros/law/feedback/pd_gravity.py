# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
PD control in task space with gravity compensation by the nominal model.

    tau = g(q) + J' (-K_p e - K_d edot)

is passive: at a set-point the task behaves like springs and dampers.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import gravity_forces
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='pd_gravity'):
    """Settings of the law."""

    pd_gravity_k_p: Axes = gain(2000.0, 'Stiffness K_p', 'N/m')
    pd_gravity_k_d: Axes = gain(200.0, 'Damping K_d', 'N·s/m')


@formula
def _force(error: float, rate: float, k_p: float, k_d: float) -> float:
    """Return the force of one axis in N."""
    return -k_p * error - k_d * rate


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    u = elementwise(
        _force,
        tick.error,
        tick.error_rate,
        settings.pd_gravity_k_p,
        settings.pd_gravity_k_d,
    )
    pushed = mechanism.forces_from_task(tick.model, tick.posture, u, tick.velocity)
    f = elementwise(plus, gravity_forces(tick, tick.nominal), pushed)
    return mechanism.joint_torques(tick.model, f)


PD_GRAVITY = Law(
    'pd_gravity',
    torque,
    Settings,
    post_update=project,
    summary="PD feedback on each axis of the task, and the model's forces against gravity",
    source='Takegaki and Arimoto 1981',
    uses_switching=False,
)
