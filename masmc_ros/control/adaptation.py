# SPDX-License-Identifier: Apache-2.0
"""What lets adaptation last: dead zone, leakage, e-modification and projection.

With g = Y' J^-1 s the gradient of (23), theta_0 the nominal estimate and f in [0, 1] what
the dead zone and a saturated torque leave of it, one tick is

    theta <- theta_0 + (theta - theta_0 - T f g / gamma) / (1 + T (leakage + nu f |s|)),

explicit in the gradient and implicit in what pulls back, which no rate can make unstable;
projection follows. docs/adaptation.md has the sources and what each part is for.
"""

from __future__ import annotations

import math
from typing import Any

from masmc_ros.compiled import formula


@formula
def norm(n: int, vector: Any) -> float:
    """Return the Euclidean norm of the first n entries."""
    total = 0.0
    for i in range(n):
        total += vector[i] * vector[i]
    return math.sqrt(total)


@formula
def beyond_dead_zone(distance: float, width: float) -> float:
    """Return the part of |s| that lies beyond the dead zone, as a fraction of |s|.

    The gradient times this fraction is that of s less its part inside the zone: continuous,
    zero inside, all of it without a zone.
    """
    fraction = 1.0 - width / distance
    return 1.0 if width == 0.0 else (fraction if distance > width else 0.0)


@formula
def moved_estimate(
    estimate: float, nominal: float, gradient: float, gamma: float, period: float, rate: float
) -> float:
    """Return the next estimate of one parameter, pulled to the nominal one at a rate in 1/s.

    `gradient` is f g, `gamma` the parameter's entry of Gamma, `period` in s.
    """
    moved = estimate - period * gradient / gamma
    pulled = nominal + (moved - nominal) / (1.0 + period * rate)
    return pulled if rate > 0.0 else moved


@formula
def bounds(nominal: float, lower: float, upper: float) -> tuple[float, float]:
    """Return the least and the largest of lower ... upper times a number of whichever sign."""
    one, other = lower * nominal, upper * nominal
    return (one, other) if nominal > 0.0 else (other, one)


@formula
def clip_to_box(n: int, nominal: Any, lower: float, upper: float, estimate: Any) -> None:
    """Clip theta (n) to the box lower ... upper times the nominal one."""
    for j in range(n):
        low, high = bounds(nominal[j], lower, upper)
        value = estimate[j]
        estimate[j] = low if value < low else (high if value > high else value)


@formula
def move_into_half_space(
    n: int,
    normal: Any,
    bound: float,
    gamma: Any,
    nominal: Any,
    lower: float,
    upper: float,
    estimate: Any,
) -> None:
    """Move theta (n), in its box, to the nearest point of it with normal' theta >= bound.

    Nearest in the metric sqrt(d' Gamma d) in which the Lyapunov function of (19) measures
    the estimation error: no point of both comes farther away. Entries that reach their bound
    stay there, and the others go on, at most n times.
    """
    for _ in range(n):
        short = bound
        slope = 0.0
        for j in range(n):
            short -= normal[j] * estimate[j]
            low, high = bounds(nominal[j], lower, upper)
            if (normal[j] > 0.0 and estimate[j] < high) or (normal[j] < 0.0 and estimate[j] > low):
                slope += normal[j] * normal[j] / gamma[j]
        if not (short > 0.0 and slope > 0.0):
            return
        for j in range(n):
            estimate[j] += short * normal[j] / (gamma[j] * slope)
        clip_to_box(n, nominal, lower, upper, estimate)
