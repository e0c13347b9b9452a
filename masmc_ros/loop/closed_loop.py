# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Compiled kernels of the closed loop: controller tick, plant tick and whole simulations.

Python enters compiled control code only through the kernels in this module. The ROS 2 nodes and
plug-in laws call the single-tick kernels once per control period. Offline simulation calls
`closed_loop`, which computes many ticks, and many independent runs ("lanes"), in one call.
`reduced_loop` does the same for campaigns and keeps no signals. All
kernels use the same formulas, so live and offline runs are bitwise identical.

The kernels share these arguments. Each is an array of one record, except `delay_line`:

settings, memory
    Controller settings, and controller state carried from one tick to the next.
plant_settings, plant_memory
    Plant settings, and plant state carried from one tick to the next.
delay_line
    Ring buffers of delayed measurements and commands, see `plant_model.measurement.measure`.
signals
    Signals of the current tick, see `loop.signals.SIGNALS`.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Integers, Numbers, Record, Records
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import formula, kernel, kernel_of_threads, large_part
from masmc_ros.jit.lanes import lane_of, shared
from masmc_ros.jit.record import copied, copy_to, lane_count
from masmc_ros.jit.tuples import dot, elementwise, joined, tail, thirds
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.law import law
from masmc_ros.law.parts import delay_compensation, joint_limits
from masmc_ros.law.parts.delay_prediction import State
from masmc_ros.law.parts.joint_limits import within_limits
from masmc_ros.law.parts.velocity_estimator import estimate_rates
from masmc_ros.loop.control import control, control_by_shortcut
from masmc_ros.loop.reduction import reduce_tick
from masmc_ros.plant_model.plant_tick import (
    advance,
    drive_step,
    observe,
    release,
    write_velocity,
)
from masmc_ros.robot import mechanism
import numpy as np

SINGULAR, NOT_FINITE = 1, 2
"""Status flags of `control_tick`: task close to singular; command contains NaN or infinity."""


# Controller kernels.


@kernel
def control_tick(
    settings: Records,
    memory: Records,
    signals: Records,
    position: Array,
    velocity: Array,
    reference: Array,
) -> int:
    """
    Compute one controller tick of one robot.

    Copies the inputs into `signals`, runs the control law and writes its results (torque, rates,
    error, surface, estimate) into `signals`.

    Parameters
    ----------
    settings, memory, signals
        Records of a single lane, see the module docstring.
    position, velocity
        Measured positions and velocities, in the order of `joint_states`.
    reference
        Reference position, velocity and acceleration of the task (3 * axes).

    Returns
    -------
    int
        Bitwise OR of `SINGULAR` and `NOT_FINITE`; 0 if neither applies.

    """
    row = lane_of(signals[0], 0)
    row.position = to_vector(position, row.position)
    row.velocity = to_vector(velocity, row.velocity)
    row.reference = to_vector(reference, row.reference)
    control(settings[0], memory[0], signals[0])
    check_workspace(signals[0])
    status = SINGULAR if row.singular != 0 else 0
    residual = finite_residual(row.torque) + finite_residual(row.rates)
    return status if residual == 0.0 else status | NOT_FINITE


@kernel
def control_ticks(settings: Records, memory: Records, signals: Records, positions: Array) -> None:
    """
    Compute one controller tick for each of several positions (n); see `masmc laws --cost`.

    Velocity and reference keep the values in `signals`.
    """
    row = lane_of(signals[0], 0)
    place = mark(row)
    for k in range(len(positions)):
        free(row, place)
        row.position = to_vector(positions[k], row.position)
        control(settings[0], memory[0], signals[0])
    check_workspace(row)


@kernel
def estimate_velocity(settings: Records, memory: Records, signals: Records) -> None:
    """Replace the velocities in `signals` by those of the velocity estimator."""
    gains, state, row = lane_of(settings[0], 0), lane_of(memory[0], 0), lane_of(signals[0], 0)
    estimate_rates(gains, state, row.position, gains.takes_rates == 0)
    model = mechanism.model_of(gains)
    posture = mechanism.posture(model, row.position)
    row.velocity = mechanism.position_rates(model, posture, state.rates)
    check_workspace(row)


