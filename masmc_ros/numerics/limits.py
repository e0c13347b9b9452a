# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of magnitude and rate of commands, one joint at a time."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula


@formula
def clipped(value: float, limit: float) -> float:
    """Return the value limited to [-limit, limit]; 0 disables the limit."""
    within = limit if value > limit else (-limit if value < -limit else value)
    return within if limit > 0.0 else value


@formula
def limited(
    value: float, previous: float, limit: float, rate_limit: float, period: float
) -> float:
    """
    Return a command within its limits: of magnitude, and of change since `previous`.

    Torques are in N·m, the rate in N·m/s, the period in s; 0 disables a limit. The magnitude is
    limited last, so a reduced limit applies immediately.
    """
    step = rate_limit * period
    change = value - previous
    reached = previous + step if change > step else (previous - step if change < -step else value)
    return clipped(reached if rate_limit > 0.0 else value, limit)
