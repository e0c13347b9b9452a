# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
One tick of the plant in all lanes, from a command to the next true and measured state.

Arguments of several functions: `plant` and `memory` have `PlantSettings` and `PlantMemory`,
`signals` those of the tick, each with all lanes. `delay_line` (maximum delay + 2, positions,
velocities and commands) has the delayed values of each lane. `holds` is True for a void command.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Numbers, Record
from masmc_ros.jit.compiled import formula, inlined
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count
from masmc_ros.jit.scratch import scratch
from masmc_ros.jit.tuples import column, elementwise
from masmc_ros.jit.vectors import free, mark
from masmc_ros.numerics.scalars import limited, minus, plus, selected, zero
from masmc_ros.plant_model.disturbance import (
    moment,
    push_by_waves,
    shares_waves,
    waves_of_step,
    write_push,
    write_waves,
)
from masmc_ros.plant_model.drives import drive, lagging
from masmc_ros.plant_model.joint_effects import (
    has_losses,
    is_elastic,
    rotor_rates,
    stuck,
    twist_joints,
    untwist_joints,
)
from masmc_ros.plant_model.measurement import delay_measurement, measure, receive, write_noise
from masmc_ros.plant_model.motion import runge_kutta_stage
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings, Signals
from masmc_ros.robot import mechanism


@formula
def _share(total: float, value: float, steps: float) -> float:
    return total + value / steps


@formula
def _hold_rates(
    plant: PlantSettings, memory: PlantMemory, signals: Signals, h: float, steps: int, holds: bool
) -> None:
    """Advance the drives, which follow the commanded rates, by one step of h seconds."""
    model = mechanism.model_of(plant)
    followed = elementwise(
        lagging,
        memory.commanded_rates,
        memory.followed_rates,
        plant.base_decay,
        1,
    )
    memory.followed_rates = followed
    commanded = mechanism.commanded_joint_rates(model, followed)
    missing = elementwise(minus, commanded, rotor_rates(plant, memory))
    driven = elementwise(
        drive,
        missing,
        memory.drive_integral,
        plant.inertia,
        plant.bandwidth,
        plant.limit,
        h,
    )
    torque, integral = column(driven, 0), column(driven, 1)
    acting = elementwise(lagging, torque, memory.motor, plant.lag_decay, 1)
    applied = elementwise(_share, signals.applied, acting, steps)
    if (plant.is_hybrid != 0) & (not holds):
        mask = plant.by_velocity
        torque = elementwise(selected, mask, torque, memory.target)
        integral = elementwise(selected, mask, integral, elementwise(zero, integral))
        applied = elementwise(selected, mask, applied, signals.applied)
    memory.target = torque
    memory.driven = torque
    memory.drive_integral = integral
    signals.applied = applied


@formula
def _limited_command(plant: PlantSettings, memory: PlantMemory) -> Numbers:
    """Return the torque that has arrived, within the limits of the motors."""
    return elementwise(
        limited,
        memory.torque,
        memory.target,
        plant.limit,
        plant.rate_limit,
        plant.period,
    )


@formula
def take_command(plant: Record, memory: Record, signals: Record, holds: bool) -> None:
    """
    Apply the command that has arrived for one period; a void command if `holds`.

    It writes `target`, `driven` and `applied`: torques within the motor limits. With commanded
    rates, the drives update them at every step.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant.
    signals
        Signals of the tick; `applied` (joints) in N·m is written.
    holds
        True for a void command.

    """
    lanes = lane_count(plant)
    # Conditions that are equal in all lanes stay outside of the loops, so these vectorise.
    first = lane_of(plant, 0)
    if (first.takes_rates != 0) | holds:
        for lane in range(lanes):
            row = lane_of(signals, lane)
            row.applied = elementwise(zero, row.torque)
            if holds:
                row.rates = elementwise(zero, row.torque)
        if (first.is_hybrid != 0) & (not holds):
            for lane in range(lanes):
                robot, state = lane_of(plant, lane), lane_of(memory, lane)
                held = _limited_command(robot, state)
                nothing = elementwise(zero, held)
                lane_of(signals, lane).applied = elementwise(
                    selected, robot.by_velocity, nothing, held
                )
                state.target = elementwise(selected, robot.by_velocity, state.target, held)
    else:
        for lane in range(lanes):
            state = lane_of(memory, lane)
            held = _limited_command(lane_of(plant, lane), state)
            lane_of(signals, lane).applied = held
            state.target = held
            state.driven = held
            state.drive_integral = elementwise(zero, held)


