# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Outputs of a tree's task: axes, names, units, report entries and rejected tasks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from cart_arm import CART_ARM
from helpers.small_tree import parameters, START, URDF
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.robot.declaration import check_points, Point
from masmc_ros.robot.mechanisms import driven_joint_names, JOINT_NAMES_PARAMETER
from masmc_ros.robot.robot import robot_description, robot_of
from masmc_ros.robot.tree.task.outputs import JOINTS, OUTPUTS
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism, TreeMechanism
import numpy as np
import pytest


def robot(*outputs: str, **settings: Any) -> TreeMechanism:
    """Return the small robot with a task."""
    return tree_mechanism({**parameters(), 'robot.task': outputs, **settings})


def names(mechanism: TreeMechanism) -> list[str]:
    """Return the names of the axes."""
    return [axis.name for axis in mechanism.axes]


def test_task_axes_one_frame_is_tip_several_have_names() -> None:
    assert names(robot('planar')) == ['x_tip', 'y_tip']
    one = robot('planar', 'orientation')
    assert names(one) == ['x_tip', 'y_tip', 'rx_tip', 'ry_tip', 'rz_tip']
    two = robot('position', 'planar turret', 'heading')
    assert names(two) == ['x_hand', 'y_hand', 'z_hand', 'x_turret', 'y_turret', 'rz_base_link']
    assert [axis.unit for axis in two.axes] == ['m'] * 5 + ['rad']


def test_task_string_equals_list_of_one_output() -> None:
    assert tree_mechanism({**parameters(), 'robot.task': 'planar'}) is robot('planar')


def test_task_joints_are_all_or_named_ones() -> None:
    joints = ['turret_joint', 'lift_joint', 'upper_joint', 'fore_joint', 'hand_joint']
    every = robot('joints')
    assert names(every) == joints
    assert [axis.unit for axis in every.axes] == ['rad', 'm', 'rad', 'rad', 'rad']
    assert names(robot('joints fore_joint  turret_joint')) == ['fore_joint', 'turret_joint']
    assert names(robot('position', 'joints lift_joint'))[3:] == ['lift_joint']


@pytest.mark.slow
def test_task_positions_equal_those_of_single_outputs() -> None:
    """Every axis equals that of a task of one output, for any preceding outputs."""
    position = np.array([[0.3, -0.2, 0.5, 1.0, 2.0, *START[2:]]])

    def at(*outputs: str) -> np.ndarray:
        mechanism = robot(*outputs)
        values = {p.name: p.default for p in mechanism.parameters} | parameters()
        return robot_of(values | {'robot.task': outputs}).task_positions(position)[0]

    together = at('joints fore_joint', 'pose upper', 'heading', 'position', 'joints turret_joint')
    alone = [at('joints fore_joint'), at('pose upper'), at('heading'), at('position')]
    np.testing.assert_array_equal(together, np.concatenate([*alone, at('joints turret_joint')]))
    assert at('heading') == pytest.approx([0.5], abs=1e-12)
    assert at('joints') == pytest.approx(START[2:])


def test_task_joints_default_path_starts_at_posture() -> None:
    mechanism = robot('planar', 'joints')
    assert mechanism.default('line_sine.offset', 'axes') == (0.0, 0.0, *START[2:])


def test_task_points_name_outputs_with_their_units() -> None:
    tip, turned = robot('pose').points
    assert tip == ('T', 'tip', 'tip', 'the tip', 0, 3, 'm', True, False)
    assert turned == (
        'R', 'orientation_of_tip', 'orientation of tip', 'the orientation of the tip', 3, 3,
        'rad', False, True,
    )  # fmt: skip
    (joints,) = robot('joints upper_joint fore_joint').points
    assert joints == ('q', 'joints', 'joints', 'the joints', 0, 2, 'rad', False, False)
    points = robot('joints', 'planar turret', 'heading').points
    summaries = [(point.symbol, point.name, point.axes, point.small_unit) for point in points]
    assert summaries == [
        ('A', 'turret_joint', slice(0, 1), 'mrad'),
        ('B', 'lift_joint', slice(1, 2), 'mm'),
        ('C', 'upper_joint to hand_joint', slice(2, 5), 'mrad'),
        ('D', 'turret', slice(5, 7), 'mm'),
        ('E', 'heading of base_link', slice(7, 8), 'mrad'),
    ]
    assert [point.key for point in points][2] == 'upper_joint_to_hand_joint'
    assert [place.name for place in robot('joints', 'planar turret').places] == ['turret']


