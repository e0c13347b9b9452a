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
from typing import Any

import masmc_ros as masmc
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.law import Law
from masmc_ros.law.parts.model import ESTIMATE, model_torque
from masmc_ros.law.registry import ENTRY_POINTS
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.plug_ins import add_plug_in

PARAMETERS = (
    Parameter('power_rate.k_1', 100.0, 'Gain of s', unit='kg/s', minimum=0.0, read_only=False),
    Parameter('power_rate.k_2', 200.0, 'Gain of the root of s', minimum=0.0, read_only=False),
    Parameter(
        'power_rate.delta', 0.05, 'Part of s in which the root is smooth', minimum=0.0,
        exclusive_minimum=True, read_only=False,
    ),
)  # fmt: skip


@formula
def force(s: float, k_1: float, k_2: float, delta: float) -> float:
    """Return u of an axis."""
    return -k_1 * s - k_2 * s / math.sqrt(abs(s) + delta)


@formula
def torque(settings: Any, tick: Any, memory: Any) -> Any:
    """Return the torques of the joints in N·m."""
    k_1, k_2, delta = (
        settings.power_rate_k_1, settings.power_rate_k_2, settings.power_rate_delta
    )  # fmt: skip
    u = elementwise(force, tick.surface, k_1, k_2, delta)
    return model_torque(tick, memory.estimate, u)


POWER_RATE = Law('power_rate', torque, PARAMETERS, (ESTIMATE,), uses_switching=False)

if __name__ == '__main__':
    # A package adds it by the entry point `power_rate = power_rate:POWER_RATE` of this group.
    add_plug_in(ENTRY_POINTS, POWER_RATE.name, POWER_RATE)
    for law in ('smc', POWER_RATE.name):
        print(masmc.simulate('paper', law=law))
