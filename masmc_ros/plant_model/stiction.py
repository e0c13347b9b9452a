# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Stiction: friction near standstill, beyond the Coulomb friction of the robot.

Bristles of the LuGre model (C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, IEEE
Transactions on Automatic Control 40(3), 1995) deflect by z,

    dz/dt = v - sigma_0 |v| z / g(v),   tau_f = -(sigma_0 z + sigma_1 c(v)^2 dz/dt),
    g(v) = F_s c(v),   c(v) = 1 / (1 + (v / v_s)^2),

with the Stribeck curve of D. P. Hess and A. Soom (Journal of Tribology 112(1), 1990) for g. A step
of implicit Euler in z is stable at any velocity and, with sigma_1 <= 8 F_s / v_s, only removes
energy from the robot and the bristles.
"""

from __future__ import annotations

import math

from masmc_ros.jit.compiled import formula

_PER_STEP = 0.1
"""Largest product of the natural frequency of a joint on its bristles and the step."""

_DEFLECTION = 1e-3
"""Deflection in rad at which bristles yield, or more with a long step."""

_DAMPING_RATIO = 0.5


def bristle_gains(
    level: float, velocity: float, inertia: float, h: float
) -> tuple[float, float]:
    """
    Return sigma_0 in N·m/rad and sigma_1 in N·m·s/rad of a joint.

    Parameters
    ----------
    level, velocity
        F_s in N·m and v_s in rad/s.
    inertia
        Inertia of the joint, its diagonal entry of H, in kg·m².
    h
        Integration step in s.

    """
    if level == 0.0:
        return 0.0, 0.0  # also for an infinite inertia, whose damping would be NaN
    stiffness = min(level / _DEFLECTION, inertia * (_PER_STEP / h) ** 2)
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * inertia)
    return stiffness, min(damping, 8.0 * level / velocity)


@formula
def stuck(
    deflection: float,
    rate: float,
    level: float,
    velocity: float,
    stiffness: float,
    damping: float,
    h: float,
) -> tuple[float, float]:
    """
    Return the deflection of the bristles in rad after a step, and the friction torque in N·m.

    Parameters
    ----------
    deflection
        Deflection z at the start of the step in rad.
    rate
        Joint rate v in rad/s.
    level, velocity
        F_s in N·m and v_s in rad/s; F_s = 0: no stiction.
    stiffness, damping
        sigma_0 in N·m/rad and sigma_1 in N·m·s/rad of `bristle_gains`.
    h
        Length of the step in s.

    """
    sticks = level > 0.0
    share = 1.0 / (1.0 + (rate / velocity) * (rate / velocity))
    yielding = stiffness * abs(rate) / ((level if sticks else 1.0) * share)
    after = (deflection + h * rate) / (1.0 + h * yielding)
    torque = -(stiffness * after + damping * share * share * (after - deflection) / h)
    return (after, torque) if sticks else (0.0, 0.0)
