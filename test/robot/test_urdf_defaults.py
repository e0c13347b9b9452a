# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Choices for a robot whose URDF alone is known, and gravity of its postures."""

from __future__ import annotations

import math
from pathlib import Path
import re
from typing import Any

from helpers.small_tree import START, URDF
from masmc_ros.errors import InputError
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.tree.assembly import tree_robot
from masmc_ros.robot.tree.postures import (
    frame_of,
    gravity_torques,
    jacobian,
    largest_gravity_torques,
    placed,
    reach,
)
from masmc_ros.robot.tree.urdf_defaults import Defaults, urdf_defaults
from masmc_ros.robot.urdf import read_urdf
from masmc_ros.scenario.scenario import load_scenario, source_of
import numpy as np
import pytest

_BODY = """<link name="{0}"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>{1}</link>"""
_LIMIT = '<limit lower="{}" upper="{}" effort="{}" velocity="3"/>'


def joint(
    name: str,
    parent: str,
    child: str,
    at: str = '0 0 0.2',
    axis: str = '0 1 0',
    kind: str = 'revolute',
    limit: tuple[float, float, float] | None = (-2.0, 2.0, 50.0),
    more: str = '',
) -> str:
    """Return a joint and its child."""
    ends = '' if limit is None else _LIMIT.format(*limit)
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>{ends}{more}</joint>' + _BODY.format(child, '')
    )


def arm(side: str = '', at: str = '0 0 0.2', root: str = 'base') -> str:
    """Return an arm of six joints with a tool."""
    axes = ('0 0 1', '0 1 0', '0 1 0', '1 0 0', '0 1 0', '1 0 0')
    links = [root, *(f'{side}link{i}' for i in range(1, 7))]
    parts = [
        joint(f'{side}joint{i + 1}', links[i], links[i + 1], at if i == 0 else '0 0 0.2', axis)
        for i, axis in enumerate(axes)
    ]
    tool = joint(f'{side}tool_joint', links[-1], f'{side}tool0', kind='fixed', limit=None)
    return ''.join([*parts, tool])


def robot(*parts: str) -> str:
    """Return a URDF with a base."""
    return f'<robot name="r">{_BODY.format("base", "")}{"".join(parts)}</robot>'


def wheel(name: str, x: float, y: float, z: float = 0.1, parent: str = 'base') -> str:
    """Return a wheel whose axle is parallel to y."""
    return joint(name, parent, f'{name}_link', f'{x} {y} {z}', kind='continuous', limit=None)


def chosen(urdf: str, **stated: Any) -> tuple[dict[str, Any], Defaults]:
    """Return values by parameter, and the defaults."""
    defaults = urdf_defaults(urdf, {f'robot.{name}': value for name, value in stated.items()})
    return {choice.parameter: choice.value for choice in defaults.choices}, defaults


def test_defaults_two_wheels_differential_base() -> None:
    values, _ = chosen(URDF)
    assert values['robot.base'] == 'differential'
    assert values['robot.wheels'] == ('wheel_right_joint', 'wheel_left_joint')
    assert values['robot.joints'] == (
        'turret_joint', 'lift_joint', 'upper_joint', 'fore_joint', 'hand_joint',
    )  # fmt: skip
    assert values['robot.tip_frame'] == 'hand'
    assert len(values['plant.initial_joints']) == 7
    assert values['robot.posture'] == values['plant.initial_joints'][2:]


