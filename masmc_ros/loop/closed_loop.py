# SPDX-License-Identifier: Apache-2.0
"""A stretch of the closed loop in compiled code: control tick, plant tick, and so on."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import kernel
from masmc_ros.control.limits import clipped
from masmc_ros.loop.arrays import as_base_parameters, as_geometry
from masmc_ros.loop.control_tick import control, workspace
from masmc_ros.loop.plant import advance, load_state, store_state
from masmc_ros.robot import AXES, BASE_PARAMETERS


@kernel
def closed_loop(
    geometry: Any,
    theta: Any,
    amplitude: Any,
    frequency: Any,
    phase: Any,
    limit: Any,
    steps: int,
    settings: Any,
    memory: Any,
    first: int,
    final: bool,
    reference: Any,
    position: Any,
    velocity: Any,
    effort: Any,
    raw_torque: Any,
    torque: Any,
    error: Any,
    surface: Any,
    estimates: Any,
) -> int:
    """Run ticks first ... first + n - 1 and return at how many the arm was close to singular.

    Arguments as in `control_tick` and `plant_tick`. Rows are ticks: `reference` (n, 12) is
    read; row 0 of `position`, `velocity` (n + 1, 7) and `effort` (n + 1, 4) is the state
    at the start, the rest is written, and `raw_torque`, `torque`, `error`, `surface` (n, 4) and
    `estimates` (n, 7) with it. When `final`, the last tick's command is computed and not
    applied, so that row n of the state stays unwritten.
    """
    lengths = as_geometry(geometry)
    base = as_base_parameters(theta)
    gains, state_of_law = settings[0], memory[0]
    period = gains['period']
    estimate = state_of_law['estimate']
    work = workspace()
    n = len(reference)
    singular = 0
    for k in range(n):
        for j in range(BASE_PARAMETERS):
            estimates[k, j] = estimate[j]
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
        if final and k == n - 1:
            break
        for i in range(AXES):
            effort[k + 1, i] = clipped(torque[k, i], limit[i])
        state = advance(
            lengths,
            base,
            load_state(position[k], velocity[k]),
            effort[k + 1],
            amplitude,
            frequency,
            phase,
            (first + k) * period,
            period,
            steps,
        )
        store_state(lengths, state, position[k + 1], velocity[k + 1])
    return singular
