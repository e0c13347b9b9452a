# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The closed loop in compiled code: single ticks for the nodes, stretches of runs in lanes."""

from __future__ import annotations

from typing import Any

from masmc_ros.law import law
from masmc_ros.law.parts.command_limits import within_limits
from masmc_ros.law.parts.velocity_estimator import estimate_rates
from masmc_ros.loop.control import control
from masmc_ros.numerics.arrays import to_vector
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.record import copied, copy_to, get, lane_count, put
from masmc_ros.numerics.tuples import dot, elementwise
from masmc_ros.robot import mechanism
from masmc_ros.robot.plant.tick import (
    advance,
    drive_step,
    observe,
    release,
    write_velocity,
)
import numpy as np

SINGULAR, NOT_FINITE = 1, 2
"""Flags of the status of a tick: task close to singular; torque not finite."""


@kernel
def control_tick(
    settings: Any, memory: Any, now: Any, position: Any, velocity: Any, reference: Any
) -> int:
    """
    Compute one tick of the law; return the flags SINGULAR and NOT_FINITE.

    The first three arguments are arrays of one record: of the law's settings, of its memory,
    which the next tick takes up, and of the signals, where the state (positions) and the
    reference (3 axes) are written next to torque, rates, error, surface and estimate.
    """
    signal = now[0]
    put(signal, 'position', 0, to_vector(position, get(signal, 'position', 0)))
    put(signal, 'velocity', 0, to_vector(velocity, get(signal, 'velocity', 0)))
    put(signal, 'reference', 0, to_vector(reference, get(signal, 'reference', 0)))
    control(settings[0], memory[0], signal)
    found = SINGULAR if get(signal, 'singular', 0) != 0 else 0
    rest = _rest(get(signal, 'torque', 0)) + _rest(get(signal, 'rates', 0))
    return found if rest == 0.0 else found | NOT_FINITE


@kernel
def control_ticks(settings: Any, memory: Any, now: Any, positions: Any) -> None:
    """Compute a tick of the law at each of some positions (n), all else of the state as it is."""
    for k in range(len(positions)):
        put(now[0], 'position', 0, to_vector(positions[k], get(now[0], 'position', 0)))
        control(settings[0], memory[0], now[0])


@kernel
def estimate_velocity(settings: Any, memory: Any, now: Any) -> None:
    """Write the velocities in `now` as the estimator has them at the positions in it."""
    gains, position = settings[0], get(now[0], 'position', 0)
    knows = get(gains, 'takes_rates', 0) == 0
    estimate_rates(gains, memory[0], position, 0, knows)
    model = mechanism.model_of(gains, 0)
    rates = get(memory[0], 'rates', 0)
    posture = mechanism.posture(model, position)
    put(now[0], 'velocity', 0, mechanism.position_rates(model, posture, rates))


@kernel
def limit_torque(settings: Any, memory: Any, now: Any) -> None:
    """Write the torque of a law in plain Python, `raw_torque`, within its limits."""
    raw, gains = get(now[0], 'raw_torque', 0), settings[0]
    torque = within_limits(gains, raw, get(memory[0], 'commanded', 0), 0)
    put(memory[0], 'commanded', 0, torque)
    put(now[0], 'torque', 0, torque)


@kernel
def post_update(settings: Any, memory: Any) -> None:
    """Let what was learned comply with parameters that have just changed."""
    for lane in range(lane_count(settings[0])):
        law.post_update(settings[0], memory[0], lane)


@kernel
def plant_tick(plant: Any, memory: Any, delayed: Any, tick: int, now: Any) -> bool:
    """
    Advance the plant by one control period; return True if its state is finite.

    The signals' command answers the state of `tick`; their state becomes that of the next.
    """
    advance(plant[0], memory[0], tick, now[0], False)
    observe(plant[0], memory[0], delayed, tick + 1, now[0])
    return is_finite(now[0])


