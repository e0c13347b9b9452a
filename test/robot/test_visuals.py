# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Visual shapes of robot descriptions."""

from __future__ import annotations

import math

from masmc_ros.errors import InputError
from masmc_ros.files import scenario_file
from masmc_ros.robot.robot import robot_description
from masmc_ros.robot.visuals import visual_shapes
from masmc_ros.scenario.scenario import load_scenario
import pytest

LINK = '<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material><link name="a">{}'
VISUAL = '<visual>{}<geometry>{}</geometry><material name="red"/></visual>'


def described(*visuals: str) -> str:
    return f'{LINK.format("".join(visuals))}</link></robot>'


def test_visuals_of_planar_robot_are_primitives_of_its_frames() -> None:
    values = load_scenario(scenario_file('paper'))['plant']
    shapes = visual_shapes(robot_description(values))
    assert {shape.kind for shape in shapes} == {'box', 'cylinder', 'sphere'}
    assert {shape.link for shape in shapes} >= {'base_link', 'link_1', 'link_2', 'wheel_left'}


def test_visuals_have_pose_size_and_colour() -> None:
    origin = f'<origin xyz="1 2 3" rpy="0 0 {math.pi / 2}"/>'
    shapes = visual_shapes(
        described(
            VISUAL.format(origin, '<box size="1 2 3"/>'),
            VISUAL.format('', '<mesh filename="package://p/m.stl" scale="2 2 2"/>'),
        )
    )
    box, mesh = shapes
    assert (box.sizes, box.offset, box.colour) == ((1, 2, 3), (1, 2, 3), (1, 0, 0))
    assert box.quaternion == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    assert (mesh.mesh, mesh.sizes) == ('package://p/m.stl', (2, 2, 2))


def test_visuals_skip_malformed_shapes() -> None:
    wrong = '<box size="1 x 3"/>', '<sphere radius="-1"/>', '<sphere/>', '<cone radius="1"/>'
    good = VISUAL.format('', '<sphere radius="1"/>')
    shapes = visual_shapes(described(*(VISUAL.format('', shape) for shape in wrong), good))
    assert [shape.kind for shape in shapes] == ['sphere']


def test_visuals_of_invalid_description_rejected() -> None:
    with pytest.raises(InputError):
        visual_shapes('<robot/>')
