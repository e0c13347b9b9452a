# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One tick of the plant in all lanes, from a command to the next true and measured state."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula, inlined
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.lanes import lane_of
from masmc_ros.numerics.limits import limited
from masmc_ros.numerics.record import lane_count
from masmc_ros.numerics.scalars import minus, zero
from masmc_ros.numerics.scratch import scratch
from masmc_ros.numerics.tuples import column, elementwise
from masmc_ros.plant_model.disturbance import (
    moment,
    push_by_waves,
    shares_waves,
    waves_of_step,
    write_push,
    write_waves,
)
from masmc_ros.plant_model.drives import drive
from masmc_ros.plant_model.measurement import delay_measurement, measure, write_noise
from masmc_ros.plant_model.motion import runge_kutta_stage
from masmc_ros.robot import mechanism

SETTINGS = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('theta', 'parameters', 'Its base inertial parameters'),
    Field('amplitude', 'joints', 'Disturbance torque', 'N·m'),
    Field('frequency', 'joints', 'Disturbance torque', 'rad/s'),
    Field('phase', 'joints', 'Disturbance torque', 'rad'),
    Field('limit', 'joints', "Limit of each motor's torque; 0: no limit", 'N·m'),
    Field('rate_limit', 'joints', 'Limit of its rate; 0: no limit', 'N·m/s'),
    Field('period', description='Control period, that of all lanes', unit='s'),
    Field('steps', description='Integration steps in a period, in all lanes', kind='i8'),
    Field('takes_rates', description='Whether rates are commanded, in all lanes', kind='i8'),
    Field('is_exact', description='Whether the state is measured as it is', kind='i8'),
    Field('resolution', 'joints', 'Step of the encoders; 0 is exact', 'rad'),
    Field('noise', 'joints', 'Standard deviation of the measured rates', 'rad/s'),
    Field('delay', description='Delay of the measurement in ticks', kind='i8'),
    Field('seed', description='Which noise it is', kind='i8'),
    Field('bandwidth', 'joints', "Of the drives' velocity loops", 'rad/s'),
    Field('inertia', 'joints', 'For which they are tuned', 'kg·m²'),
)
"""Settings of the plant: robot, disturbances and measurement."""

MEMORY = (
    Field('position', 'positions', 'True positions', 'm, rad'),
    Field('velocity', 'positions', 'Their derivatives', 'm/s, rad/s'),
    Field('rates', 'joints', 'True rates of the joints, the last of them again', 'rad/s'),
    Field('reached', 'positions', 'Positions at the stage of a step', 'm, rad'),
    Field('reached_rates', 'joints', 'Rates of the joints there', 'rad/s'),
    Field('slopes', 'positions', 'Sum of the derivatives of the positions so far'),
    Field('accelerations', 'joints', 'Sum of those of the rates', 'rad/s²'),
    Field('disturbance', 'joints', 'Disturbance torque at the time reached', 'N·m'),
    Field('driven', 'joints', 'Torque of the drives in the last interval', 'N·m'),
    Field('drive_integral', 'joints', "Integrals of the drives' velocity loops", 'N·m'),
    Field('odometry', 'base', "The base's pose by counting", 'm, rad'),
    Field('counted', 'joints', 'Angles counted so far', 'rad'),
    Field('standard_noise', 'joints', 'Standard normal numbers of the tick'),
)
"""Memory from tick to tick."""


@formula
def _share(total: float, value: float, steps: float) -> float:
    return total + value / steps


@formula
def _hold_rates(plant: Any, memory: Any, signals: Any, h: float, steps: int) -> None:
    """Advance the drives, which follow the commanded rates, by one step of h seconds."""
    model = mechanism.model_of(plant)
    commanded = mechanism.commanded_joint_rates(model, signals.rates)
    missing = elementwise(minus, commanded, memory.rates)
    integral, inertia = memory.drive_integral, plant.inertia
    driven = elementwise(drive, missing, integral, inertia, plant.bandwidth, plant.limit, h)
    memory.driven = column(driven, 0)
    memory.drive_integral = column(driven, 1)
    signals.applied = elementwise(_share, signals.applied, memory.driven, steps)


