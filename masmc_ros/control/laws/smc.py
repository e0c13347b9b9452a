# SPDX-License-Identifier: Apache-2.0
"""Robust sliding mode control (15): the parameter estimate stays what it is."""

from __future__ import annotations

from masmc_ros.compiled import formula


@formula
def update(
    estimate: float, nominal: float, gradient: float, gamma: float, period: float, rate: float
) -> float:
    """Return the next estimate of one parameter: the present one."""
    return estimate
