# SPDX-License-Identifier: Apache-2.0
"""Robust adaptive sliding mode control (17) with the update law (23)."""

from __future__ import annotations

from masmc_ros.compiled import formula
from masmc_ros.control.adaptation import moved_estimate


@formula
def update(
    estimate: float, nominal: float, gradient: float, gamma: float, period: float, rate: float
) -> float:
    """Return the next estimate of one base inertial parameter.

    Explicit Euler step of d theta_hat / dt = -Gamma^-1 Y' s; `gradient` is the parameter's
    entry of Y' s, `gamma` its entry of Gamma, `period` the control period in s. A larger
    gamma adapts more slowly. `rate` in 1/s pulls it to the nominal one.
    """
    return moved_estimate(estimate, nominal, gradient, gamma, period, rate)