def test_task_points_of_several_frames_are_in_space() -> None:
    points = robot('pose', 'position turret', 'heading').points
    summaries = [(point.symbol, point.name, point.axes, point.small_unit) for point in points]
    assert summaries == [
        ('A', 'hand', slice(0, 3), 'mm'),
        ('B', 'orientation of hand', slice(3, 6), 'mrad'),
        ('C', 'turret', slice(6, 9), 'mm'),
        ('D', 'heading of base_link', slice(9, 10), 'mrad'),
    ]
    assert [point.plane for point in points if point.is_place] == [slice(0, 2), slice(6, 8)]


@given(
    st.lists(
        st.tuples(st.sampled_from((*OUTPUTS, JOINTS)), st.sampled_from(('hand', 'turret'))),
        min_size=1, max_size=4, unique=True,
    )
)  # fmt: skip
def test_task_points_contain_each_axis_once(outputs: list[tuple[str, str]]) -> None:
    texts = [kind if kind == JOINTS else f'{kind} {link}' for kind, link in outputs]
    try:
        mechanism = robot(*texts)
    except InputError:
        return  # an axis twice, or sideways motion of the base
    check_points(mechanism)
    assert len({point.key for point in mechanism.points}) == len(mechanism.points)


@pytest.mark.parametrize(
    ('points', 'text'),
    [
        ((Point('T', 'tip', 'tip', 'the tip', 0),), r'0 of its points contain .* z_tip'),
        ((Point('T', 'tip', 'tip', 'the tip', 0, 3),) * 2, r'2 of its points contain .* x_tip'),
        ((Point('T', 'tip', 'tip', 'the tip', 0, 3, 'rad'),), 'tip in rad contains .* x_tip in m'),
        (
            [Point('T', 'tip', 'tip', 'the tip', i, size) for i, size in ((0, 1), (1, 2))],
            'a place with 1 axes; expected x and y, or x, y and z',
        ),
    ],
)
def test_points_that_miss_or_mix_axes_are_rejected(points: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        check_points(replace(CART_ARM, axes=robot('position').axes, points=tuple(points)))


@pytest.mark.parametrize(
    ('outputs', 'text'),
    [
        (('pos',), r"no output 'pos'; did you mean pose\?"),
        (('pose hnad',), r"robot\.task: no link 'hnad'; did you mean hand\?"),
        (('joints uper_joint',), r"'uper_joint' is controlled; did you mean upper_joint"),
        (('joints wheel_left_joint',), "no joint 'wheel_left_joint' is controlled"),
        (('pose', 'planar hand'), "'planar hand' has an axis that one before it has"),
        (('joints', 'joints lift_joint'), 'has an axis that one before it has'),
        ((), r'robot\.task: 0 axes; expected 1 to 48'),
        (('heading', 'base'), r'expected robot\.base omnidirectional or fixed'),
    ],
)
def test_task_invalid_outputs_raise(outputs: tuple[str, ...], text: str) -> None:
    with pytest.raises(InputError, match=text):
        robot(*outputs)


def test_task_too_many_axes_raises() -> None:
    frames = ('turret', 'lift', 'upper', 'fore', 'hand', 'base_link', 'wheel_left', 'wheel_right')
    with pytest.raises(InputError, match=r'robot\.task: 53 axes; expected 1 to 48'):
        robot(*(f'pose {frame}' for frame in frames), 'joints')


def test_description_renamed_joint_is_mimicked_by_its_new_name() -> None:
    finger = (
        '<link name="finger"/><joint name="finger_joint" type="revolute"><parent link="hand"/>'
        '<child link="finger"/><axis xyz="1 0 0"/><mimic joint="hand_joint"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    urdf = URDF.replace('</robot>', finger)
    settings = parameters(urdf)
    mechanism = tree_mechanism(settings)
    values = {p.name: p.default for p in mechanism.parameters} | settings
    driven = driven_joint_names(values)
    assert driven[-1] == 'hand_joint'
    values[JOINT_NAMES_PARAMETER] = (*driven[:-1], 'wrist')
    text = robot_description(values)
    assert 'mimic joint="wrist"' in text
    assert 'hand_joint' not in text
