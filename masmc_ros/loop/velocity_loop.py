# SPDX-License-Identifier: Apache-2.0
"""Drives with a velocity loop: a PI controller on each joint, unknown to the controller.

At every integration step, H_i being the inertia that joint i feels at the start and w the
bandwidth,

    torque = 2 w H_i (rate commanded - rate) + integral,   d integral / dt = w^2 H_i (...),

with which the joint by itself has both poles at -w. The integral rests where it would push
further into the motor's limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.limits import clipped
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.plant import disturbed, is_finite, load_state, rk4_step, store_state
from masmc_ros.robot import AXES
from masmc_ros.robot.dynamics import inertia, inertia_times
from masmc_ros.robot.geometry import joint_torque, posture, quasi_velocity, wheel_rates


@kernel
def joint_inertias(geometry: Any, theta: Any, arm_1: float, arm_2: float) -> NDArray[np.float64]:
    """Return the diagonal (4, kg m2) of the reduced inertia H of (10) with the arm so (rad)."""
    lengths = as_geometry(geometry)
    h = inertia(as_base_parameters(theta), lengths, posture(0.0, arm_1, arm_2))
    diagonal = np.empty(AXES)
    for i in range(AXES):
        v = quasi_velocity(
            lengths,
            1.0 if i == 0 else 0.0,
            1.0 if i == 1 else 0.0,
            1.0 if i == 2 else 0.0,
            1.0 if i == 3 else 0.0,
        )
        f = inertia_times(h, v[0], v[1], v[2], v[3])
        tau = joint_torque(lengths, f[0], f[1], f[2], f[3])
        diagonal[i] = tau[0] if i == 0 else (tau[1] if i == 1 else (tau[2] if i == 2 else tau[3]))
    return diagonal


@formula
def drive(
    rate_error: float,
    integral: float,
    inertia_felt: float,
    bandwidth: float,
    limit: float,
    h: float,
) -> tuple[float, float]:
    """Return the torque (N m) over one step of h seconds, and the integral after it."""
    asked = 2.0 * bandwidth * inertia_felt * rate_error + integral
    torque = clipped(asked, limit)
    step = h * bandwidth * bandwidth * inertia_felt * rate_error
    winds_up = (asked > torque and step > 0.0) or (asked < torque and step < 0.0)
    return torque, integral if winds_up else integral + step


@kernel
def hold_rates(plant: Any, memory: Any, tick: int, command: Any, applied: Any) -> bool:
    """Move the true state on by one period under commanded rates.

    `command` (4): the platform's forward speed in m/s and yaw rate, and the arm joints' rates,
    in rad/s; the drives turn the wheels as the robot's own lengths need it. Writes the mean
    torque of the period to `applied` (4, N m); tells whether the state is still finite.
    """
    geometry, theta = as_geometry(plant['geometry']), as_base_parameters(plant['theta'])
    amplitude, frequency, phase = plant['amplitude'], plant['frequency'], plant['phase']
    wound, felt, limit = memory['wound'], plant['inertia'], plant['limit']
    steps, time = plant['steps'], tick * plant['period']
    h = plant['period'] / steps
    state = load_state(memory['position'], memory['velocity'])
    right, left = wheel_rates(geometry, command[0], command[1])
    commanded = (right, left, command[2], command[3])
    torque = np.empty(AXES)
    for i in range(AXES):
        applied[i] = 0.0
    for step in range(steps):
        rates = (state.v_right, state.v_left, state.v_arm_1, state.v_arm_2)
        for i in range(AXES):
            torque[i], wound[i] = drive(
                commanded[i] - rates[i], wound[i], felt[i], plant['bandwidth'][i], limit[i], h
            )
            applied[i] += torque[i] / steps
        state = rk4_step(
            theta,
            geometry,
            state,
            h,
            disturbed(torque, amplitude, frequency, phase, time + step * h),
            disturbed(torque, amplitude, frequency, phase, time + (step + 0.5) * h),
            disturbed(torque, amplitude, frequency, phase, time + (step + 1.0) * h),
        )
    store_state(geometry, state, memory['position'], memory['velocity'])
    return is_finite(state)
