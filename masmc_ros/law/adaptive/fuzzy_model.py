# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Adaptive fuzzy model and adaptive fuzzy switching, without knowledge of the dynamics.

With z = rates - rates_r, joint by joint,

    tau_i = theta_i' xi(rates_r, acceleration_r) - K_i z_i - h_i
    h_i = (k_i c + eta_i)' phi(z_i)
    theta_i' = -gamma_i z_i xi - leak theta_i,    eta_i' = gamma_h z_i phi - leak eta_i

where xi are 25 products of triangular sets of both, and phi seven sets of z, centred at c. With
initial rules, h is linear in z between the outermost sets; it replaces k sgn(z).
Reference [10] of the paper; B. Yoo and W. Ham, "Adaptive fuzzy sliding mode control of nonlinear
system", IEEE Transactions on Fuzzy Systems 6, 1998.
"""

from __future__ import annotations

from masmc_ros.aliases import Columns, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import dot, elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.fuzzy_sets import (
    alone,
    FIVE,
    learning_step,
    mean_of_rules,
    RULES,
    SEVEN,
    train_rules,
    triangular,
)
from masmc_ros.law.parts.inverse_dynamics import rate_error
from masmc_ros.law.parts.realisable import realisable_for_growth, secant
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick
from masmc_ros.numerics.scalars import minus, plus
from masmc_ros.robot import mechanism


class Settings(fields.Settings, group='fuzzy_model'):
    """Settings of the law."""

    fuzzy_model_k: Joints = gain(2.0, 'Gain K of the linear term', 'N·m·s')
    fuzzy_model_k_h: Joints = gain(2.0, 'Gain k of the switching term', 'N·m')
    fuzzy_model_gamma: Joints = gain(300.0, 'Growth gamma of the model', 'N·m')
    fuzzy_model_gamma_h: Joints = gain(30.0, 'Growth gamma_h of switching', 'N·m')
    fuzzy_model_leak: float = gain(0.02, 'Rate at which the rules return to zero', '1/s')
    fuzzy_model_velocity_span: Joints = gain(
        5.0, 'Velocity at the centre of the outermost sets', 'rad/s', is_positive=True
    )
    fuzzy_model_acceleration_span: Joints = gain(
        10.0, 'Acceleration at the centre of the outermost sets', 'rad/s²', is_positive=True
    )
    fuzzy_model_error_span: Joints = gain(
        1.0, 'z at the centre of the outermost sets', 'rad/s', is_positive=True
    )


class Memory(fields.Memory):
    """Memory of the law."""

    fuzzy_model_theta: Numbers = field('theta of each rule', 'N·m', size=('joints', RULES))
    fuzzy_model_eta: Numbers = field('eta of each rule', 'N·m', size=('joints', len(SEVEN)))


@formula
def _five(x: float, span: float) -> Numbers:
    """Return the membership of x in each of the FIVE triangular sets."""
    degrees: Numbers = triangular(x / span, FIVE)
    return degrees


@formula
def _seven(x: float, span: float) -> Numbers:
    """Return the membership of x in each of the SEVEN triangular sets."""
    degrees: Numbers = triangular(x / span, SEVEN)
    return degrees


@formula
def _inputs(settings: Settings, tick: Tick, z: Numbers) -> tuple[Columns, Columns, Columns]:
    """Return the memberships of both inputs of the model, and those of switching."""
    rates = mechanism.joint_rates(tick.model, tick.reference_velocity)
    derivative = mechanism.joint_rates(tick.model, tick.reference_acceleration)
    return (
        elementwise(_five, rates, settings.fuzzy_model_velocity_span),
        elementwise(_five, derivative, settings.fuzzy_model_acceleration_span),
        elementwise(_seven, z, settings.fuzzy_model_error_span),
    )


@formula
def _switched(degrees: Numbers, k_h: float, learned: float) -> float:
    """Return h of one joint in N·m."""
    return k_h * dot(degrees, SEVEN) + learned


@formula
def _held(modelled: float, z: float, k: float, switched: float) -> float:
    return modelled - k * z - switched


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    z = rate_error(tick)
    first, second, third = _inputs(settings, tick, z)
    return elementwise(
        _held,
        mean_of_rules(in_place(memory, 'fuzzy_model_theta'), first, second),
        z,
        settings.fuzzy_model_k,
        elementwise(
            _switched,
            third,
            settings.fuzzy_model_k_h,
            mean_of_rules(in_place(memory, 'fuzzy_model_eta'), third, elementwise(alone, z)),
        ),
    )


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Adapt all rules by the z that fits the commanded torque."""
    z = rate_error(tick)
    first, second, third = _inputs(settings, tick, z)
    gamma = settings.fuzzy_model_gamma
    gamma_h = settings.fuzzy_model_gamma_h
    pull = tick.period * settings.fuzzy_model_leak
    k, k_h = settings.fuzzy_model_k, settings.fuzzy_model_k_h
    slope = elementwise(secant, k, k_h, z, settings.fuzzy_model_error_span)
    excess, growth = elementwise(minus, torque, raw), elementwise(plus, gamma, gamma_h)
    fitting = elementwise(realisable_for_growth, z, excess, slope, growth, tick.period)
    train_rules(
        in_place(memory, 'fuzzy_model_theta'),
        first,
        second,
        elementwise(learning_step, fitting, gamma, -tick.period),
        pull,
    )
    train_rules(
        in_place(memory, 'fuzzy_model_eta'),
        third,
        elementwise(alone, z),
        elementwise(learning_step, fitting, gamma_h, tick.period),
        pull,
    )


FUZZY_MODEL = Law(
    'fuzzy_model',
    torque,
    (*Settings, SIGMA),
    Memory,
    learn,
    project,
    summary='a fuzzy model and fuzzy switching, learned joint by joint from nothing',
    source='[10] of the paper; Yoo and Ham 1998',
    uses_switching=False,
)
