# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptive gain that grows with an error outside a dead zone, and leaks."""

from __future__ import annotations

from masmc_ros.numerics.compiled import formula


@formula
def grown(
    gain: float, s: float, rate: float, dead_zone: float, leak: float, period: float
) -> float:
    """
    Return a gain after a period of k' = rate (|s| - dead zone)+ - leak k; leak in 1/s.

    The step is explicit in the growth and implicit in the leak, which is stable at any rate.
    """
    beyond = abs(s) - dead_zone
    beyond = beyond if beyond > 0.0 else 0.0
    return (gain + period * rate * beyond) / (1.0 + period * leak)
