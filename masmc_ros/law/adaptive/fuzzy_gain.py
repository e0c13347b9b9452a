# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sliding mode with an adaptive fuzzy gain on each axis, in place of the switching term.

    tau = Y theta_hat + J' u,    u_i = -A_i s_i - K_i,    K_i = theta_i' psi(s_i)
    theta_i' = gamma_i s_i psi(s_i) - leak theta_i

psi has seven overlapping sets of s, from negative big to positive big. Y. Guo and P.-Y. Woo, "An
adaptive fuzzy sliding mode controller for robotic manipulators", IEEE Transactions on Systems,
Man, and Cybernetics A 33, 2003; reference [8] of the paper.
"""

from __future__ import annotations

from masmc_ros.aliases import Axes, Joints, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.lanes import in_place
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.fuzzy_sets import (
    alone,
    gaussian,
    learning_step,
    mean_of_rules,
    SEVEN,
    train_rules,
)
from masmc_ros.law.parts.inverse_dynamics import limited_force
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.realisable import realisable_for_growth
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='fuzzy_gain'):
    """Settings of the law."""

    fuzzy_gain_a: Axes = gain(300.0, 'Gain A of the linear term', 'N·s/m')
    fuzzy_gain_gamma: Axes = gain(5000.0, 'Growth gamma of the rules', 'N/m')
    fuzzy_gain_span: float = gain(
        0.3, 's at the centre of the outermost sets', 'm/s', is_positive=True
    )
    fuzzy_gain_leak: float = gain(0.02, 'Rate at which the rules return to zero', '1/s')


class Memory(fields.Memory):
    """Memory of the law."""

    fuzzy_gain_theta: Numbers = field('theta of each rule', 'N', size=('axes', len(SEVEN)))


@formula
def _degrees(s: float, span: float) -> Numbers:
    """Return psi(s)."""
    degrees: Numbers = gaussian(s / span, SEVEN)
    return degrees


@formula
def _force(s: float, a: float, k: float) -> float:
    return -a * s - k


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    degrees = elementwise(_degrees, tick.surface, settings.fuzzy_gain_span)
    others = elementwise(alone, tick.surface)
    k = mean_of_rules(in_place(memory, 'fuzzy_gain_theta'), degrees, others)
    u = elementwise(_force, tick.surface, settings.fuzzy_gain_a, k)
    return model_torque(tick, memory.estimate, u)


@formula
def learn(settings: Settings, tick: Tick, memory: Memory, raw: Joints, torque: Joints) -> None:
    """Adapt the rules by the s that fits the commanded torque."""
    gamma = settings.fuzzy_gain_gamma
    s = elementwise(
        realisable_for_growth,
        tick.surface,
        limited_force(tick, raw, torque),
        settings.fuzzy_gain_a,
        gamma,
        tick.period,
    )
    train_rules(
        in_place(memory, 'fuzzy_gain_theta'),
        elementwise(_degrees, tick.surface, settings.fuzzy_gain_span),
        elementwise(alone, tick.surface),
        elementwise(learning_step, s, gamma, tick.period),
        tick.period * settings.fuzzy_gain_leak,
    )


FUZZY_GAIN = Law(
    'fuzzy_gain',
    torque,
    (*Settings, SIGMA),
    Memory,
    learn,
    project,
    summary='sliding mode with a learned fuzzy gain of s on each axis',
    source='[8] of the paper; Guo and Woo 2003',
    uses_switching=False,
)
