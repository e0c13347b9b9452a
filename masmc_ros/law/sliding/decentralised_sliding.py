# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Decentralised sliding mode control: separate dynamics of platform and arm.

    rates' derivative wanted:  J^-1 (xddot_r - Q s - P sat(s / delta) - Jdot v)
    tau_g = H_gg (wanted)_g + (V v)_g with the joints of all other groups at rest

for every group g of joints. Without coupling of the groups this gives the reaching law of Gao and
Hung, s' = -Q s - P sgn s. With coupling, disturbance and model errors

    s' = -M (Q s + P sgn s) + c,    M = J H^-1 D J^-1,

where D is the inertia of the model without coupling. s = 0 can be held only if |(M^-1 c)_i| <= P_i
on every axis. Reference [6] of the paper.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import motion_acceleration
from masmc_ros.law.parts.surface import reference_acceleration, SIGMA
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER, reaching_force
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import plus, zero
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='decentralised_sliding'):
    """Settings of the law."""

    decentralised_sliding_q: Axes = gain(20.0, 'Rate Q of the reaching law', '1/s')
    decentralised_sliding_p: Axes = gain(40.0, 'Acceleration P of the reaching law', 'm/s²')


@formula
def _where(value: float, other: float, group: int, chosen: int) -> float:
    """Return `value` for joints of the chosen group, `other` for all other joints."""
    return value if group == chosen else other


@formula
def _of_group(
    tick: Tick,
    theta: Numbers,
    group: tuple[int, ...],
    chosen: int,
    rates: Numbers,
    derivative: Numbers,
) -> Numbers:
    """Return the torques for the motion of the chosen group, with all other joints at rest."""
    v = mechanism.motion(tick.model, elementwise(_where, rates, 0.0, group, chosen))
    a = mechanism.motion(tick.model, elementwise(_where, derivative, 0.0, group, chosen))
    y = mechanism.regressor(tick.model, tick.posture, v, v, a)
    return mechanism.joint_torques(tick.model, mechanism.regressor_times(tick.model, y, theta))


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    reaching = elementwise(
        reaching_force,
        tick.surface,
        settings.decentralised_sliding_q,
        settings.decentralised_sliding_p,
        elementwise(saturation, tick.surface, settings.boundary_layer),
    )
    reference = elementwise(
        reference_acceleration,
        tick.desired_acceleration,
        tick.error_derivative,
        settings.sigma,
    )
    a = motion_acceleration(tick, elementwise(plus, reference, reaching))
    rates = mechanism.joint_rates(tick.model, tick.velocity)
    derivative = mechanism.joint_rates(tick.model, a)
    theta, group = memory.estimate, settings.group
    last = group[0]
    for number in group:
        last = number if number > last else last
    torques = elementwise(zero, rates)
    for chosen in range(last + 1):
        alone = _of_group(tick, theta, group, chosen, rates, derivative)
        torques = elementwise(_where, alone, torques, group, chosen)
    return torques


DECENTRALISED_SLIDING = Law(
    'decentralised_sliding',
    torque,
    (*Settings, BOUNDARY_LAYER, SIGMA),
    post_update=project,
    summary='a sliding mode controller for the platform and one for the arm, uncoupled',
    source='[6] of the paper; reaching law of Gao and Hung 1993',
    uses_switching=False,
)
