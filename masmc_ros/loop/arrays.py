# SPDX-License-Identifier: Apache-2.0
"""Arrays as Python passes them in, read as the tuples that the formulas take."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula
from masmc_ros.robot.dynamics import BaseParameters
from masmc_ros.robot.geometry import Geometry


@formula
def as_geometry(values: Any) -> Geometry:
    """Read the lengths from an array (5) in the order of Geometry."""
    return Geometry(values[0], values[1], values[2], values[3], values[4])


@formula
def as_base_parameters(values: Any) -> BaseParameters:
    """Read theta from an array (7) in the order of BaseParameters."""
    return BaseParameters(
        values[0], values[1], values[2], values[3], values[4], values[5], values[6]
    )