@formula
def take_command(plant: Any, memory: Any, signals: Any, holds: bool) -> None:
    """
    Use the command in `signals` for one period, none if `holds`.

    Writes `driven` and `applied`: torques within the motor limits. With commanded rates, the
    drives update both at every step.
    """
    lanes = lane_count(plant)
    # Conditions equal in all lanes are outside of the loops, which otherwise do not vectorise.
    first = lane_of(plant, 0)
    if (first.takes_rates != 0) | holds:
        for lane in range(lanes):
            row = lane_of(signals, lane)
            row.applied = elementwise(zero, row.torque)
            if holds:
                row.rates = elementwise(zero, row.torque)
    else:
        period = first.period
        for lane in range(lanes):
            robot, state, row = lane_of(plant, lane), lane_of(memory, lane), lane_of(signals, lane)
            held = elementwise(
                limited, row.torque, state.driven, robot.limit, robot.rate_limit, period
            )
            row.applied = held
            state.driven = held
            state.drive_integral = elementwise(zero, held)


@formula
def release(plant: Any, memory: Any, signals: Any, holds: bool) -> None:
    """Clear the torque of drives that held without a command, if torques are commanded."""
    if holds & (lane_of(plant, 0).takes_rates == 0):
        for lane in range(lane_count(plant)):
            row = lane_of(signals, lane)
            row.applied = elementwise(zero, row.torque)
            lane_of(memory, lane).driven = row.applied


@formula
def drive_step(
    plant: Any, memory: Any, tick: int, step: int, signals: Any, holds: bool
) -> None:
    """Write the joint forces over one step of an external integrator: `driven`, `disturbance`."""
    first = lane_of(plant, 0)
    steps, period = first.steps, first.period
    h = period / steps
    if step == 0:
        take_command(plant, memory, signals, holds)
    for lane in range(lane_count(plant)):
        if (first.takes_rates != 0) | holds:
            robot, state, row = lane_of(plant, lane), lane_of(memory, lane), lane_of(signals, lane)
            _hold_rates(robot, state, row, h, steps)
    write_push(plant, memory, moment(tick * period, step, 1, h))


@inlined
def advance(plant: Any, memory: Any, tick: int, signals: Any, holds: bool) -> None:
    """
    Advance the true state by one period with the command in `signals`; none if `holds`.

    Writes the torque that it comes to as `applied`: within the motors' limits the command
    itself, or the mean torque of drives that follow velocities. Without a command, the
    drives hold the joints at zero velocity; the applied torque is then zero.
    """
    lanes, first = lane_count(plant), lane_of(plant, 0)
    steps, period = first.steps, first.period
    takes_rates = (first.takes_rates != 0) | holds
    time = tick * period
    h = period / steps
    waves = scratch(waves_of_step(plant))
    shares = shares_waves(plant)
    take_command(plant, memory, signals, holds)
    for lane in range(lanes):
        state = lane_of(memory, lane)
        state.reached = state.position
        state.reached_rates = state.rates
    for step in range(steps):
        if takes_rates:
            for lane in range(lanes):
                robot, state = lane_of(plant, lane), lane_of(memory, lane)
                _hold_rates(robot, state, lane_of(signals, lane), h, steps)
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
            for lane in range(lanes):
                runge_kutta_stage(lane_of(plant, lane), lane_of(memory, lane), stage, h)
        for lane in range(lanes):
            state = lane_of(memory, lane)
            state.position = state.reached
            state.rates = state.reached_rates
    write_velocity(plant, memory)
    release(plant, memory, signals, holds)


@formula
def write_velocity(plant: Any, memory: Any) -> None:
    """Write the velocities of the true state."""
    for lane in range(lane_count(plant)):
        state, model = lane_of(memory, lane), mechanism.model_of(lane_of(plant, lane))
        posture = mechanism.posture(model, state.position)
        state.velocity = mechanism.position_rates(model, posture, state.rates)


@formula
def observe(plant: Any, memory: Any, delayed: Any, tick: int, signals: Any) -> None:
    """Write the true state and its measurement into `signals`."""
    lanes, inexact, delays = lane_count(plant), 0, 0
    for lane in range(lanes):
        state, row = lane_of(memory, lane), lane_of(signals, lane)
        row.true_position = row.position = state.position
        row.true_velocity = row.velocity = state.velocity
    for lane in range(lanes):
        inexact += 1 - lane_of(plant, lane).is_exact
        delays += lane_of(plant, lane).delay
    # A vectorised loop computes all lanes or none.
    if inexact > 0:
        write_noise(plant, memory, tick)
        for lane in range(lanes):
            measure(lane_of(plant, lane), lane_of(memory, lane), tick, lane_of(signals, lane))
    if delays > 0:
        for lane in range(lanes):
            delay_measurement(
                lane_of(plant, lane), lane_of(delayed, lane), tick, lane_of(signals, lane)
            )
