# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Kinematic outer loop, and rates that follow it by a fuzzy network and an adaptive robust gain.

With z = rates - rates_r, joint by joint, and v_r, a_r of the outer loop (14),

    tau = H (a_r - K z - W' Phi - k sat(z / delta)) + V v
    W_i' = gamma_i z_i Phi_i - leak W_i,    k_i' = rate_i (|z_i| - delta_i)+ - leak k_i

with theta_hat, and 25 products of Gaussian sets of rates_r and z for each joint: reference [11]
of the paper, a hybrid of sliding mode and a fuzzy neural network.
"""

from __future__ import annotations

from masmc_ros.aliases import Columns, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.adaptive_bound import grown
from masmc_ros.law.parts.fuzzy_sets import (
    FIVE,
    gaussian,
    learning_step,
    mean_of_rules,
    RULES,
    train_rules,
)
from masmc_ros.law.parts.inverse_dynamics import limited_motion, model_forces, rate_error
from masmc_ros.law.parts.realisable import realisable_for_growth, realisable_part, secant
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.reaching.saturation import saturation
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='hybrid_network'):
    """Settings of the law."""

    hybrid_network_k: Joints = gain(50.0, 'Gain K of the linear term', '1/s')
    hybrid_network_gamma: Joints = gain(5000.0, 'Growth gamma of the network', '1/s²')
    hybrid_network_rate: Joints = gain(20.0, 'Growth of the robust gain k', '1/s²')
    hybrid_network_delta: Joints = gain(
        0.2, 'Boundary layer, within which k does not grow', 'rad/s', is_positive=True
    )
    hybrid_network_leak: float = gain(0.1, 'Rate at which rules and k return to zero', '1/s')
    hybrid_network_velocity_span: Joints = gain(
        5.0, 'Reference velocity at the centre of the outermost sets', 'rad/s', is_positive=True
    )
    hybrid_network_error_span: Joints = gain(
        1.0, 'z at the centre of the outermost sets', 'rad/s', is_positive=True
    )


class Memory(fields.Memory):
    """Memory of the law."""

    hybrid_network_weights: Numbers = field('W', 'rad/s²', size=('joints', RULES))
    hybrid_network_robust: Joints = field('k', 'rad/s²')


@formula
def _sets(x: float, span: float) -> Numbers:
    degrees: Numbers = gaussian(x / span, FIVE)
    return degrees


@formula
def _inputs(settings: Settings, tick: Tick, z: Numbers) -> tuple[Columns, Columns]:
    """Return the memberships of both inputs."""
    rates = mechanism.joint_rates(tick.model, tick.reference_velocity)
    return (
        elementwise(_sets, rates, settings.hybrid_network_velocity_span),
        elementwise(_sets, z, settings.hybrid_network_error_span),
    )


@formula
def _correction(z: float, k: float, network: float, robust: float, delta: float) -> float:
    """Return the feedback subtracted from the reference acceleration of one joint."""
    return k * z + network + robust * saturation(z, delta)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    z = rate_error(tick)
    first, second = _inputs(settings, tick, z)
    correction = elementwise(
        _correction,
        z,
        settings.hybrid_network_k,
        mean_of_rules(in_place(memory, 'hybrid_network_weights'), first, second),
        memory.hybrid_network_robust,
        settings.hybrid_network_delta,
    )
    a = elementwise(minus, tick.reference_acceleration, mechanism.motion(tick.model, correction))
    f = model_forces(tick, memory.estimate, a)
    return mechanism.joint_torques(tick.model, f)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Adapt rules and robust gain by the z that fits the commanded torque."""
    z = rate_error(tick)
    first, second = _inputs(settings, tick, z)
    leak, gamma = settings.hybrid_network_leak, settings.hybrid_network_gamma
    a = limited_motion(tick, memory.estimate, raw, torque)
    excess = mechanism.joint_rates(tick.model, a)
    slope = elementwise(
        secant,
        settings.hybrid_network_k,
        memory.hybrid_network_robust,
        z,
        settings.hybrid_network_delta,
    )
    fitting = elementwise(realisable_for_growth, z, excess, slope, gamma, tick.period)
    train_rules(
        in_place(memory, 'hybrid_network_weights'),
        first,
        second,
        elementwise(learning_step, fitting, gamma, tick.period),
        tick.period * leak,
    )
    robust = elementwise(
        grown,
        memory.hybrid_network_robust,
        elementwise(realisable_part, z, excess, slope),
        settings.hybrid_network_rate,
        settings.hybrid_network_delta,
        leak,
        tick.period,
    )
    memory.hybrid_network_robust = robust


HYBRID_NETWORK = Law(
    'hybrid_network',
    torque,
    (*Settings, SIGMA),
    Memory,
    learn,
    project,
    summary='an outer kinematic loop, and a fuzzy network with an adaptive robust gain',
    source='[11] of the paper; sliding mode and fuzzy neural network',
    uses_switching=False,
)
