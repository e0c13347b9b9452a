# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Formulas of numbers and their limits, for use on vectors as in `elementwise(plus, a, b)`."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula


@formula
def plus(a: float, b: float) -> float:
    """Return a + b."""
    return a + b


@formula
def minus(a: float, b: float) -> float:
    """Return a - b."""
    return a - b


@formula
def times(value: float, factor: float) -> float:
    """Return `value * factor`."""
    return value * factor


@formula
def zero(value: float) -> float:
    """Return 0 for any number."""
    return 0.0


@formula
def moved(value: float, rate: float, period: float) -> float:
    """Return a value after a step of explicit Euler at a rate."""
    return value + period * rate


@formula
def selected(mask: int, yes: float, no: float) -> float:
    """Return one of two numbers by a mask of 1 and 0."""
    return yes if mask != 0 else no


@formula
def nearest(value: float) -> int:
    """Return the nearest whole number as `round` does, without a function of a C library."""
    whole = int(value)
    part = value - whole
    if abs(part) > 0.5 or (abs(part) == 0.5 and whole & 1 != 0):
        whole += 1 if part > 0.0 else -1
    return whole


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
