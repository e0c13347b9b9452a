# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the trajectory node in addition to those of the paths."""

from __future__ import annotations

from masmc_ros.loop.controller_parameters import POSE_FRAME
from masmc_ros.params.declaration import Parameter

_LATEST_START = 2e9
"""Latest start in s, before the last valid stamp."""

_SHORTEST_WINDOW = 0.001
"""Shortest window and horizon in s."""

WINDOW = Parameter(
    'window', 0.5, 'Length of the reference windows',
    unit='s', minimum=_SHORTEST_WINDOW, maximum=5.0,
)

HORIZON = Parameter(
    'horizon', 2.0, 'Time ahead of the robot for which the reference is published',
    unit='s', minimum=_SHORTEST_WINDOW, maximum=10.0,
)

START_TIME = Parameter(
    'start_time', 0.0,
    'Stamp at which the trajectory starts; negative: stamp of the first state after the '
    'activation of the controller',
    unit='s', maximum=_LATEST_START,
)

PATH_SPEED = Parameter(
    'path_speed', 0.25,
    'Largest speed on paths from messages without times, and of the transition to a path',
    unit='m/s', minimum=0.0, exclusive_minimum=True,
)

PATH_TURN_RATE = Parameter(
    'path_turn_rate', 0.5, 'Largest turn rate on paths of poses without times',
    unit='rad/s', minimum=0.0, exclusive_minimum=True,
)

PATH_ACCELERATION = Parameter(
    'path_acceleration', 0.5,
    'Largest acceleration on the way to a goal, with path_jerk > 0; that of angles is as many '
    'times larger as path_turn_rate is than path_speed',
    unit='m/s²', minimum=0.0, exclusive_minimum=True,
)

PATH_JERK = Parameter(
    'path_jerk', 0.0,
    'Largest jerk on the way to a goal, which needs ruckig; 0: the motion has minimum jerk, '
    'and no limit of acceleration',
    unit='m/s³', minimum=0.0,
)

PATH_BASE = Parameter(
    'path_base', 'follow',
    'Axes of the base in the task on paths from messages for the end effector only: follow '
    'it, or hold them',
    choices=('follow', 'hold'),
)

PATH_LEAD = Parameter(
    'path_lead', 0.2,
    'Time from the latest state of the robot to the start of a path from a message, with '
    'pacing realtime',
    unit='s', minimum=_SHORTEST_WINDOW, maximum=5.0,
)

NODE = (
    WINDOW, HORIZON, START_TIME, POSE_FRAME, PATH_SPEED, PATH_TURN_RATE, PATH_ACCELERATION,
    PATH_JERK, PATH_BASE, PATH_LEAD,
)  # fmt: skip