def test_defaults_castors_fingers_and_heads_are_held() -> None:
    finger = '<mimic joint="left_finger_joint"/>'
    urdf = robot(
        arm(),
        wheel('drive_left_wheel', 0.0, 0.2),
        wheel('drive_right_wheel', 0.0, -0.2),
        joint('caster_swivel', 'base', 'caster', '-0.2 0 0.1', '0 0 1', 'continuous', None),
        wheel('caster_wheel', 0.0, 0.0, 0.0, 'caster'),
        joint('left_finger_joint', 'tool0', 'left_finger', axis='0 1 0', kind='prismatic',
              limit=(0.01, 0.04, 5.0)),
        joint('right_finger_joint', 'tool0', 'right_finger', axis='0 -1 0', kind='prismatic',
              limit=(0.01, 0.04, 5.0), more=finger),
        joint('head_pan_joint', 'base', 'head', '0 0 0.5', '0 0 1'),
    )  # fmt: skip
    values, _ = chosen(urdf)
    assert values['robot.wheels'] == ('drive_right_wheel', 'drive_left_wheel')
    assert values['robot.joints'] == tuple(f'joint{i}' for i in range(1, 7))
    assert values['robot.tip_frame'] == 'tool0'
    # Zero is outside of the range of the finger.
    assert values['robot.held_joints'] == ('left_finger_joint',)
    assert values['robot.held_positions'] == (0.01,)
    held = {joint['name']: joint['is_free'] for joint in _details(urdf, values)['held']}
    assert held == {
        'caster_swivel': True, 'caster_wheel': True, 'left_finger_joint': False,
        'head_pan_joint': False,
    }  # fmt: skip


def _details(urdf: str, values: dict[str, Any]) -> dict[str, Any]:
    own = {name: value for name, value in values.items() if name.startswith('robot.')}
    mechanism = mechanism_from({'robot.urdf': urdf, **own})
    return dict(mechanism.details(np.array(values['plant.initial_joints'])))


def test_defaults_mimicked_arm_joint_is_controlled() -> None:
    urdf = robot(
        joint('lift', 'base', 'stage1', axis='0 0 1', kind='prismatic', limit=(0.0, 0.5, 300.0)),
        joint('lift2', 'stage1', 'stage2', axis='0 0 1', kind='prismatic',
              limit=(0.0, 0.5, 300.0), more='<mimic joint="lift"/>'),
        arm(root='stage2'),
    )  # fmt: skip
    values, _ = chosen(urdf)
    assert values['robot.joints'] == ('lift', *(f'joint{i}' for i in range(1, 7)))


def test_defaults_two_arms_tip_selects_the_arm() -> None:
    urdf = robot(arm('right_', '0 -0.3 0.2'), arm('left_', '0 0.3 0.2'))
    values, defaults = chosen(urdf)
    assert values['robot.tip_frame'] == 'right_tool0'
    reason = next(c.reason for c in defaults.choices if c.parameter == 'robot.joints')
    assert 'as long: that to left_joint6 (robot.tip_frame selects it)' in reason
    values, _ = chosen(urdf, tip_frame='left_tool0')
    assert values['robot.joints'] == tuple(f'left_joint{i}' for i in range(1, 7))
    assert 'robot.tip_frame' not in values


def test_defaults_radius_of_shape_if_axle_at_frame() -> None:
    solid = '<cylinder radius="0.08" length="0.02"/>'
    cylinder = f'<collision><geometry>{solid}</geometry></collision>'
    urdf = robot(arm(), wheel('left_wheel', 0.0, 0.2, 0.0), wheel('right_wheel', 0.0, -0.2, 0.0))
    _, defaults = chosen(urdf)
    assert 'robot.wheel_radius' in defaults.notes[0]
    shaped = urdf.replace(_BODY.format('right_wheel_link', ''),
                          _BODY.format('right_wheel_link', cylinder))  # fmt: skip
    values, _ = chosen(shaped)
    assert (values['robot.base'], values['robot.wheel_radius']) == ('differential', 0.08)


def test_defaults_frame_between_the_wheels_is_base_frame() -> None:
    wheels = [wheel('left_wheel', 0.2, 0.2), wheel('right_wheel', 0.2, -0.2)]
    values, _ = chosen(robot(arm(), *wheels))
    assert (values['robot.base'], values.get('robot.base_frame')) == ('differential', None)
    footprint = joint('f', 'base', 'axle', '0.2 0 0', kind='fixed', limit=None)
    values, defaults = chosen(robot(arm(), *wheels, footprint))
    assert (values['robot.base'], values['robot.base_frame']) == ('differential', 'axle')
    assert not defaults.notes


