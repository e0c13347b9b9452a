# SPDX-License-Identifier: Apache-2.0
"""One tick of the velocity estimator: from joint angles to rates, through the nominal model."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.command_interface import EFFORT
from masmc_ros.control.velocity_estimator import followed, gains
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.portable_math import sin_cos
from masmc_ros.robot import AXES
from masmc_ros.robot.dynamics import coriolis, inertia, inertia_solve, Quad
from masmc_ros.robot.geometry import (
    Geometry,
    joint_torque,
    Posture,
    posture,
    quasi_force,
    quasi_velocity,
    reduced_velocity,
)
from masmc_ros.robot.kinematics import quasi_force_from_task

_JOINTS = 3
"""First of the joints among the positions of joint_states."""


@formula
def expected_acceleration(settings: Any, memory: Any) -> Quad:
    """Return the joints' acceleration (rad/s2) under the last command by the nominal model."""
    geometry = as_geometry(settings['geometry'])
    theta = as_base_parameters(settings['nominal'])
    angles, rates = memory['angles'], memory['rates']
    commanded, felt = memory['commanded'], memory['felt']
    bend = posture(0.0, angles[2], angles[3])
    v = quasi_velocity(geometry, rates[0], rates[1], rates[2], rates[3])
    bias = coriolis(theta, geometry, bend, v, v)
    force = quasi_force(
        geometry,
        commanded[0] + felt[0],
        commanded[1] + felt[1],
        commanded[2] + felt[2],
        commanded[3] + felt[3],
    )
    a = inertia_solve(
        inertia(theta, geometry, bend),
        force[0] - bias[0],
        force[1] - bias[1],
        force[2] - bias[2],
        force[3] - bias[3],
    )
    return reduced_velocity(geometry, a[0], a[1], a[2], a[3])


@kernel
def estimate_rates(settings: Any, memory: Any, position: Any) -> None:
    """Bring the estimated angles, rates and pushes (4 each) to the tick of a position (7).

    Over ticks that were left out it is one long period with its own gains: those of a short one
    would take what the rates were off by for a jump of the angles, many times too large.
    """
    period = (1 + memory['left_out']) * settings['period']
    memory['left_out'] = 0
    angles, rates, push = memory['angles'], memory['rates'], memory['push']
    if not memory['follows']:
        memory['follows'] = 1
        for i in range(AXES):
            angles[i] = position[_JOINTS + i]
            rates[i] = 0.0
            push[i] = 0.0
        return
    gain = gains(settings['estimator_bandwidth'], period)
    # What drives make of commanded rates is not known: all of it is a push.
    a = (0.0, 0.0, 0.0, 0.0)
    if settings['command_interface'] == EFFORT:
        a = expected_acceleration(settings, memory)
    # Joint by joint; the tuple is spelled out because compiled tuples have no loops.
    for i in range(AXES):
        of_joint = a[0] if i == 0 else (a[1] if i == 1 else (a[2] if i == 2 else a[3]))
        angles[i], rates[i], push[i] = followed(
            angles[i],
            rates[i],
            push[i],
            of_joint,
            position[_JOINTS + i],
            period,
            gain,
        )


@formula
def note_disturbance(memory: Any, geometry: Geometry, bend: Posture) -> None:
    """Keep the law's disturbance estimate as torques (4, N m) for the next expectation."""
    d = memory['disturbance']
    force = quasi_force_from_task(geometry, bend, d[0], d[1], d[2], d[3])
    felt = joint_torque(geometry, force[0], force[1], force[2], force[3])
    for i in range(AXES):
        memory['felt'][i] = felt[i]


@kernel
def estimated_velocity(settings: Any, memory: Any, position: Any, velocity: Any) -> None:
    """Estimate the rates at a position (7) and write velocities (7), the base's among them."""
    state = memory[0]
    estimate_rates(settings[0], state, position)
    rates = state['rates']
    s, c = sin_cos(position[2])
    u, w, _, _ = quasi_velocity(
        as_geometry(settings[0]['geometry']), rates[0], rates[1], rates[2], rates[3]
    )
    velocity[0] = u * c
    velocity[1] = u * s
    velocity[2] = w
    for i in range(AXES):
        velocity[_JOINTS + i] = rates[i]
