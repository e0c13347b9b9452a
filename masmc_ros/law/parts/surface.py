# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The sliding surface (13) and the reference state (14), one task axis at a time."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.law.declared import PerEntry

SIGMA = PerEntry('sigma', 'axes', 2.0, 'Slope sigma of the sliding surface', '1/s')


@formula
def sliding_surface(error: float, error_rate: float, sigma: float) -> float:
    """Return s = edot + sigma e of (13) in m/s: error in m, its rate in m/s, sigma in 1/s."""
    return error_rate + sigma * error


@formula
def reference_velocity(desired_velocity: float, error: float, sigma: float) -> float:
    """Return xdot_r = xdot_d - sigma e of (14) in m/s."""
    return desired_velocity - sigma * error


@formula
def reference_acceleration(
    desired_acceleration: float, error_rate: float, sigma: float
) -> float:
    """Return xddot_r = xddot_d - sigma edot of (14) in m/s²."""
    return desired_acceleration - sigma * error_rate