@pytest.mark.parametrize(
    ('name', 'base', 'wheels'),
    [
        ('mecanum_wheel', 'omnidirectional', (0, 1, 2, 3)),
        ('wheel', 'differential', (1, 3, 0, 2)),
    ],
)
def test_defaults_four_wheels_mecanum_or_skid_steer(
    name: str, base: str, wheels: tuple[int, ...]
) -> None:
    parts = [
        wheel(f'{name}_{i}', x, y)
        for i, (x, y) in enumerate([(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)])
    ]
    values, defaults = chosen(robot(arm(), *parts))
    assert values['robot.base'] == base
    assert values['robot.wheels'] == tuple(f'{name}_{i}' for i in wheels)
    assert not defaults.notes
    # The usual rollers, also if the base is stated.
    angles = chosen(robot(arm(), *parts), base='omnidirectional')[0]['robot.roller_angles']
    np.testing.assert_allclose(angles, math.pi / 4.0 * np.array([-1, 1, 1, -1]))


@pytest.mark.parametrize('count', [3, 5])
def test_defaults_wheels_around_omnidirectional_base(count: int) -> None:
    wheels = [
        joint(f'wheel_{i}', 'base', f'wheel_{i}_link',
              f'{0.2 * math.cos(a)} {0.2 * math.sin(a)} 0.05',
              f'{math.cos(a)} {math.sin(a)} 0', 'continuous', None)
        for i, a in enumerate(2.0 * math.pi / count * np.arange(count))
    ]  # fmt: skip
    values, defaults = chosen(robot(arm(), *wheels))
    assert values['robot.base'] == 'omnidirectional'
    assert values['robot.wheels'] == tuple(f'wheel_{i}' for i in range(count))
    assert len(values['plant.initial_joints']) == 3 + 6
    reason = next(c.reason for c in defaults.choices if c.parameter == 'robot.base')
    assert 'assumed perpendicular' in reason


def test_defaults_start_is_regular_inside_of_ranges() -> None:
    # At zero the arm is straight: a singularity.
    urdf = robot(arm())
    values, _ = chosen(urdf)
    start = np.array(values['plant.initial_joints'])
    mechanism = mechanism_from(
        {'robot.urdf': urdf, **{n: v for n, v in values.items() if n.startswith('robot.')}}
    )
    assert not mechanism.start_warnings(start, [0.0] * 6)
    zero = mechanism.start_warnings(np.zeros(6), [0.0] * 6)
    assert len(zero) == 1
    assert 'the start is singular for the task' in zero[0]
    outside = mechanism.start_warnings(start + 9.0 * np.eye(6)[2], [0.0] * 6)
    assert outside == ['outside of its limits at the start: joint3']


def test_defaults_task_follows_the_number_of_joints() -> None:
    two = robot(joint('a', 'base', 'b'), joint('c', 'b', 'd'))
    values, _ = chosen(two)
    assert values['robot.task'] == ('joints',)
    three = robot(
        joint('a', 'base', 'b', axis='0 0 1'), joint('c', 'b', 'd'), joint('e', 'd', 'f'),
        joint('t', 'f', 'tool0', kind='fixed', limit=None),
    )  # fmt: skip
    values, _ = chosen(three)
    assert values['robot.task'] == ('position',)
    values, _ = chosen(robot(arm()))
    assert values['robot.task'] == ('pose',)
    assert sum(map(bool, values['trajectory.line_sine.amplitude'])) == 1


def test_defaults_robot_without_joints_is_rejected() -> None:
    with pytest.raises(InputError, match='no joint that can be controlled'):
        urdf_defaults(robot(), {})


@pytest.mark.parametrize('text', ['', '\n', '{"robot": {}}'])
def test_urdf_without_xml_raises_one_line(text: str, tmp_path: Path) -> None:
    """It is no parameter file without parameters, which would select the default robot."""
    path = tmp_path / 'arm.urdf'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(InputError, match=re.escape(f'{path}: no XML in it; expected')):
        source_of(str(path))