@kernel
def predict_state(
    settings: Records, memory: Records, signals: Records, predicted: Records
) -> None:
    """
    Compensate latency for a plain-Python law.

    Reads the measured state and its reference in `signals` and writes those for the law into
    `predicted`.
    """
    gains, memory_lane = lane_of(settings[0], 0), lane_of(memory[0], 0)
    measured, row = lane_of(signals[0], 0), lane_of(predicted[0], 0)
    x, v, a = thirds(measured.reference)
    rates = tail(measured.velocity, memory_lane.rates)
    state = State(measured.position, rates, measured.velocity, (x, v, a))
    state = delay_compensation.state_of_torque(gains, memory_lane, state)
    row.position, row.velocity = state.position, state.position_rates
    row.reference = joined(joined(state.desired[0], state.desired[1]), state.desired[2])
    row.error = delay_compensation.error(gains, memory_lane, x, v, measured.error)
    check_workspace(row)


@kernel
def reduce_torque(
    settings: Records, memory: Records, signals: Records, predicted: Records
) -> None:
    """Reduce `raw_torque` of a plain-Python law by the estimated disturbance."""
    gains, row = lane_of(settings[0], 0), lane_of(signals[0], 0)
    posture = mechanism.posture(mechanism.model_of(gains), lane_of(predicted[0], 0).position)
    row.raw_torque = delay_compensation.reduced_torque(
        gains, lane_of(memory[0], 0), posture, row.raw_torque
    )
    check_workspace(row)


@kernel
def limit_torque(settings: Records, memory: Records, signals: Records) -> None:
    """Limit `raw_torque` of a plain-Python law as those of other laws; write `torque`."""
    gains, state, row = lane_of(settings[0], 0), lane_of(memory[0], 0), lane_of(signals[0], 0)
    before = state.commanded
    state.commanded = joint_limits.kept_torque(
        gains,
        state,
        mechanism.posture(mechanism.model_of(gains), row.position),
        tail(row.position, before),
        tail(row.velocity, before),
        before,
        within_limits(gains, row.raw_torque, before),
    )
    row.torque = state.commanded
    check_workspace(row)


@kernel
def post_update(settings: Records, memory: Records) -> None:
    """Project the adapted parameters after a change of parameters, in all lanes."""
    for lane in range(lane_count(settings[0])):
        law.post_update(lane_of(settings[0], lane), lane_of(memory[0], lane))
    check_workspace(settings[0])


# Plant kernels.


@kernel
def plant_tick(
    plant_settings: Records, plant_memory: Records, delay_line: Array, tick: int, signals: Records
) -> bool:
    """
    Advance the plant by one control period under the command in `signals`.

    On entry `signals` holds the state of `tick` and the command that answers it; on return it
    holds the state of `tick + 1`.

    Returns
    -------
    bool
        True if the new state is finite.

    """
    plant, memory, row = shared(plant_settings[0]), shared(plant_memory[0]), shared(signals[0])
    _plant_step(plant, memory, delay_line, tick, row)
    return is_finite(row)


@kernel
def plant_hold(
    plant_settings: Records, plant_memory: Records, delay_line: Array, tick: int, signals: Records
) -> bool:
    """
    Advance the plant by one control period without a command: the drives hold the joints.

    The drives regulate the joint rates to zero within the motor limits. With torque commands the
    reported `applied` torque is zero, because the holding torque is internal to the drives.
    Arguments and return value are those of `plant_tick`.
    """
    plant, memory, row = shared(plant_settings[0]), shared(plant_memory[0]), shared(signals[0])
    advance(plant, memory, delay_line, tick, row, True)
    observe(plant, memory, delay_line, tick + 1, row)
    return is_finite(row)


@kernel
def plant_drive(
    plant_settings: Records,
    plant_memory: Records,
    delay_line: Array,
    tick: int,
    step: int,
    signals: Records,
    hold: bool,
) -> None:
    """
    Compute drive and disturbance torques over one step of an externally integrated plant.

    Reads the joint rates at the start of the step from `rates` of `plant_memory` and writes
    `driven` and `disturbance` there. Step 0 of a tick takes over the command in `signals`, or
    none if `hold` is true.
    """
    plant, memory, row = shared(plant_settings[0]), shared(plant_memory[0]), shared(signals[0])
    drive_step(plant, memory, delay_line, tick, step, row, hold)
    check_workspace(row)


