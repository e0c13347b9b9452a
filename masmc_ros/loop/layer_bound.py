# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Bounds for boundary layers: longest hold time of a torque, and smallest layer thickness.

Inside the layer a smooth switching term acts as the gain K_s1 + K_s2 / delta. A torque held for
h seconds is stable if h (K_s1 + K_s2 / delta) < 2 lambda_min(H_x): docs/theory/sampled_laws.md.
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array, Records
from masmc_ros.jit.arrays import write_columns
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.loop import records
from masmc_ros.robot import mechanism as formulas
from masmc_ros.robot.declaration import Mechanism
import numpy as np


@kernel
def _task_inertia(plant_settings: Records, signals: Records, result: Array) -> None:
    """Write the task inertia (axes, axes) into an array."""
    plant, row = lane_of(plant_settings[0], 0), lane_of(signals[0], 0)
    model = formulas.model_of(plant)
    bend = formulas.posture(model, row.position)
    write_columns(formulas.task_inertia(model, bend, plant.theta, row.error), result)
    check_workspace(plant)


def least_task_inertia(
    mechanism: Mechanism, theta: Array, geometry: Array, position: Array
) -> float:
    """Return lambda_min(H_x) in kg for base parameters, lengths and positions."""
    plant, signals = records.plant_settings(mechanism), records.signals(mechanism)
    fill(plant, 'theta', theta)
    fill(plant, 'geometry', geometry)
    fill(signals, 'position', position)
    matrix = np.empty(2 * (len(mechanism.axes),))
    _task_inertia(plant, signals, matrix)
    return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0])


def longest_hold(inertia: float, k_s1: float, k_s2: float, layer: float) -> float:
    """
    Return the longest time in s for which a torque may be held; infinite without gains.

    Parameters
    ----------
    inertia
        Smallest task inertia lambda_min(H_x), kg.
    k_s1, k_s2
        Gains of the reaching law, N·s/m and N.
    layer
        Thickness delta of the boundary layer, m/s.

    """
    gain = k_s1 + k_s2 / layer
    return 2.0 * inertia / gain if gain > 0.0 else math.inf


def thinnest_layer(inertia: float, k_s1: float, k_s2: float, hold: float) -> float:
    """Return the smallest stable delta in m/s for torques held `hold` s; infinite if none is."""
    slope = 2.0 * inertia / hold - k_s1
    return k_s2 / slope if slope > 0.0 else math.inf
