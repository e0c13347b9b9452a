# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Base inertial parameters that a plot has room for."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.robot.declaration import Quantity

MOST_ESTIMATES = 12
"""Largest number of estimates in one plot; of more, the masses are shown."""

MASS = '_mass'
"""End of the names of the masses of bodies."""


def shown_parameters(theta: Sequence[Quantity]) -> list[int]:
    """Return the indices of the parameters to plot: all, or the masses of many bodies."""
    return [
        i
        for i, parameter in enumerate(theta)
        if len(theta) <= MOST_ESTIMATES or parameter.name.endswith(MASS)
    ]
