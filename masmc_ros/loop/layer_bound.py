# SPDX-License-Identifier: Apache-2.0
"""How long a torque may be held under a boundary layer, and how thick the layer has to be.

Inside the layer a smooth switching term is the gain K_s1 + K_s2 / delta. Held for h seconds it
is stable as long as h (K_s1 + K_s2 / delta) < 2 lambda_min(H_x); see docs/control_law.md.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from masmc_ros.compiled import kernel
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.task_terms import task_inertia
from masmc_ros.robot.geometry import posture


@kernel
def _write_task_inertia(theta: Any, geometry: Any, position: Any, matrix: Any) -> None:
    bend = posture(position[2], position[5], position[6])
    task_inertia(as_base_parameters(theta), as_geometry(geometry), bend, matrix)


def least_task_inertia(theta: Any, geometry: Any, position: Any) -> float:
    """Return lambda_min(H_x) in kg at a position (7), of base parameters (7) and lengths (5)."""
    matrix = np.empty((4, 4))
    _write_task_inertia(theta, geometry, position, matrix)
    return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0])


def longest_hold(inertia: float, k_s1: float, k_s2: float, layer: float) -> float:
    """Return the time in s for which a torque may be held: kg, N s/m, N, m/s."""
    return 2.0 * inertia / (k_s1 + k_s2 / layer)


def thinnest_layer(inertia: float, k_s1: float, k_s2: float, hold: float) -> float:
    """Return the bound of delta in m/s for torques held for so many s; infinite for none."""
    rest = 2.0 * inertia / hold - k_s1
    return k_s2 / rest if rest > 0.0 else math.inf
