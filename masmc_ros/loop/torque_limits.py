# SPDX-License-Identifier: Apache-2.0
"""The torque within its limits, and what the limits change in what the law predicts."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.limits import limited
from masmc_ros.loop.arrays import as_base_parameters
from masmc_ros.robot import AXES
from masmc_ros.robot.dynamics import inertia, inertia_solve
from masmc_ros.robot.geometry import Geometry, Posture, quasi_force
from masmc_ros.robot.kinematics import task_velocity


@formula
def limit_torque(settings: Any, commanded: Any, raw_torque: Any, torque: Any) -> bool:
    """Write the torque (4, N m) within its limits; tell whether any of it was cut.

    `commanded` (4) is the last tick's torque and becomes this one's.
    """
    saturated = False
    for i in range(AXES):
        torque[i] = limited(
            raw_torque[i],
            commanded[i],
            settings['torque_limit'][i],
            settings['torque_rate_limit'][i],
            settings['period'],
        )
        commanded[i] = torque[i]
        saturated |= torque[i] != raw_torque[i]
    return saturated


@kernel
def correct_prediction(
    settings: Any,
    geometry: Geometry,
    bend: Posture,
    raw_torque: Any,
    torque: Any,
    predicted: Any,
) -> None:
    """Add to s+ (4, m/s) what limits change in it: T J H^-1 (torque - raw torque).

    The disturbance estimate then takes for a disturbance only what is one.
    """
    force = quasi_force(
        geometry,
        torque[0] - raw_torque[0],
        torque[1] - raw_torque[1],
        torque[2] - raw_torque[2],
        torque[3] - raw_torque[3],
    )
    h = inertia(as_base_parameters(settings['nominal']), geometry, bend)
    a = inertia_solve(h, force[0], force[1], force[2], force[3])
    change = task_velocity(geometry, bend, a[0], a[1], a[2], a[3])
    predicted[0] += settings['period'] * change[0]
    predicted[1] += settings['period'] * change[1]
    predicted[2] += settings['period'] * change[2]
    predicted[3] += settings['period'] * change[3]


@kernel
def limit_command(settings: Any, memory: Any, raw_torque: Any, torque: Any) -> bool:
    """Write the torque (4, N m) of a law in plain Python within its limits."""
    return limit_torque(settings[0], memory[0]['commanded'], raw_torque, torque)
