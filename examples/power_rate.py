# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A custom law: sliding mode control with the power rate reaching law of Gao and Hung 1993.

u = -k_1 s - k_2 sqrt|s| sign(s)

for each task axis, with the nominal model of the robot. The slope of the root at s = 0 is
infinite, and a sampled law would chatter: s / sqrt(|s| + delta) replaces sqrt|s| sign(s).
"""

from __future__ import annotations

import math

import masmc_ros as masmc
from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import gain, Memory
from masmc_ros.law.law import Law
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.registry import ENTRY_POINTS
from masmc_ros.law.tick import Tick
from masmc_ros.params.plug_ins import add_plug_in


class Settings(fields.Settings, group='power_rate'):
    """Settings of the law."""

    power_rate_k_1: float = gain(100.0, 'Gain of s', 'kg/s')
    power_rate_k_2: float = gain(200.0, 'Gain of the root of s')
    power_rate_delta: float = gain(
        0.05, 'Part of s in which the root is smooth', is_positive=True
    )


@formula
def force(s: float, k_1: float, k_2: float, delta: float) -> float:
    """Return u of an axis."""
    return -k_1 * s - k_2 * s / math.sqrt(abs(s) + delta)


@formula
def torque(settings: Settings, tick: Tick, memory: Memory) -> Joints:
    """Return the torques of the joints in N·m."""
    u = elementwise(
        force,
        tick.surface,
        settings.power_rate_k_1,
        settings.power_rate_k_2,
        settings.power_rate_delta,
    )
    return model_torque(tick, memory.estimate, u)


POWER_RATE = Law('power_rate', torque, Settings, uses_switching=False)

if __name__ == '__main__':
    # A package adds it by the entry point `power_rate = power_rate:POWER_RATE` of this group.
    add_plug_in(ENTRY_POINTS, POWER_RATE.name, POWER_RATE)
    for law in ('smc', POWER_RATE.name):
        print(masmc.simulate('paper', law=law))
