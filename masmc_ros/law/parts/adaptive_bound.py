# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptive gain that grows with an error outside a dead zone, and leaks."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula


@formula
def grown(
    gain: float, s: float, rate: float, dead_zone: float, leak: float, period: float
) -> float:
    """
    Return a gain after one period of k' = rate max(0, |s| - dead_zone) - leak k.

    The step is explicit in the growth and implicit in the leak, which is stable at any rate.

    Parameters
    ----------
    gain
        Gain k.
    s
        Entry of the sliding surface.
    rate
        Growth of the gain per unit of s and second.
    dead_zone
        |s| up to which the gain does not grow, in the unit of s.
    leak
        Rate of the leak in 1/s.
    period
        Control period in s.

    """
    beyond = abs(s) - dead_zone
    beyond = beyond if beyond > 0.0 else 0.0
    return (gain + period * rate * beyond) / (1.0 + period * leak)
