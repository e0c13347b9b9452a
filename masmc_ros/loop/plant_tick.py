# SPDX-License-Identifier: Apache-2.0
"""One tick of the plant: from a command to the next state, true and measured."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.command_interface import VELOCITY
from masmc_ros.control.limits import limited
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.measurement import measure
from masmc_ros.loop.plant import advance, is_finite, load_state, PlantState, store_state
from masmc_ros.loop.velocity_loop import hold_rates
from masmc_ros.portable_math import sin_cos
from masmc_ros.robot import AXES


@formula
def advance_true_state(plant: Any, memory: Any, tick: int, applied: Any) -> bool:
    """Move the true state on by one control period; tell whether it is still finite.

    `applied` (4, N m) is held over the period that begins at the tick.
    """
    geometry = as_geometry(plant['geometry'])
    state = advance(
        geometry,
        as_base_parameters(plant['theta']),
        load_state(memory['position'], memory['velocity']),
        applied,
        plant['amplitude'],
        plant['frequency'],
        plant['phase'],
        tick * plant['period'],
        plant['period'],
        plant['steps'],
    )
    store_state(geometry, state, memory['position'], memory['velocity'])
    return is_finite(state)


@formula
def hold_command(plant: Any, memory: Any, tick: int, command: Any, applied: Any) -> bool:
    """Move the true state on under a command (4); tell whether it is still finite.

    `applied` (4, N m) is the torque that it comes to: within the motors' limits the command
    itself, or the mean of what the drives make of commanded rates.
    """
    if plant['command_interface'] == VELOCITY:
        return hold_rates(plant, memory, tick, command, applied)
    driven = memory['driven']
    for i in range(AXES):
        applied[i] = limited(
            command[i], driven[i], plant['limit'][i], plant['rate_limit'][i], plant['period']
        )
        driven[i] = applied[i]
        memory['wound'][i] = 0.0
    return advance_true_state(plant, memory, tick, applied)


@formula
def observe(
    plant: Any, memory: Any, delayed: Any, tick: int, position: Any, velocity: Any
) -> None:
    """Write what is known of the true state at a tick."""
    if plant['is_exact']:
        for i in range(7):
            position[i] = memory['position'][i]
            velocity[i] = memory['velocity'][i]
    else:
        measure(plant, memory, delayed, tick, position, velocity)


@formula
def is_measured(position: Any, velocity: Any) -> bool:
    """Tell whether all that is measured (7 positions, 7 velocities) is a finite number.

    Of a finite state it need not be: beyond 1e9 rad an angle has no sine.
    """
    total = 0.0
    for i in range(7):
        total += (position[i] - position[i]) + (velocity[i] - velocity[i])
    return total == 0.0


@kernel
def plant_tick(
    plant: Any,
    memory: Any,
    delayed: Any,
    tick: int,
    command: Any,
    position: Any,
    velocity: Any,
    applied: Any,
) -> bool:
    """Advance the plant by one control period; tell whether all of its state is still finite.

    In: one record of PLANT_SETTINGS; the tick that the command (4, N m, or m/s and rad/s as in
    `hold_rates`) answers. In and out: one record of PLANT_MEMORY with the true state, and the
    measurements under way.
    Out: the torque applied (4, N m), within the motors' limits, and what is measured at the
    next tick, positions (7) and velocities (7) in the order of joint_states.
    """
    model, state = plant[0], memory[0]
    finite = hold_command(model, state, tick, command, applied)
    observe(model, state, delayed, tick + 1, position, velocity)
    return finite and is_measured(position, velocity)


@kernel
def plant_hold(
    plant: Any,
    memory: Any,
    delayed: Any,
    tick: int,
    position: Any,
    velocity: Any,
    applied: Any,
) -> bool:
    """Advance the plant by one control period in which nobody commands: its drives hold.

    They do as with rates of zero, within the motors' limits. Arguments as in `plant_tick`;
    where torques are commanded, none of them is applied meanwhile: what the drives make to hold
    is their own.
    """
    model, state = plant[0], memory[0]
    finite = hold_rates(model, state, tick, (0.0, 0.0, 0.0, 0.0), applied)
    if model['command_interface'] != VELOCITY:
        for i in range(AXES):
            applied[i] = 0.0
            state['driven'][i] = 0.0
    observe(model, state, delayed, tick + 1, position, velocity)
    return finite and is_measured(position, velocity)


@kernel
def plant_start(
    plant: Any,
    memory: Any,
    delayed: Any,
    com_offset: float,
    pose: Any,
    joints: Any,
    rates: Any,
    position: Any,
    velocity: Any,
) -> bool:
    """Set the true state and measure it at tick 0; tell whether all of it is finite.

    The state is that of a pose (x_C, y_C, yaw), joint angles (4) and their rates (4).
    """
    model, state = plant[0], memory[0]
    s0, c0 = sin_cos(pose[2])
    start = PlantState(
        pose[0] - com_offset * c0,
        pose[1] - com_offset * s0,
        pose[2],
        joints[0],
        joints[1],
        joints[2],
        joints[3],
        rates[0],
        rates[1],
        rates[2],
        rates[3],
    )
    for i in range(AXES):
        state['wound'][i] = 0.0
        state['driven'][i] = 0.0
    store_state(as_geometry(model['geometry']), start, state['position'], state['velocity'])
    observe(model, state, delayed, 0, position, velocity)
    return is_measured(position, velocity)