def test_written_file_has_values_of_the_urdf(tmp_path: Path) -> None:
    urdf = tmp_path / 'small.urdf'
    urdf.write_text(URDF, encoding='utf-8')
    other = tmp_path / 'files'
    other.mkdir()
    settings = ['robot.posture_gain=0.25', 'controller.k_s1=50.0']
    by_urdf = load_scenario(str(urdf), settings)
    for folder, value in ((tmp_path, 'small.urdf'), (other, str(urdf))):
        file = folder / 'robot.yaml'
        source = source_of(str(urdf), settings, str(folder))
        assert f'urdf: {value}\n' in source.text.decode()
        file.write_bytes(source.text)
        by_file = load_scenario(str(file), ['controller.k_s1=50.0'])
        assert by_file == by_urdf
    lines = file.read_text(encoding='utf-8').splitlines()
    assert max(map(len, lines)) < 400
    assert sum(line.lstrip().startswith('#') for line in lines) > 10


def test_written_file_contains_all_settings(tmp_path: Path) -> None:
    urdf, file = tmp_path / 'small.urdf', tmp_path / 'robot.yaml'
    urdf.write_text(URDF, encoding='utf-8')
    start = '[0.0, 0.0, 0.2, 0.1, 0.7, 0.9, -0.4]'
    settings = ['controller.k_s1=50.0', 'duration=1.5', f'plant.initial_joints={start}']
    file.write_bytes(source_of(str(urdf), settings).text)
    scenario = load_scenario(str(file))
    assert scenario == load_scenario(str(urdf), settings)
    assert set(scenario['controller']['k_s1']) == {50.0}
    assert scenario['controller']['robot.posture'] == (0.2, 0.1, 0.7, 0.9, -0.4)
    # The path starts at the stated start.
    mechanism: Any = mechanism_from(scenario['plant'])
    tree, path = mechanism.robot, scenario['trajectory']
    bodies = placed(tree, np.array([scenario['plant']['initial_joints'][2:]]))
    _, tip = frame_of(bodies, tree.frames['hand'])
    first = np.array(path['line_sine.offset'][:3]) - path['line_sine.amplitude'][:3]
    np.testing.assert_allclose(first, tip[0], atol=1e-8)


def test_posture_default_is_the_start_of_the_file(tmp_path: Path) -> None:
    (tmp_path / 'small.urdf').write_text(URDF, encoding='utf-8')
    file = tmp_path / 'robot.yaml'
    head = """/**:
  ros__parameters:
    robot: {urdf: small.urdf, base: differential, wheels: [wheel_right_joint, wheel_left_joint]}
"""
    start = f'/**/plant: {{ros__parameters: {{initial_joints: {list(START)}}}}}\n'
    file.write_text(head + start, encoding='utf-8')
    scenario = load_scenario(str(file))
    for node in ('plant', 'controller', 'trajectory'):
        assert scenario[node]['robot.posture'] == START[2:]
        assert scenario[node]['robot.urdf'] == str(tmp_path / 'small.urdf')
    changed = load_scenario(str(file), ['robot.posture=[0.0, 0.1, 0.2, 0.3, 0.4]'])
    assert changed['controller']['robot.posture'] == (0.0, 0.1, 0.2, 0.3, 0.4)
    moved = load_scenario(str(file), ['plant.initial_joints=[0.0, 0.0, 0.1, 0.1, 0.1, 0.1, 0.1]'])
    assert moved['controller']['robot.posture'] == (0.1,) * 5
    file.write_text(head, encoding='utf-8')
    assert load_scenario(str(file))['plant']['robot.posture'] == (0.0,)


def test_robot_of_changed_file_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / 'robot.urdf'
    file.write_text(robot(arm()), encoding='utf-8')
    values = {'robot.urdf': str(file)}
    assert len(mechanism_from(values).joints) == 6
    file.write_text(robot(joint('a', 'base', 'b')), encoding='utf-8')
    assert len(mechanism_from(values).joints) == 1


_COUPLED = robot(
    joint('lift', 'base', 'stage1', axis='0 0.6 0.8', kind='prismatic', limit=(0.0, 0.5, 300.0)),
    joint('lift2', 'stage1', 'stage2', axis='0 0 1', kind='prismatic', limit=(0.0, 0.5, 300.0),
          more='<mimic joint="lift" multiplier="0.5" offset="0.1"/>'),
    joint('elbow', 'stage2', 'lower'),
    joint('wrist', 'lower', 'hand', axis='0.6 0.8 0',
          more='<mimic joint="elbow" multiplier="-1.5"/>'),
)  # fmt: skip
"""Robot whose two controlled joints move four bodies."""


