# SPDX-License-Identifier: Apache-2.0
"""A stretch of the closed loop in compiled code: control tick, plant tick, and so on."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import kernel
from masmc_ros.control.command_interface import VELOCITY
from masmc_ros.loop.control_tick import control, workspace
from masmc_ros.loop.plant_tick import hold_command, observe
from masmc_ros.robot import AXES, BASE_PARAMETERS


@kernel
def closed_loop(
    plant: Any,
    plant_memory: Any,
    delayed: Any,
    settings: Any,
    memory: Any,
    first: int,
    final: bool,
    reference: Any,
    true_position: Any,
    true_velocity: Any,
    position: Any,
    velocity: Any,
    effort: Any,
    raw_torque: Any,
    torque: Any,
    rates: Any,
    error: Any,
    surface: Any,
    estimates: Any,
) -> int:
    """Run ticks first ... first + n - 1 and return at how many the arm was close to singular.

    Records and `delayed` as in `control_tick` and `plant_tick`. Rows are ticks: `reference`
    (n, 12) is read; row 0 of the states (n + 1, 7), true and measured, and of `effort`
    (n + 1, 4) is what is so at the start, the rest is written, and `raw_torque`, `torque`,
    `error`, `surface` (n, 4) and `estimates` (n, 7) with it. When `final`, the last tick's
    command is computed and not applied, so that row n of the states stays unwritten. With
    commanded rates they are written to `rates` (n, 4), which is not touched else. A plant
    that is measured exactly needs no true states apart: pass the measured ones twice.
    """
    model, state = plant[0], plant_memory[0]
    gains, state_of_law = settings[0], memory[0]
    commands_rates = gains['command_interface'] == VELOCITY
    work = workspace()
    n = len(reference)
    singular = 0
    for k in range(n):
        for j in range(BASE_PARAMETERS):
            estimates[k, j] = state_of_law['estimate'][j]
        if control(
            gains,
            state_of_law,
            position[k],
            velocity[k],
            reference[k],
            raw_torque[k],
            torque[k],
            error[k],
            surface[k],
            work,
        ):
            singular += 1
        if commands_rates:
            for i in range(AXES):
                rates[k, i] = state_of_law['velocity_command'][i]
        if final and k == n - 1:
            break
        if commands_rates:
            hold_command(model, state, first + k, rates[k], effort[k + 1])
        else:
            hold_command(model, state, first + k, torque[k], effort[k + 1])
        observe(model, state, delayed, first + k + 1, position[k + 1], velocity[k + 1])
        if not model['is_exact']:
            for i in range(7):
                true_position[k + 1, i] = state['position'][i]
                true_velocity[k + 1, i] = state['velocity'][i]
    return singular
