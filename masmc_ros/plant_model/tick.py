# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One tick of the plant in all lanes, from a command to the next true and measured state."""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.compiled import formula, inlined
from masmc_ros.numerics.field import Field
from masmc_ros.numerics.limits import limited
from masmc_ros.numerics.record import get, lane_count, put
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
from masmc_ros.plant_model.measurement import measure
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
)
"""Memory from tick to tick."""


@formula
def _share(total: float, value: float, steps: float) -> float:
    return total + value / steps


@formula
def _hold_rates(plant: Any, memory: Any, signals: Any, lane: int, h: float, steps: int) -> None:
    """Advance the drives, which follow the commanded rates, by one step of h seconds."""
    model = mechanism.model_of(plant, lane)
    commanded = mechanism.commanded_joint_rates(model, get(signals, 'rates', lane))
    missing = elementwise(minus, commanded, get(memory, 'rates', lane))
    driven = elementwise(
        drive,
        missing,
        get(memory, 'drive_integral', lane),
        get(plant, 'inertia', lane),
        get(plant, 'bandwidth', lane),
        get(plant, 'limit', lane),
        h,
    )
    torque = column(driven, 0)
    put(memory, 'driven', lane, torque)
    put(memory, 'drive_integral', lane, column(driven, 1))
    applied = elementwise(_share, get(signals, 'applied', lane), torque, steps)
    put(signals, 'applied', lane, applied)


@formula
def take_command(plant: Any, memory: Any, signals: Any, holds: bool) -> None:
    """
    Use the command in `signals` for one period, none if `holds`.

    Writes `driven` and `applied`: torques within the motor limits. With commanded rates, the
    drives update both at every step.
    """
    lanes = lane_count(plant)
    # Conditions equal in all lanes are outside of the loops, which otherwise do not vectorise.
    if (plant['takes_rates'][0] != 0) | holds:
        for lane in range(lanes):
            nothing = elementwise(zero, get(signals, 'torque', lane))
            put(signals, 'applied', lane, nothing)
            if holds:
                put(signals, 'rates', lane, nothing)
    else:
        for lane in range(lanes):
            asked = get(signals, 'torque', lane)
            held = elementwise(
                limited,
                asked,
                get(memory, 'driven', lane),
                get(plant, 'limit', lane),
                get(plant, 'rate_limit', lane),
                plant['period'][0],
            )
            put(signals, 'applied', lane, held)
            put(memory, 'driven', lane, held)
            put(memory, 'drive_integral', lane, elementwise(zero, asked))


@formula
def release(plant: Any, memory: Any, signals: Any, holds: bool) -> None:
    """Clear the torque of drives that held without a command, if torques are commanded."""
    if holds & (plant['takes_rates'][0] == 0):
        for lane in range(lane_count(plant)):
            nothing = elementwise(zero, get(signals, 'torque', lane))
            put(signals, 'applied', lane, nothing)
            put(memory, 'driven', lane, nothing)


@formula
def drive_step(
    plant: Any, memory: Any, tick: int, step: int, signals: Any, holds: bool
) -> None:
    """Write the joint forces over one step of an external integrator: `driven`, `disturbance`."""
    steps, period = plant['steps'][0], plant['period'][0]
    h = period / steps
    if step == 0:
        take_command(plant, memory, signals, holds)
    for lane in range(lane_count(plant)):
        if (plant['takes_rates'][0] != 0) | holds:
            _hold_rates(plant, memory, signals, lane, h, steps)
    write_push(plant, memory, moment(tick * period, step, 1, h))


@inlined
def advance(plant: Any, memory: Any, tick: int, signals: Any, holds: bool) -> None:
    """
    Advance the true state by one period with the command in `signals`; none if `holds`.

    Writes the torque that it comes to as `applied`: within the motors' limits the command
    itself, or the mean torque of drives that follow velocities. Without a command, the
    drives hold the joints at zero velocity; the applied torque is then zero.
    """
    lanes = lane_count(plant)
    steps, period = plant['steps'][0], plant['period'][0]
    takes_rates = (plant['takes_rates'][0] != 0) | holds
    time = tick * period
    h = period / steps
    waves = scratch(waves_of_step(plant))
    shares = shares_waves(plant)
    take_command(plant, memory, signals, holds)
    for lane in range(lanes):
        put(memory, 'reached', lane, get(memory, 'position', lane))
        put(memory, 'reached_rates', lane, get(memory, 'rates', lane))
    for step in range(steps):
        if takes_rates:
            for lane in range(lanes):
                _hold_rates(plant, memory, signals, lane, h, steps)
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
                runge_kutta_stage(plant, memory, lane, stage, h)
        for lane in range(lanes):
            put(memory, 'position', lane, get(memory, 'reached', lane))
            put(memory, 'rates', lane, get(memory, 'reached_rates', lane))
    write_velocity(plant, memory)
    release(plant, memory, signals, holds)


@formula
def write_velocity(plant: Any, memory: Any) -> None:
    """Write the velocities of the true state."""
    for lane in range(lane_count(plant)):
        model = mechanism.model_of(plant, lane)
        posture = mechanism.posture(model, get(memory, 'position', lane))
        rates = mechanism.position_rates(model, posture, get(memory, 'rates', lane))
        put(memory, 'velocity', lane, rates)


@formula
def observe(plant: Any, memory: Any, delayed: Any, tick: int, signals: Any) -> None:
    """Write the true state and its measurement into `signals`."""
    for lane in range(lane_count(plant)):
        position, velocity = get(memory, 'position', lane), get(memory, 'velocity', lane)
        put(signals, 'true_position', lane, position)
        put(signals, 'true_velocity', lane, velocity)
        put(signals, 'position', lane, position)
        put(signals, 'velocity', lane, velocity)
    for lane in range(lane_count(plant)):
        if get(plant, 'is_exact', lane) == 0:
            measure(plant, memory, delayed, tick, signals, lane)
