# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The robot's joints and frames by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from masmc_ros.params.declaration import Parameter

BASE_JOINTS = ('base_x_joint', 'base_y_joint', 'base_yaw_joint')
"""Pose of the axle midpoint in the world: m, m, rad; velocities m/s, m/s, rad/s."""

DRIVEN_JOINTS = ('wheel_right_joint', 'wheel_left_joint', 'arm_joint_1', 'arm_joint_2')
"""The joints that take a torque, in the order of the reduced velocity v; rad, rad/s, N m."""

ARM_JOINTS = DRIVEN_JOINTS[2:]
"""The arm's joints alone."""

JOINTS = BASE_JOINTS + DRIVEN_JOINTS
"""The joints in the order of a joint state."""

FIXED_JOINT = 'end_effector_joint'
"""The joint between the last link and its end."""


def are_joint_names(names: Sequence[str]) -> bool:
    """Tell whether a robot may have joints of these names: all of them, or the driven ones."""
    whole = joint_names({JOINT_NAMES_PARAMETER: names})
    return (
        len(names) in (len(JOINTS), len(DRIVEN_JOINTS))
        and len({*whole, FIXED_JOINT}) == len(JOINTS) + 1
        and all(name and name.isprintable() and name == name.strip() for name in whole)
    )


def joint_names(values: Mapping[str, Any]) -> tuple[str, ...]:
    """
    Return the names of the joints in the order of a joint state, by checked values.

    Where the driven joints alone are named, the base's keep their names; where none are, all do.
    """
    names = tuple(values.get(JOINT_NAMES_PARAMETER, JOINTS))
    return names if len(names) == len(JOINTS) else BASE_JOINTS + names


JOINT_NAMES_PARAMETER = 'robot.joint_names'

NAMES = (
    Parameter(
        JOINT_NAMES_PARAMETER,
        JOINTS,
        'Names of the joints: pose of the base (x, y, yaw), wheel_right, wheel_left, arm_1, arm_2',
        rule=are_joint_names,
        rule_text='7 different names, or 4 of the driven joints alone',
    ),
)
"""Parameter of every node that knows joints by name."""

ODOM_FRAME = 'odom'
BASE_FRAME = 'base_link'
END_EFFECTOR_FRAME = 'end_effector'

FRAMES = (
    (ODOM_FRAME, BASE_FRAME),
    (BASE_FRAME, 'wheel_right'),
    (BASE_FRAME, 'wheel_left'),
    (BASE_FRAME, 'link_1'),
    ('link_1', 'link_2'),
    ('link_2', END_EFFECTOR_FRAME),
)
"""Parent and child of every transform, parents first."""
