# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Speed and position limits of joints, from a URDF and from `robot.speed_limits`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from helpers.small_tree import parameters, URDF, write_scenario
from masmc_ros.errors import InputError
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import DEFAULT, mechanism_from
from masmc_ros.scenario.scenario import load_scenario
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
UNLIMITED = (-math.inf, math.inf)


def mechanism(*settings: str, **values: Any) -> Mechanism:
    """Return the small robot with the speed limits of the parameter."""
    return mechanism_from({**parameters(), 'robot.speed_limits': settings, **values})


def test_limits_of_urdf_apply_per_driven_joint() -> None:
    small = mechanism()
    assert small.speed_limits == (math.inf, math.inf, 3.0, 3.0, 3.0, 3.0, 3.0)
    assert small.position_limits == (UNLIMITED, UNLIMITED, *((-3.0, 3.0),) * 5)


def test_speed_limit_zero_in_urdf_is_no_limit() -> None:
    unknown = URDF.replace('velocity="3"', 'velocity="0"')
    missing = URDF.replace(' velocity="3"', '')
    for text in (unknown, missing):
        assert mechanism(**{'robot.urdf': text}).speed_limits == (math.inf,) * 7


def test_speed_limits_parameter_replaces_urdf_limits() -> None:
    limits = mechanism('lift_joint 0.07', 'wheel_left_joint 9', 'hand_joint 0').speed_limits
    assert limits == (math.inf, 9.0, 3.0, 0.07, 3.0, 3.0, math.inf)


def test_speed_limits_base_without_wheels_apply_to_base_joint() -> None:
    values = {
        'robot.base': 'omnidirectional',
        'robot.wheels': (),
        'robot.held_joints': ('wheel_right_joint', 'wheel_left_joint'),
    }
    limits = mechanism('base_turn_joint 0.5', **values).speed_limits
    assert limits[:4] == (math.inf, math.inf, 0.5, 3.0)


def test_speed_limits_planar_robot_apply_only_if_configured() -> None:
    assert mechanism_from({}) is DEFAULT
    assert DEFAULT.speed_limits == (math.inf,) * 4
    assert DEFAULT.position_limits == (UNLIMITED,) * 4
    limited = mechanism_from({'robot.speed_limits': ['arm_joint_2 1.5']})
    assert limited.speed_limits == (math.inf, math.inf, math.inf, 1.5)
    assert limited.tag == DEFAULT.tag
    # Another process that receives this choice creates an equal mechanism.
    assert mechanism_from(limited.choice) is limited


@pytest.mark.parametrize(
    ('setting', 'expected'),
    [
        ('elbow 1.0', "no joint 'elbow'; expected"),
        ('lift_joint', 'a speed >= 0'),
        ('lift_joint fast', 'a speed >= 0'),
        ('lift_joint -1', 'a speed >= 0'),
        ('lift_joint nan', 'a speed >= 0'),
        ('lift_joint inf', 'a speed >= 0'),
    ],
)
def test_speed_limits_invalid_setting_raises_one_line(setting: str, expected: str) -> None:
    for values in ({'robot.urdf': URDF}, {}):
        name = 'lift_joint' if values else 'arm_joint_1'
        with pytest.raises(InputError) as raised:
            mechanism_from({
                **(parameters() if values else {}),
                'robot.speed_limits': (setting.replace('lift_joint', name),),
            })
        assert expected in str(raised.value)
        if expected.startswith('no joint'):
            for joint in mechanism_from(parameters() if values else {}).joints:
                assert joint.name in str(raised.value)


def test_speed_limits_joint_named_twice_raises() -> None:
    with pytest.raises(InputError, match=r"'lift_joint 2\.0' again"):
        mechanism('lift_joint 1.0', 'lift_joint 2.0')


def test_speed_limits_file_and_command_line_set_them(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, [0.0] * 6, 1.0)
    text = path.read_text(encoding='utf-8')
    path.write_text(
        text.replace('      base: ', '      speed_limits: [lift_joint 0.07]\n      base: '),
        encoding='utf-8',
    )
    for settings, lift in (((), 0.07), (('robot.speed_limits=[lift_joint 0.1]',), 0.1)):
        values = load_scenario(str(path), settings)
        for node in ('plant', 'trajectory', 'controller'):
            assert mechanism_from(values[node]).speed_limits[3] == lift
    with pytest.raises(InputError, match="no joint 'elbow'"):
        load_scenario(str(path), ('robot.speed_limits=[elbow 0.1]',))
    values = load_scenario(PAPER, ('robot.speed_limits=[arm_joint_1 2.0]',))
    assert mechanism_from(values['controller']).speed_limits[2] == 2.0


def test_speed_limits_empty_string_of_dump_is_no_limit() -> None:
    """A ROS parameter file contains an empty list as one empty string."""
    limits = mechanism_from({'robot.speed_limits': ('',)}).speed_limits
    assert all(limit == float('inf') for limit in limits)
