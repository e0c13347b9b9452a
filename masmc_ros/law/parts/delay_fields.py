# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters, settings and memory of the compensation of latency."""

from __future__ import annotations

from masmc_ros.aliases import BasePose, Joints, Numbers, Positions
from masmc_ros.jit.field import field
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.params.declaration import Parameter, Values

LONGEST = 0.1
"""Largest compensated latency in s."""

HISTORY = 128
"""Stored commands; a power of two. Latency is limited to two periods less."""

LATENCY = Parameter(
    'latency',
    0.0,
    'Time from the measurement of a state to the first effect of its torque; 0: no '
    'compensation',
    unit='s',
    minimum=0.0,
    maximum=LONGEST,
    read_only=False,
)

MOTOR_LAG = Parameter(
    'motor_lag',
    0.0,
    'Time constant of the torques of the motors',
    unit='s',
    minimum=0.0,
    maximum=LONGEST,
    read_only=False,
)

HORIZON = Parameter(
    'compensation.horizon',
    0.0,
    'Time h in which the implicit law reaches the surface, with latency; 0: 1.1 times '
    'the latency and a quarter of motor_lag, plus a period, but at most 1.5 times',
    unit='s',
    minimum=0.0,
    read_only=False,
)

GAIN = Parameter(
    'compensation.gain',
    0.0,
    'Gain beta of the disturbance estimate with latency; 0: the period divided by the latency '
    'plus a quarter of motor_lag, at most 1/4. Another value enables the estimate without '
    'latency',
    minimum=0.0,
    maximum=1.0,
    read_only=False,
)

SLOPE = Parameter(
    'compensation.slope',
    0.0,
    'Gain beta_2 of the slope of the disturbance estimate, as a multiple of beta squared; 0: '
    '0.25 plus 0.05 periods divided by the latency, at most 0.3',
    minimum=0.0,
    maximum=1.0,
    read_only=False,
)

PARAMETERS = (LATENCY, MOTOR_LAG, HORIZON, GAIN, SLOPE)


class CompensationSettings(Settings):
    """Settings of the law with compensation, in addition to the parameters."""

    stamp_age: float = field('Time from the measurement of a state to its stamp', 's')


class CompensationMemory(Memory):
    """Memory of the law with compensation; times are those of the measured states."""

    acceleration: Joints = field('Estimated d, in the velocities of the mechanism', '1/s²')
    acceleration_slope: Joints = field('Its change delta per period', '1/s²')
    motor: Joints = field('Torques of the motors in the last measured state', 'N·m')
    excess: Joints = field('Torques that the limit has withheld', 'N·m')
    measured_position: Positions = field('Positions of the last measured state', 'm, rad')
    measured_base: BasePose = field('Base pose in it', 'm, rad')
    measured_rates: Joints = field('Rates in it, measured or estimated', 'rad/s')
    measured_acceleration: Joints = field('Its derivative, of the mechanism', '1/s²')
    history_command: Numbers = field(
        'Commands: torques, base velocities', size=(HISTORY, 'joints')
    )
    history_start: Numbers = field('Times at which they started to act', 's', size=HISTORY)
    history_newest: int = field('Row of the newest one')
    history_initialised: int = field('1 after the first tick')
    state_time: float = field('Time of the last measured state', 's')
    acts_from: float = field('Time from which its torque acts', 's')
    skipped: int = field('Ticks since the last one that were not computed')
    later: float = field('Latency of the next state beyond the usual one', 's')


ENABLING = (LATENCY.name, MOTOR_LAG.name, GAIN.name)
"""Parameters that enable the compensation if one of them is not zero."""


def is_compensated(values: Values) -> bool:
    """Return True if a controller with these parameter values compensates latency."""
    return any(values[name] > 0.0 for name in ENABLING)
