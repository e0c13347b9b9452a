# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Regressor of the default robot in joint velocities, from the forces of robots of one body.

The matrices are those of `lagrangian.py`, derived without the package.
"""

from __future__ import annotations

from helpers.independent_simulation import base_parameters, one_body_robots
from helpers.lagrangian import matrices
from helpers.robots import Array, DEFAULT
import numpy as np

THETA = base_parameters(DEFAULT)
"""Parameters of the default robot (7)."""


def regressor(position: Array, v: Array, v_r: Array, a_r: Array) -> Array:
    """Return Y (4, 7) at positions (7) and joint velocities (4): H a_r + V v_r = Y theta."""
    bodies = one_body_robots(DEFAULT)
    forces = []
    for body in bodies:
        m = matrices(body, position, v)
        forces.append(m.reduced_inertia @ a_r + m.reduced_coriolis @ v_r)
    coordinates = np.array([base_parameters(body) for body in bodies])
    y: Array = np.linalg.solve(coordinates, np.array(forces)).T
    return y
