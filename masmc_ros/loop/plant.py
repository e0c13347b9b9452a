# SPDX-License-Identifier: Apache-2.0
"""The plant: forward dynamics of the robot, integrated over one control period."""

from __future__ import annotations

from typing import Any, NamedTuple

from masmc_ros.compiled import formula
from masmc_ros.loop.disturbance import sinusoid
from masmc_ros.portable_math import sin_cos
from masmc_ros.robot.dynamics import (
    BaseParameters,
    coriolis,
    inertia,
    inertia_solve,
    Quad,
)
from masmc_ros.robot.geometry import (
    Geometry,
    posture,
    quasi_force,
    quasi_velocity,
    reduced_velocity,
)


class PlantState(NamedTuple):
    """Pose of the axle's middle O, wheel and arm angles, reduced velocity; SI, radians."""

    x: float
    y: float
    yaw: float
    wheel_right: float
    wheel_left: float
    arm_1: float
    arm_2: float
    v_right: float
    v_left: float
    v_arm_1: float
    v_arm_2: float


@formula
def derivative(
    theta: BaseParameters, geometry: Geometry, state: PlantState, torque: Quad
) -> PlantState:
    """Return the state's time derivative by (8) and (10) under a torque (4) in N m."""
    v_right, v_left, v_1, v_2 = state.v_right, state.v_left, state.v_arm_1, state.v_arm_2
    bend = posture(state.yaw, state.arm_1, state.arm_2)
    quasi = quasi_velocity(geometry, v_right, v_left, v_1, v_2)
    bias = coriolis(theta, geometry, bend, quasi, quasi)
    force = quasi_force(geometry, torque[0], torque[1], torque[2], torque[3])
    quasi_dot = inertia_solve(
        inertia(theta, geometry, bend),
        force[0] - bias[0],
        force[1] - bias[1],
        force[2] - bias[2],
        force[3] - bias[3],
    )
    v_dot = reduced_velocity(geometry, quasi_dot[0], quasi_dot[1], quasi_dot[2], quasi_dot[3])
    u, w = quasi[0], quasi[1]
    return PlantState(
        u * bend.c0,
        u * bend.s0,
        w,
        v_right,
        v_left,
        v_1,
        v_2,
        v_dot[0],
        v_dot[1],
        v_dot[2],
        v_dot[3],
    )


@formula
def _moved(state: PlantState, h: float, rate: PlantState) -> PlantState:
    """Return state + h rate."""
    return PlantState(
        state[0] + h * rate[0],
        state[1] + h * rate[1],
        state[2] + h * rate[2],
        state[3] + h * rate[3],
        state[4] + h * rate[4],
        state[5] + h * rate[5],
        state[6] + h * rate[6],
        state[7] + h * rate[7],
        state[8] + h * rate[8],
        state[9] + h * rate[9],
        state[10] + h * rate[10],
    )


@formula
def rk4_step(
    theta: BaseParameters,
    geometry: Geometry,
    state: PlantState,
    h: float,
    torque_start: Quad,
    torque_middle: Quad,
    torque_end: Quad,
) -> PlantState:
    """Return the state after one classic Runge-Kutta step of h seconds."""
    k1 = derivative(theta, geometry, state, torque_start)
    k2 = derivative(theta, geometry, _moved(state, 0.5 * h, k1), torque_middle)
    k3 = derivative(theta, geometry, _moved(state, 0.5 * h, k2), torque_middle)
    k4 = derivative(theta, geometry, _moved(state, h, k3), torque_end)
    total = _moved(_moved(_moved(k1, 2.0, k2), 2.0, k3), 1.0, k4)
    return _moved(state, h / 6.0, total)


@formula
def disturbed(torque: Any, amplitude: Any, frequency: Any, phase: Any, time: float) -> Quad:
    """Return the held torque plus the disturbance at a time, N m."""
    return (
        torque[0] + sinusoid(time, amplitude[0], frequency[0], phase[0]),
        torque[1] + sinusoid(time, amplitude[1], frequency[1], phase[1]),
        torque[2] + sinusoid(time, amplitude[2], frequency[2], phase[2]),
        torque[3] + sinusoid(time, amplitude[3], frequency[3], phase[3]),
    )


@formula
def advance(
    geometry: Geometry,
    theta: BaseParameters,
    state: PlantState,
    torque: Any,
    amplitude: Any,
    frequency: Any,
    phase: Any,
    time: float,
    period: float,
    steps: int,
) -> PlantState:
    """Return the state one control period after `time`, the applied torque being held."""
    h = period / steps
    start = disturbed(torque, amplitude, frequency, phase, time)
    for step in range(steps):
        middle = disturbed(torque, amplitude, frequency, phase, time + (step + 0.5) * h)
        end = disturbed(torque, amplitude, frequency, phase, time + (step + 1.0) * h)
        state = rk4_step(theta, geometry, state, h, start, middle, end)
        start = end
    return state


@formula
def load_state(position: Any, velocity: Any) -> PlantState:
    """Read a state from positions (7) and velocities (7) in the order of joint_states."""
    return PlantState(
        position[0],
        position[1],
        position[2],
        position[3],
        position[4],
        position[5],
        position[6],
        velocity[3],
        velocity[4],
        velocity[5],
        velocity[6],
    )


@formula
def is_finite(state: PlantState) -> bool:
    """Tell whether every part of a state is a finite number."""
    total = 0.0
    for value in state:
        # Zero for a finite number, not-a-number for any other.
        total += value - value
    return total == 0.0


@formula
def store_state(geometry: Geometry, state: PlantState, position: Any, velocity: Any) -> None:
    """Write a state as positions (7) and velocities (7) in the order of joint_states."""
    s0, c0 = sin_cos(state.yaw)
    u, w, _, _ = quasi_velocity(
        geometry, state.v_right, state.v_left, state.v_arm_1, state.v_arm_2
    )
    for i in range(7):
        position[i] = state[i]
    velocity[0] = u * c0
    velocity[1] = u * s0
    velocity[2] = w
    velocity[3] = state.v_right
    velocity[4] = state.v_left
    velocity[5] = state.v_arm_1
    velocity[6] = state.v_arm_2