@formula
def _commands_torques(plant: Record, holds: bool) -> bool:
    """Return True if at least some joints are driven by commanded torques."""
    first = lane_of(plant, 0)
    return (not holds) & ((first.takes_rates == 0) | (first.is_hybrid != 0))


@formula
def release(plant: Record, memory: Record, signals: Record, holds: bool) -> None:
    """
    After a void command, set the holding torque of drives to zero if torques are commanded.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant.
    signals
        Signals of the tick.
    holds
        True for a void command; otherwise nothing is changed.

    """
    if holds & _commands_torques(plant, False):
        for lane in range(lane_count(plant)):
            row, state = lane_of(signals, lane), lane_of(memory, lane)
            row.applied = elementwise(zero, row.torque)
            state.target = row.applied
            state.driven = row.applied


@formula
def _mean(target: float, motor: float, share: float) -> float:
    """Return the mean torque of a lagging motor over a period."""
    return target + share * (motor - target)


@formula
def _report_mean(plant: PlantSettings, memory: PlantMemory, signals: Signals) -> None:
    """Write the mean torque of lagging motors under a commanded torque as `applied`."""
    applied = elementwise(_mean, memory.target, memory.motor, plant.lag_mean)
    # Drives that follow velocities add their torques at every step.
    mask = plant.by_velocity
    signals.applied = elementwise(selected, mask, elementwise(zero, applied), applied)


@formula
def _stick(plant: PlantSettings, memory: PlantMemory, h: float) -> None:
    """Write the torque of stiction over a step of h seconds."""
    bristles = elementwise(
        stuck,
        memory.deflection,
        rotor_rates(plant, memory),
        plant.stiction,
        plant.stiction_velocity,
        plant.bristle_stiffness,
        plant.bristle_damping,
        h,
    )
    memory.deflection = column(bristles, 0)
    memory.stiction = column(bristles, 1)


@formula
def _lag(plant: PlantSettings, memory: PlantMemory, halves: int) -> None:
    """Write `driven` after 0, 1 or 2 half steps; the last ends the step of the motors."""
    motor = elementwise(lagging, memory.target, memory.motor, plant.lag_decay, halves)
    if halves == 2:
        memory.motor = motor
    memory.driven = elementwise(plus, motor, memory.stiction)


@formula
def drive_step(
    plant: Record,
    memory: Record,
    delay_line: Array,
    tick: int,
    step: int,
    signals: Record,
    holds: bool,
) -> None:
    """
    Write the joint torques `driven` and `disturbance` over one step of an external integrator.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant.
    delay_line
        Delayed values of each lane.
    tick
        Tick of the period.
    step
        Number of the step in the period, from 0; the command is taken in step 0.
    signals
        Signals of the tick, with the command; `applied` is written.
    holds
        True for a void command.

    """
    first = lane_of(plant, 0)
    steps, period = first.steps, first.period
    h = period / steps
    lanes, loses = lane_count(plant), has_losses(plant)
    takes_rates = (first.takes_rates != 0) | holds
    if step == 0:
        receive(plant, memory, delay_line, tick, signals, holds)
        take_command(plant, memory, signals, holds)
    for lane in range(lanes):
        robot, state, row = lane_of(plant, lane), lane_of(memory, lane), lane_of(signals, lane)
        if loses & (step == 0) & _commands_torques(plant, holds):
            _report_mean(robot, state, row)
        if takes_rates:
            _hold_rates(robot, state, row, h, steps, holds)
        if loses:
            _stick(robot, state, h)
            _lag(robot, state, 1)
            middle = state.driven
            _lag(robot, state, 2)
            state.driven = middle
    write_push(plant, memory, moment(tick * period, step, 1, h))


