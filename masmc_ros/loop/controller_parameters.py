# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the controller in addition to those of the laws."""

from __future__ import annotations

from dataclasses import replace

from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import Mechanism

FAULT_ACTIONS = VOID, GRAVITY, HOLD = 'void', 'gravity', 'hold'
"""Choices of `fault_action`."""

FAULT_ACTION = Parameter(
    'fault_action',
    HOLD,
    'Torque after a fault, an emergency stop and ~/enable with false: void commands nothing, '
    'gravity compensates the weight and damps the joints, hold also keeps the arm where it '
    'comes to rest. Commanded rates are zero instead',
    choices=FAULT_ACTIONS,
    read_only=False,
)

RUNAWAY_DETECTION = Parameter(
    'runaway_detection',
    True,
    'Raise a fault if the robot runs away, in real time; false: a robot whose disturbance '
    'exceeds its torque limits stays under control',
    read_only=False,
)

POSE_FRAME = Parameter(
    'pose_frame', '',
    'Frame of the path, such as map, with pose_source odom of the controller: a localisation '
    'sends its transform to the frame of odom on /tf; empty: the frame of odom',
)  # fmt: skip


def _is_estimation_time(value: float) -> bool:
    """Return True for 0, which disables the estimate, and for a time with enough blocks."""
    return value == 0.0 or value >= 3.0


TELEMETRY_DECIMATION = Parameter(
    'telemetry_decimation', 1,
    'Ticks between two messages on each telemetry topic, such as '
    'controller/tracking_error; 0: no messages',
    minimum=0,
)

ACTIVE_ON_START = Parameter(
    'active_on_start', True,
    'Activate the controller at the start; false: ~/enable activates it',
)

ESTIMATION_TIME = Parameter(
    'payload.estimation_time', 0.0,
    'Time of control from which a payload is estimated, in whole seconds; 0: no estimate',
    unit='s', minimum=0.0, maximum=600.0, rule=_is_estimation_time,
    rule_text='0, or a number in [3, 600]',
)

POSE_SOURCE = Parameter(
    'pose_source', 'joint_states',
    "Source of the platform's pose: the joints base_..._joint of joint_states, or odom",
    choices=('joint_states', 'odom'),
)

STATE_TIMEOUT = Parameter(
    'state_timeout', 0.1,
    'Time without a usable state after which the controller raises a fault, in real time; '
    'at least five control periods',
    unit='s', minimum=0.0, exclusive_minimum=True, maximum=1e6, read_only=False,
)

REFERENCE_TIMEOUT = Parameter(
    'reference_timeout', 0.0,
    'Time from the end of the reference to a fault, in real time; 0: hold indefinitely',
    unit='s', minimum=0.0, maximum=1e6, read_only=False,
)

APPROACH_SPEED = Parameter(
    'approach_speed', 0.25,
    'Speed per task axis of the approach to a distant reference, in real time and after '
    '~/enable; 0: no approach, the error steps',
    unit='m/s', minimum=0.0,
)

APPROACH_ON_START = Parameter(
    'approach_on_start', False,
    'Start with an approach in lock-step and in masmc simulate; runs in real time always '
    'do, parallel runs never',
)

_NODE = (
    TELEMETRY_DECIMATION, ACTIVE_ON_START, FAULT_ACTION, RUNAWAY_DETECTION, ESTIMATION_TIME,
    POSE_SOURCE, POSE_FRAME, STATE_TIMEOUT, REFERENCE_TIMEOUT, APPROACH_SPEED, APPROACH_ON_START,
)  # fmt: skip


def parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the declarations for a mechanism; only a planar base can have its pose from odom."""
    if mechanism.is_planar:
        return _NODE
    source = replace(POSE_SOURCE, choices=('joint_states',))
    return tuple(source if p is POSE_SOURCE else p for p in _NODE)