@kernel
def plant_observe(
    plant_settings: Records,
    plant_memory: Records,
    delay_line: Array,
    tick: int,
    signals: Records,
    hold: bool,
) -> bool:
    """
    Measure the state of an externally integrated plant at the end of a tick.

    Returns
    -------
    bool
        True if the state is finite.

    """
    plant, memory, row = shared(plant_settings[0]), shared(plant_memory[0]), shared(signals[0])
    release(plant, memory, row, hold)
    observe(plant, memory, delay_line, tick, row)
    return is_finite(row)


@kernel
def plant_start(
    plant_settings: Records, plant_memory: Records, delay_line: Array, signals: Records
) -> bool:
    """
    Measure the initial state (tick 0) from positions and joint rates in `plant_memory`.

    Returns
    -------
    bool
        True if the state is finite.

    """
    plant, memory, row = shared(plant_settings[0]), shared(plant_memory[0]), shared(signals[0])
    write_velocity(plant, memory)
    # A literal 0 would make Numba compile a second specialisation of `observe`.
    first = np.int64(0)
    observe(plant, memory, delay_line, first, row)  # type: ignore[arg-type]  # compiled as int
    return is_finite(row)


# Kernels of plants that are driven by torques from outside of the package.


@kernel
def track_reference(
    plant_settings: Records, nominal: Records, signals: Records, reference: Array, tracked: Records
) -> None:
    """
    Write the reference of a tick, and the tracking of it by the state in `signals`.

    Parameters
    ----------
    plant_settings, signals
        See the module docstring; writes `reference` and `error` of `signals`.
    nominal
        Record like `plant_settings` with the lengths that the controller assumes.
    reference
        Reference of the tick (3 * axes), shared by all lanes.
    tracked
        Output, record of `loop.signals.TRACKED`.

    """
    write_reference(signals[0], reference)
    for lane in range(lane_count(signals[0])):
        row, out = lane_of(signals[0], lane), lane_of(tracked[0], lane)
        x, v, a = thirds(row.reference)
        model = mechanism.model_of(lane_of(nominal[0], lane))
        posture = mechanism.posture(model, row.position)
        motion = mechanism.motion(model, tail(row.velocity, row.torque))
        follows = mechanism.tracking(model, posture, row.position, motion, (x, v, a))
        row.error = follows.error
        out.velocity_error = follows.velocity_error
        model = mechanism.model_of(lane_of(plant_settings[0], lane))
        posture = mechanism.posture(model, row.true_position)
        out.true_error = mechanism.task_error(model, posture, row.true_position, x)
    check_workspace(signals[0])


@kernel
def reduce_signals(
    reduced: Records,
    signals: Records,
    points: Integers,
    settling: Array,
    first: int,
    start: int,
    end: int,
) -> None:
    """Add the signals (n) of tick `first` and the following ones to the reduced ones."""
    for k in range(len(signals)):
        reduce_tick(reduced[0], signals[k], points, settling, first + k, start, end)


# Checks for NaN and infinity.


@formula
def is_finite(signals: Record) -> bool:
    """
    Return True if the true state and the measured state are finite in all lanes.

    Both are checked: the measured state can be non-finite while the true state is finite,
    because the sine of an angle beyond 1e9 rad is not defined.
    """
    residual = 0.0
    for lane in range(lane_count(signals)):
        row = lane_of(signals, lane)
        for values in (row.position, row.velocity, row.true_position, row.true_velocity):
            residual += finite_residual(values)
    check_workspace(signals)
    return residual == 0.0


@formula
def finite_residual(values: Numbers) -> float:
    """Return 0.0 if all values are finite, NaN otherwise; branch-free, so it vectorises."""
    return dot(elementwise(_self_difference, values), values)


@formula
def _self_difference(value: float) -> float:
    """Return value - value: 0.0 if finite, NaN otherwise."""
    return value - value


# Whole simulations.


@large_part
def _plant_step(
    plant_settings: Record, plant_memory: Record, delay_line: Array, tick: int, signals: Record
) -> None:
    advance(plant_settings, plant_memory, delay_line, tick, signals, False)
    observe(plant_settings, plant_memory, delay_line, tick + 1, signals)


