# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Adaptation of independent parameters by gradient descent.

These are default formulas for mechanisms without a more specific adaptation.
"""

from __future__ import annotations

from masmc_ros.aliases import Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.robot.formula_types import LawSettings, Lengths


@formula
def gradient_step(estimate: float, gradient: float, gamma: float, period: float) -> float:
    """Return one parameter after an explicit step of (23); `gamma` its entry of Gamma."""
    return estimate - period * gradient / gamma


@formula
def theta_step(
    model: Lengths, settings: LawSettings, theta: Numbers, gradient: Numbers, period: float
) -> Numbers:
    """Return theta - T Gamma^-1 g."""
    return elementwise(gradient_step, theta, gradient, settings.gamma, period)


@formula
def preserves_consistency(model: Lengths, settings: LawSettings) -> bool:
    """Return False: independent parameters can be physically inconsistent."""
    return False