@pytest.mark.parametrize(
    ('urdf', 'at'),
    [(URDF, (0.0, 0.0, *START[2:])), (_COUPLED, (0.2, 0.7))],
    ids=['small', 'mimic'],
)
def test_gravity_torques_are_gradients_of_potential_energy(
    urdf: str, at: tuple[float, ...]
) -> None:
    tree = tree_robot(read_urdf(urdf, 'x'), 'x')

    def energy(positions: np.ndarray) -> float:
        bodies = placed(tree, positions[None])
        moments = np.einsum('bij,bj->bi', bodies.rotation[0], tree.inertial_parameters[:, 1:4])
        heights = moments[:, 2] + tree.inertial_parameters[:, 0] * bodies.origin[0, :, 2]
        return 9.81 * float(heights.sum())

    step = 1e-5
    numeric = [
        (energy(at + step * unit) - energy(at - step * unit)) / (2.0 * step)
        for unit in np.eye(len(at))
    ]
    torques = gravity_torques(tree, placed(tree, np.array([at])))[0]
    np.testing.assert_allclose(torques, numeric, rtol=0.0, atol=1e-7)


def test_jacobian_with_mimic_joints_is_the_derivative() -> None:
    tree = tree_robot(read_urdf(_COUPLED, 'x'), 'x')
    at, step, frame = np.array([0.2, 0.7]), 1e-6, tree.frames['hand']
    columns = jacobian(tree, placed(tree, at[None]), frame)[0]
    for k, unit in enumerate(np.eye(2)):
        (after, before) = (
            frame_of(placed(tree, (at + sign * step * unit)[None]), frame) for sign in (1, -1)
        )
        velocity = (after[1][0] - before[1][0]) / (2.0 * step)
        spin = (after[0][0] - before[0][0]) @ before[0][0].T / (2.0 * step)
        turned = [spin[2, 1], spin[0, 2], spin[1, 0]]
        np.testing.assert_allclose(columns[:, k], [*velocity, *turned], atol=1e-5)


def test_largest_gravity_and_reach_of_a_planar_arm() -> None:
    urdf = robot(joint('a', 'base', 'b'), joint('c', 'b', 'd', limit=(0.5, 2.0, 50.0)))
    tree = tree_robot(read_urdf(urdf, 'x'), 'x')
    # Masses of 1 kg at 0.1 m of each link of 0.2 m; the second joint is bent by 0.5 at least.
    stretched = abs(0.1 + 0.2 + 0.1 * np.exp(0.5j))
    largest = largest_gravity_torques(tree, np.array([0.1, 1.0]))
    np.testing.assert_allclose(largest, [9.81 * stretched, 0.981], rtol=1e-12)
    assert reach(tree, 'd', np.array([0.1, 1.0])) == pytest.approx(0.2)


@pytest.mark.parametrize('name', ['ur_description/urdf/ur5_robot', 'panda_description/urdf/panda'])
def test_gravity_torques_equal_those_of_pinocchio(name: str) -> None:
    pinocchio = pytest.importorskip('pinocchio')
    urdf = f'package://example-robot-data/robots/{name}.urdf'
    values, _ = chosen(urdf)
    own = {n: v for n, v in values.items() if n.startswith('robot.')}
    mechanism: Any = mechanism_from({'robot.urdf': urdf, **own})
    model = pinocchio.buildModelFromXML(mechanism.text)
    random = np.random.default_rng(3)
    start = random.uniform(-1.0, 1.0, len(mechanism.joints))
    q = pinocchio.neutral(model)
    places = [model.joints[model.getJointId(j.name)] for j in mechanism.joints]
    for place, at in zip(places, start, strict=True):
        if place.nq == 1:
            q[place.idx_q] = at
        else:
            q[place.idx_q:place.idx_q + 2] = math.cos(at), math.sin(at)
    expected = pinocchio.computeGeneralizedGravity(model, model.createData(), q)
    torques = mechanism.details(start)['gravity']
    np.testing.assert_allclose(torques, [expected[p.idx_v] for p in places], atol=1e-9)
