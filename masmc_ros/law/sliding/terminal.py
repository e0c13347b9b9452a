# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Nonsingular fast terminal sliding mode: errors vanish in finite time.

    s_t = e + c_1 |e| e + c_2 |edot|^(3/2) sgn edot
    xddot_c = xddot_d - 2 / (3 c_2) sqrt|edot| sgn edot (1 + 2 c_1 |e|)
              - k_1 s_t - k_2 sqrt|s_t| sgn s_t

The surface s_t is specific to this law; the logged `surface` is s = edot + sigma e.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Axes, Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.adaptation import project
from masmc_ros.law.parts.inverse_dynamics import acceleration_torque
from masmc_ros.law.reaching.sign import sign
from masmc_ros.law.tick import Tick


class Settings(fields.Settings, group='terminal'):
    """Settings of the law."""

    terminal_c_1: Axes = gain(1.0, 'Coefficient c_1 of the square of the error', '1/m')
    terminal_c_2: Axes = gain(
        0.5, 'Coefficient c_2 of the power of its rate', 's^1.5/m^0.5', is_positive=True
    )
    terminal_k_1: Axes = gain(400.0, 'Gain k_1 of the linear reaching term', '1/s²')
    terminal_k_2: Axes = gain(200.0, 'Gain k_2 of the root', 'm^0.5/s²')


@formula
def commanded_acceleration(
    desired: float, e: float, rate: float, c_1: float, c_2: float, k_1: float, k_2: float
) -> float:
    """Return xddot_c of one axis in m/s2."""
    root = math.sqrt(abs(rate))
    s_t = e + c_1 * abs(e) * e + c_2 * rate * root
    slope = 1.0 + 2.0 * c_1 * abs(e)
    sliding = 2.0 / (3.0 * c_2) * root * sign(rate) * slope
    return desired - sliding - k_1 * s_t - k_2 * math.sqrt(abs(s_t)) * sign(s_t)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the joint torques in N·m."""
    acceleration = elementwise(
        commanded_acceleration,
        tick.desired_acceleration,
        tick.error,
        tick.error_rate,
        settings.terminal_c_1,
        settings.terminal_c_2,
        settings.terminal_k_1,
        settings.terminal_k_2,
    )
    return acceleration_torque(tick, memory.estimate, acceleration)


TERMINAL = Law(
    'terminal',
    torque,
    Settings,
    post_update=project,
    summary='nonsingular fast terminal sliding mode: errors end in finite time',
    source='Yang and Yang 2011; Feng, Yu and Man 2002',
    uses_switching=False,
)
