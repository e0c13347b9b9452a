# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Adaptation of independent parameters by gradient descent.

These are default formulas for mechanisms without a more specific adaptation.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.tuples import elementwise


@formula
def gradient_step(estimate: float, gradient: float, gamma: float, period: float) -> float:
    """Return one parameter after an explicit step of (23); `gamma` its entry of Gamma."""
    return estimate - period * gradient / gamma


@formula
def theta_step(
    model: Any, settings: Any, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """Return theta - T Gamma^-1 g."""
    return elementwise(gradient_step, theta, gradient, settings.gamma, period)


@formula
def preserves_consistency(model: Any, settings: Any) -> bool:
    """Return False: independent parameters can be physically inconsistent."""
    return False
