# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Quintic Hermite interpolation between two samples of a reference."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula

Sample = tuple[float, float, float]


@formula
def quintic(first: Sample, second: Sample, period: float, part: float) -> Sample:
    """
    Return position, velocity and acceleration at `part` (0 to 1) of the way.

    The polynomial of degree five in time has the position, velocity and acceleration of both
    samples, which are `period` s apart; one task axis in m, m/s, m/s2.
    """
    x0, v0, a0 = first
    x1, v1, a1 = second
    v0 *= period
    v1 *= period
    a0 *= period * period
    a1 *= period * period
    step = x1 - x0
    c3 = 10.0 * step - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * step + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * step - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    p = part
    position = x0 + p * (v0 + p * (0.5 * a0 + p * (c3 + p * (c4 + p * c5))))
    velocity = v0 + p * (a0 + p * (3.0 * c3 + p * (4.0 * c4 + p * 5.0 * c5)))
    acceleration = a0 + p * (6.0 * c3 + p * (12.0 * c4 + p * 20.0 * c5))
    return position, velocity / period, acceleration / (period * period)