@inlined
def advance(
    plant: Record, memory: Record, delay_line: Array, tick: int, signals: Record, holds: bool
) -> None:
    """
    Advance the true state by one period with the command in `signals`.

    It writes the torque of the motors as `applied`: within their limits the command itself, or the
    mean torque of motors that lag and of drives that follow velocities. With a void command, the
    drives hold the joints at zero velocity, and the applied torque is zero.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant.
    delay_line
        Delayed values of each lane.
    tick
        Tick of the period, which starts at tick times period.
    signals
        Signals of the tick.
    holds
        True for a void command.

    """
    lanes, first = lane_count(plant), lane_of(plant, 0)
    steps, period = first.steps, first.period
    takes_rates = (first.takes_rates != 0) | holds
    loses, twists = has_losses(plant), is_elastic(plant)
    time = tick * period
    h = period / steps
    waves = scratch(waves_of_step(plant))
    shares = shares_waves(plant)
    receive(plant, memory, delay_line, tick, signals, holds)
    take_command(plant, memory, signals, holds)
    if loses & _commands_torques(plant, holds):
        for lane in range(lanes):
            robot, state = lane_of(plant, lane), lane_of(memory, lane)
            _report_mean(robot, state, lane_of(signals, lane))
    for lane in range(lanes):
        state = lane_of(memory, lane)
        state.reached = state.position
        state.reached_rates = state.rates
    if twists:
        for lane in range(lanes):
            state = lane_of(memory, lane)
            state.reached_rotors = state.rotor_angles
            state.reached_rotor_rates = state.rotor_rates
    place = mark(plant)
    for step in range(steps):
        free(plant, place)
        if takes_rates:
            for lane in range(lanes):
                robot, state = lane_of(plant, lane), lane_of(memory, lane)
                _hold_rates(robot, state, lane_of(signals, lane), h, steps, holds)
        if loses:
            for lane in range(lanes):
                robot, state = lane_of(plant, lane), lane_of(memory, lane)
                _stick(robot, state, h)
                _lag(robot, state, 0)
        if shares:
            write_waves(plant, time, step, h, waves)
        for stage in range(4):
            # The disturbance at the start of a later step is that at the end of the previous one.
            if (stage == 1) | (stage == 3) | (step + stage == 0):
                halves = (stage + 1) // 2
                if shares:
                    push_by_waves(plant, memory, halves, waves)
                else:
                    write_push(plant, memory, moment(time, step, halves, h))
            if loses & ((stage == 1) | (stage == 3)):
                for lane in range(lanes):
                    _lag(lane_of(plant, lane), lane_of(memory, lane), (stage + 1) // 2)
            if twists:
                for lane in range(lanes):
                    twist_joints(lane_of(plant, lane), lane_of(memory, lane), stage, h)
            for lane in range(lanes):
                runge_kutta_stage(lane_of(plant, lane), lane_of(memory, lane), stage, h)
            if twists:
                for lane in range(lanes):
                    untwist_joints(lane_of(memory, lane))
        for lane in range(lanes):
            state = lane_of(memory, lane)
            state.position = state.reached
            state.rates = state.reached_rates
    write_velocity(plant, memory)
    release(plant, memory, signals, holds)


@formula
def write_velocity(plant: Record, memory: Record) -> None:
    """Write `velocity`, the derivatives of the true positions (positions)."""
    for lane in range(lane_count(plant)):
        state, model = lane_of(memory, lane), mechanism.model_of(lane_of(plant, lane))
        posture = mechanism.posture(model, state.position)
        state.velocity = mechanism.position_rates(model, posture, state.rates)


@formula
def observe(plant: Record, memory: Record, delayed: Array, tick: int, signals: Record) -> None:
    """
    Write the true state and its measurement into `signals`.

    Parameters
    ----------
    plant, memory
        Settings and memory of the plant.
    delayed
        Delayed values of each lane.
    tick
        Current tick.
    signals
        Signals of the tick; true and measured `position` and `velocity` (positions) are written.

    """
    lanes, inexact, delays = lane_count(plant), 0, 0
    for lane in range(lanes):
        state, row = lane_of(memory, lane), lane_of(signals, lane)
        row.true_position = row.position = state.position
        row.true_velocity = row.velocity = state.velocity
    for lane in range(lanes):
        robot = lane_of(plant, lane)
        inexact += 1 - robot.is_exact
        delays += robot.delay + int(robot.measurement_loss > 0.0)
    # A vectorised loop computes all lanes or none.
    if inexact > 0:
        write_noise(plant, memory, tick)
        for lane in range(lanes):
            measure(lane_of(plant, lane), lane_of(memory, lane), tick, lane_of(signals, lane))
    if delays > 0:
        for lane in range(lanes):
            robot, state = lane_of(plant, lane), lane_of(memory, lane)
            row = lane_of(signals, lane)
            delay_measurement(robot, state, lane_of(delayed, lane), tick, row)