@kernel
def plant_hold(plant: Any, memory: Any, delayed: Any, tick: int, now: Any) -> bool:
    """
    Advance the plant by one control period without a command: its drives hold.

    They do as with rates of zero, within the motors' limits. Arguments as in `plant_tick`;
    where torques are commanded, none of them is applied meanwhile: what the drives make to hold
    is their own.
    """
    advance(plant[0], memory[0], tick, now[0], True)
    observe(plant[0], memory[0], delayed, tick + 1, now[0])
    return is_finite(now[0])


@kernel
def plant_drive(
    plant: Any, memory: Any, tick: int, step: int, now: Any, holds: bool
) -> None:
    """
    Write the torques over one step of a plant that is integrated elsewhere.

    They are `driven` and `disturbance` of the memory; its `rates` are those at the step's start;
    the first step of a tick uses the command of the signals, no command if `holds`.
    """
    drive_step(plant[0], memory[0], tick, step, now[0], holds)


@kernel
def plant_observe(
    plant: Any, memory: Any, delayed: Any, tick: int, now: Any, holds: bool
) -> bool:
    """Measure the state in the memory of such a plant; return True if it is finite."""
    release(plant[0], memory[0], now[0], holds)
    observe(plant[0], memory[0], delayed, tick, now[0])
    return is_finite(now[0])


@kernel
def plant_start(plant: Any, memory: Any, delayed: Any, now: Any) -> bool:
    """Measure the state at tick 0 from the positions and the joints' rates in the memory."""
    write_velocity(plant[0], memory[0])
    # Not the literal, for which the compiler would make code of its own.
    observe(plant[0], memory[0], delayed, np.int64(0), now[0])
    return is_finite(now[0])


@formula
def is_finite(now: Any) -> bool:
    """
    Return True if the true and the measured state consist of finite numbers.

    Of a finite true state it need not: beyond 1e9 rad an angle has no sine.
    """
    total = 0.0
    for lane in range(lane_count(now)):
        for values in (
            get(now, 'position', lane),
            get(now, 'velocity', lane),
            get(now, 'true_position', lane),
            get(now, 'true_velocity', lane),
        ):
            total += _rest(values)
    return total == 0.0


@formula
def _rest(values: Any) -> float:
    """Return zero for numbers that all are finite, not-a-number for any other."""
    return dot(elementwise(_nothing, values), values)


@formula
def _nothing(value: float) -> float:
    return value - value


@kernel
def closed_loop(
    plant: Any,
    plant_memory: Any,
    delayed: Any,
    settings: Any,
    memory: Any,
    now: Any,
    first: int,
    final: bool,
    reference: Any,
    signals: Any,
) -> bool:
    """
    Run ticks first ... first + n - 1, in all lanes, and keep their signals (n).

    Of a single lane, returns whether its commands and true positions all were finite.

    Records as in `control_tick` and `plant_tick`; `now` holds the state at the first tick and
    is left with that of the tick after the last. `reference` (n, 3 axes) is that of every
    lane. When `final`, the last tick's command is computed and not applied.
    """
    plant_of_all, state = copied(plant[0]), copied(plant_memory[0])
    gains, learned, signal = copied(settings[0]), copied(memory[0]), copied(now[0])
    n, rest = len(reference), 0.0
    for k in range(n):
        write_reference(signal, reference[k])
        control(gains, learned, signal)
        copy_to(signal, signals[k])
        # Not of many lanes, which would have to wait for one another's sums.
        if lane_count(signal) == 1:
            rest += _rest(get(signal, 'torque', 0))
            rest += _rest(get(signal, 'rates', 0))
            rest += _rest(get(signal, 'true_position', 0))
        if final and k == n - 1:
            break
        advance(plant_of_all, state, first + k, signal, False)
        observe(plant_of_all, state, delayed, first + k + 1, signal)
    copy_to(state, plant_memory[0])
    copy_to(learned, memory[0])
    copy_to(signal, now[0])
    return rest == 0.0


@formula
def write_reference(signal: Any, reference: Any) -> None:
    """Write a tick's reference into all lanes."""
    desired = to_vector(reference, get(signal, 'reference', 0))
    for lane in range(lane_count(signal)):
        put(signal, 'reference', lane, desired)