@kernel_of_threads
def closed_loop(
    plant_settings: Records,
    plant_memory: Records,
    delay_line: Array,
    settings: Records,
    memory: Records,
    signals: Records,
    first: int,
    final: bool,
    reference: Array,
    history: Records,
) -> bool:
    """
    Simulate ticks `first` to `first + n - 1` in all lanes and record their signals.

    Parameters
    ----------
    plant_settings, plant_memory, delay_line, settings, memory
        See the module docstring.
    signals
        State at tick `first` on entry, state at tick `first + n` on return.
    first
        Number of the first tick.
    final
        True if this call ends the run: the command of the last tick is computed, not applied.
    reference
        Reference of each tick (n, 3 * axes), shared by all lanes.
    history
        Output, signals of each tick (n).

    Returns
    -------
    bool
        With a single lane, True if all commands and true positions are finite. With several
        lanes the check is skipped and the result is always True.

    """
    # Copies on the stack: the compiler then knows that nothing else refers to them.
    plant_constants, plant_state = copied(plant_settings[0]), copied(plant_memory[0])
    gains, control_state, row = copied(settings[0]), copied(memory[0]), copied(signals[0])
    n, residual, place = len(reference), 0.0, mark(row)
    for k in range(n):
        free(row, place)
        write_reference(row, reference[k])
        control(gains, control_state, row)
        copy_to(row, history[k])
        # Summing over several lanes would serialise them.
        if lane_count(row) == 1:
            single = lane_of(row, 0)
            residual += finite_residual(single.torque)
            residual += finite_residual(single.rates)
            residual += finite_residual(single.true_position)
        if final and k == n - 1:
            break
        _plant_step(
            shared(plant_constants), shared(plant_state), delay_line, first + k, shared(row)
        )
    copy_to(plant_state, plant_memory[0])
    copy_to(control_state, memory[0])
    copy_to(row, signals[0])
    check_workspace(row)
    return residual == 0.0


@kernel_of_threads
def reduced_loop(
    plant_settings: Records,
    plant_memory: Records,
    delay_line: Array,
    settings: Records,
    memory: Records,
    signals: Records,
    first: int,
    final: bool,
    reference: Array,
    shortcut: Records | None,
    reduced: Records,
    points: Integers,
    settling: Array,
    start: int,
    end: int,
) -> None:
    """
    Simulate ticks as `closed_loop` does, and reduce their signals instead of recording them.

    Parameters
    ----------
    plant_settings, plant_memory, delay_line, settings, memory, signals
        See `closed_loop`.
    first, final, reference
        See `closed_loop`.
    shortcut
        The settings with the shortcut of the reaching term, see
        `loop.control.control_by_shortcut`, or None. The results are the same.
    reduced, points, settling, start, end
        See `loop.reduction.reduce_tick`.

    """
    plant_constants, plant_state = copied(plant_settings[0]), copied(plant_memory[0])
    gains, control_state, row = copied(settings[0]), copied(memory[0]), copied(signals[0])
    sums = copied(reduced[0])
    # The compiler removes the branches of a missing shortcut.
    if shortcut is not None:
        fast_gains, state_before = copied(shortcut[0]), copied(memory[0])
    n, place = len(reference), mark(row)
    for k in range(n):
        free(row, place)
        write_reference(row, reference[k])
        if shortcut is None:
            control(gains, control_state, row)
        else:
            control_by_shortcut(fast_gains, gains, control_state, state_before, row)
        reduce_tick(sums, row, points, settling, first + k, start, end)
        if final and k == n - 1:
            break
        _plant_step(
            shared(plant_constants), shared(plant_state), delay_line, first + k, shared(row)
        )
    copy_to(plant_state, plant_memory[0])
    copy_to(control_state, memory[0])
    copy_to(row, signals[0])
    copy_to(sums, reduced[0])
    check_workspace(row)


@formula
def write_reference(signals: Record, reference: Array) -> None:
    """Write the reference of one tick (3 * axes) into all lanes of `signals`."""
    desired = to_vector(reference, lane_of(signals, 0).reference)
    for lane in range(lane_count(signals)):
        lane_of(signals, lane).reference = desired
