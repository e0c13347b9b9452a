# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters, settings and memory of the compensation of latency."""

from __future__ import annotations

from masmc_ros.aliases import Joints, Numbers
from masmc_ros.jit.field import Field
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

SETTINGS = (
    Field('stamp_age', description='Time from the measurement of a state to its stamp', unit='s'),
)
"""Settings that are not parameters."""

MEMORY = (
    Field('acceleration', 'joints', 'Estimated d, in the velocities of the mechanism', '1/s²'),
    Field('acceleration_slope', 'joints', 'Its change delta per period', '1/s²'),
    Field('motor', 'joints', 'Torques of the motors in the last measured state', 'N·m'),
    Field('excess', 'joints', 'Torques that the limit has withheld', 'N·m'),
    Field('measured_position', 'positions', 'Positions of the last measured state', 'm, rad'),
    Field('measured_base', 'base', 'Base pose in it', 'm, rad'),
    Field('measured_rates', 'joints', 'Rates in it, measured or estimated', 'rad/s'),
    Field('measured_acceleration', 'joints', 'Its derivative, of the mechanism', '1/s²'),
    Field('history_command', (HISTORY, 'joints'), 'Commands: torques, base velocities'),
    Field('history_start', HISTORY, 'Times at which they started to act', 's'),
    Field('history_newest', description='Row of the newest one', kind='i8'),
    Field('history_initialised', description='1 after the first tick', kind='i8'),
    Field('state_time', description='Time of the last measured state', unit='s'),
    Field('acts_from', description='Time from which its torque acts', unit='s'),
    Field('skipped', description='Ticks since the last one that were not computed', kind='i8'),
    Field('later', description='Latency of the next state beyond the usual one', unit='s'),
)
"""Memory with compensation; times are those of the measured states."""


class CompensationSettings(Settings):
    """Settings of the law, with the age of stamps that the compensation needs."""

    stamp_age: float


class CompensationMemory(Memory):
    """State of a law with that of this module."""

    acceleration: Joints
    acceleration_slope: Joints
    motor: Joints
    excess: Joints
    measured_position: Numbers
    measured_base: Numbers
    measured_rates: Joints
    measured_acceleration: Joints
    history_command: Numbers
    history_start: Numbers
    history_newest: int
    history_initialised: int
    state_time: float
    acts_from: float
    skipped: int
    later: float


ENABLING = (LATENCY.name, MOTOR_LAG.name, GAIN.name)
"""Parameters that enable the compensation if one of them is not zero."""


def is_compensated(values: Values) -> bool:
    """Return True if a controller with these parameter values compensates latency."""
    return any(values[name] > 0.0 for name in ENABLING)
