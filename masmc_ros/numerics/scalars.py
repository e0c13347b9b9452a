# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Formulas of one or two numbers, to be applied to tuples entry by entry: `each(plus, a, b)`."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula


@formula
def plus(a: float, b: float) -> float:
    """Return a + b."""
    return a + b


@formula
def minus(a: float, b: float) -> float:
    """Return a - b."""
    return a - b


@formula
def zero(value: float) -> float:
    """Return 0, whatever the number is."""
    return 0.0


@formula
def moved(value: float, rate: float, period: float) -> float:
    """Return a value that changed at a rate for a period: a step of explicit Euler."""
    return value + period * rate
