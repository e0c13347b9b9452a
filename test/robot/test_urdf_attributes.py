# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Attributes of URDF: the documented table, their effect, and readings of Pinocchio."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

from hypothesis import example, given, HealthCheck, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.robot.tree.assembly import tree_robot
from masmc_ros.robot.tree.link_inertia import joint_pose
from masmc_ros.robot.urdf import ATTRIBUTES, Description, read_urdf
import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'reference' / 'urdf_robots.md'

_SHAPE = (
    '<origin xyz="0 0 0"/><geometry><box size="1 1 1"/><sphere radius="1"/>'
    '<cylinder radius="1" length="1"/><capsule radius="1" length="1"/>'
    '<mesh filename="a.stl"/></geometry>'
)
URDF = f"""<robot name="r" version="1.1"><link name="base"/><link name="other"/>
<link name="arm" type="x">
<inertial><origin xyz="0 0 0.1"/><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
<visual>{_SHAPE}<material><color/><texture/></material></visual>
<collision>{_SHAPE}</collision></link>
<joint name="arm_joint" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="10" velocity="2"/><dynamics damping="0.1"/>
<mimic joint="lift"/><safety_controller/><calibration/></joint>
<joint name="lift" type="continuous"><parent link="base"/><child link="other"/></joint></robot>
"""

SAMPLES = {
    'xyz': '0.1 0.2 0.3', 'rpy': '0.1 0.2 0.3', 'quat_xyzw': '0.6 0 0 0.8', 'lower': '-0.5',
    'upper': '0.5', 'type': 'prismatic', 'link': 'third', 'joint': 'third',
    'filename': 'b.stl', 'version': '7.0',
}  # fmt: skip
"""New values of attributes; 7 for the others."""

PAIRS = [(path, key) for path, attributes in ATTRIBUTES.items() for key in attributes]
CHECKED = [
    (path, key)
    for path, key in PAIRS
    if path.startswith(('link/inertial/', 'joint/'))
    and not path.endswith(('safety_controller', 'calibration'))
]


def with_attribute(path: str, key: str, value: str) -> str:
    """Return the URDF with an attribute in the first element with a path."""
    root = ElementTree.fromstring(URDF)
    places = {'robot': root, 'link': root[2], 'joint': root[3]}
    first, _, rest = path.partition('/')
    element = places[first].find(rest) if rest else places[first]
    assert element is not None
    element.set(key, value)
    return ElementTree.tostring(root, encoding='unicode')


def content(text: str) -> Description:
    """Return the description of a text without its lines."""
    description = read_urdf(text, 'x')
    # The radius of a wheel is no part of the model, but a default for a URDF alone.
    links = {
        link.name: replace(link, line=0, radius=0.0) for link in description.links.values()
    }
    joints = {joint.name: replace(joint, line=0) for joint in description.joints.values()}
    return replace(description, links=links, joints=joints)


def test_urdf_attributes_equal_documented_table() -> None:
    documented = {}
    lines = PAGE.read_text(encoding='utf-8').split('| element | attribute |')[1].split('\n\n')[0]
    for line in lines.splitlines()[2:]:
        elements, attributes, reading = line.split('|')[1:4]
        for path in re.findall('`([^`]*)`', elements):
            for key in re.findall('`([^`]*)`', attributes):
                assert (path, key) not in documented
                documented[path, key] = reading.strip()
    assert {pair: reading != 'ignored' for pair, reading in documented.items()} == {
        (path, key): ATTRIBUTES[path][key] for path, key in PAIRS
    }
    assert set(documented.values()) == {'used', 'ignored', 'rejected'}


@pytest.mark.parametrize(('path', 'key'), PAIRS)
def test_urdf_attribute_has_effect_only_if_used(path: str, key: str) -> None:
    text = with_attribute(path, key, SAMPLES.get(key, '7'))
    assert text != with_attribute('robot', 'name', 'r')
    if not ATTRIBUTES[path][key]:
        assert content(text) == content(URDF)
        return
    try:
        assert content(text) != content(URDF)
    except InputError as error:
        # An unknown name or version, or a spring.
        assert SAMPLES.get(key, '7') in str(error) or key == 'name'


@pytest.mark.parametrize(('path', 'key'), CHECKED)
def test_urdf_misspelt_attribute_suggests_name(path: str, key: str) -> None:
    with pytest.raises(InputError) as raised:
        read_urdf(with_attribute(path, f'{key}_', '0'), 'robot.urdf')
    tag = path.rpartition('/')[2]
    pattern = rf"robot.urdf, line \d+: .*: <{tag}> has unknown {key}_; (did you mean|known are) .*"
    assert re.fullmatch(pattern, str(raised.value))
    assert key in str(raised.value).partition('unknown')[2].partition(';')[2]


@pytest.mark.parametrize(
    ('old', 'new', 'expected'),
    [
        ('<inertial>', '<Inertial/><inertial>', "'arm': <Inertial> is unknown; did you mean ine"),
        ('<mass ', '<Mass value="1"/><mass ', '<Mass> in <inertial> is unknown; did you mean mas'),
        ('<axis ', '<Origin/><axis ', '<Origin> is unknown; did you mean origin?'),
        ('<axis ', '<limits/><axis ', '<limits> is unknown; did you mean limit?'),
        ('<axis xyz="0 1 0"/>', '<axis>0 1 0</axis>', "<axis> has text '0 1 0', expected attribu"),
        ('<axis xyz="0 1 0"/>', '<axis/>', '<axis> without xyz'),
        ('<axis ', '<origin/><axis ', '<origin> again, after line 8'),
        ('</inertial>', '</inertial><inertial/>', '<inertial> again, after line 3'),
        ('<inertial>', '<mass value="1"/><inertial>', '<mass> outside of <inertial>, expected in'),
        ('<link name="base"/>', '<Link/><link name="base"/>', '<Link> is unknown; did you mean l'),
        ('="0 0 0.5"', '="0 0 0.5" rpy="0 0 1" quat_xyzw="0 0 0 1"', 'rpy and quat_xyzw, expecte'),
        ('="0 0 0.5"', '="0 0 0.5" quat_xyzw="0 0 0 0"', 'expected a quaternion of length 1'),
        ('="0 0 0.5"', '="0 0 0.5" quat_xyzw="0 0 1"', "quat_xyzw '0 0 1', expected 4 finite nu"),
        ('mimic joint="lift"', 'mimic joint="lfit"', "mimics 'lfit', which is no joint; did you"),
        ('mimic joint="lift"', 'mimic joint="arm_joint"', "mimics 'arm_joint', which mimics it"),
        ('effort="10"', 'effort="-1"', "effort '-1', expected a number >= 0; 0 or no attribute: "),
        ('effort="10"', 'effort="inf"', "effort 'inf', expected a number >= 0; 0 or no attribute"),
        ('upper="1"', 'upper="inf"', "'inf', expected a finite number; a joint without range is"),
        ('link="arm"', 'link="arm "', "link 'arm ', expected no space around the name"),
        ('"continuous"', '"floating"', 'if it connects the robot to the world, remove it and its'),
        ('version="1.1"', 'version="2.0"', "<robot> version '2.0', expected 1.0, 1.1 or 1.2"),
        *(
            ('mass value="2"', f'mass value="{number}"', f"value '{number}', expected a number")
            for number in ('0x10', '1,5', '1_0', 'nan', '1e400', '١', '1.5abc', '1e', '.')
        ),
    ],
)
def test_urdf_silent_misreading_raises_one_line(old: str, new: str, expected: str) -> None:
    assert old in URDF
    with pytest.raises(InputError) as raised:
        read_urdf(URDF.replace(old, new), 'robot.urdf')
    assert expected in str(raised.value)
    assert re.match(r'robot.urdf, line \d+: ', str(raised.value))


@pytest.mark.parametrize('kind', ['fixed', 'continuous'])
@pytest.mark.parametrize(
    ('old', 'new', 'expected'),
    [
        ('upper="1"', 'upper="0x1"', "upper '0x1', expected a finite number"),
        ('damping="0.1"', 'damping="0,1"', "damping '0,1', expected a "),
    ],
)
def test_urdf_wrong_number_without_effect_raises(
    old: str, new: str, expected: str, kind: str
) -> None:
    """Other readers reject the file, though the number has no effect."""
    text = URDF.replace('type="revolute"', f'type="{kind}"').replace('<mimic joint="lift"/>', '')
    arm = content(text).joints['arm_joint']
    assert (arm.lower, arm.upper) == (-math.inf, math.inf)
    with pytest.raises(InputError, match=expected):
        read_urdf(text.replace(old, new), 'robot.urdf')


def test_urdf_quaternion_in_first_version_raises() -> None:
    text = with_attribute('joint/origin', 'quat_xyzw', '0 0 0 1')
    assert content(text).joints['arm_joint'].origin.quaternion == (0, 0, 0, 1)
    with pytest.raises(InputError, match=r'readers of URDF 1\.0 ignore; expected rpy, or <robot'):
        read_urdf(text.replace(' version="1.1"', ''), 'x')


def test_urdf_elements_of_other_tools_are_ignored() -> None:
    inside = '<gazebo/><hardwareInterface>x</hardwareInterface><drake:gear a="1">2</drake:gear>'
    text = URDF.replace('<axis ', f'{inside}<axis ').replace('<inertial>', '<contact/><inertial>')
    text = text.replace('<link name="base"/>', '<gazebo/><ros2_control/><link name="base"/>')
    assert content(text.replace('<robot ', '<robot xmlns:drake="d" ')) == content(URDF)


_number = st.integers(-2000000, 2000000).map(lambda value: repr(value / 1e6))
_odd = st.sampled_from(['0x1', '1,5', '1_0', 'nan', 'inf', '1e1', '+.5', '5.', '-0', '1d0', ''])
_amount = _number.map(lambda text: text.removeprefix('-'))


def _vector(size: int) -> st.SearchStrategy[str]:
    return st.lists(_number, min_size=size, max_size=size).map(' '.join)


@st.composite
def _descriptions(draw: st.DrawFn) -> str:
    """Return a URDF of a random tree, sometimes with a number that readers do not accept."""
    count = draw(st.integers(2, 5))
    version = draw(st.sampled_from(['', ' version="1.1"']))
    parts = []
    for i in range(count):
        x, y, z = (draw(st.floats(0.01, 0.1)) for _ in range(3))
        parts.append(
            f'<link name="l{i}"><inertial>{_origin(draw, version)}<mass value="{draw(_amount)}"/>'
            f'<inertia ixx="{y + z}" ixy="0" ixz="0" iyy="{x + z}" iyz="0.001" izz="{x + y}"/>'
            '</inertial></link>'
        )
    for i in range(1, count):
        kind = draw(st.sampled_from(['revolute', 'prismatic', 'continuous', 'fixed']))
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{draw(st.integers(0, i - 1))}"/>'
            f'<child link="l{i}"/>{_origin(draw, version)}<axis xyz="{draw(_vector(2))} 0.7"/>'
            f'{_mimic(draw, i, count)}'
            f'<limit lower="-{draw(_amount)}" upper="{draw(_amount)}"'
            f' effort="{draw(_amount)}" velocity="{draw(_amount)}"/></joint>'
        )
    text = f'<robot name="r"{version}>{"".join(draw(st.permutations(parts)))}</robot>'
    if draw(st.integers(0, 2)):
        return text
    place = draw(st.sampled_from(list(re.finditer(r'-?\d+\.\d+(?=[" ])', text))))
    return f'{text[:place.start()]}{draw(_odd)}{text[place.end():]}'


def _origin(draw: st.DrawFn, version: str) -> str:
    rotation = draw(st.sampled_from(['', 'rpy', 'quat_xyzw']))
    last = ' 0.9' if rotation == 'quat_xyzw' else ''
    turned = f' {rotation}="{draw(_vector(3))}{last}"' if rotation else ''
    return f'<origin xyz="{draw(_vector(3))}"{turned}/>'


def _mimic(draw: st.DrawFn, number: int, count: int) -> str:
    """Return a mimic element or none; joints may mimic in a chain or, in the end, themselves."""
    others = [i for i in range(1, count) if i != number]
    if not others or draw(st.integers(0, 2)):
        return ''
    values = f'multiplier="{draw(_number)}" offset="{draw(_number)}"'
    return f'<mimic joint="j{draw(st.sampled_from(others))}" {values}/>'


_CHAIN = ''.join(
    f'<link name="l{i}"><inertial><origin xyz="0.1 {i} 0"/><mass value="{i}"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
    f'<joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
    f'<origin xyz="1 2 3" rpy="0.3 0.2 0.1"/><axis xyz="0 1 0.7"/>{mimic}'
    '<limit lower="-1" upper="1" effort="2" velocity="3"/></joint>'
    for i, (kind, mimic) in enumerate((
        ('revolute', '<mimic joint="j2" multiplier="-0.5" offset="0.2"/>'),
        ('prismatic', '<mimic joint="j3" multiplier="0.25"/>'),
        ('revolute', ''),
        ('continuous', '<mimic joint="j1"/>'),
    ), 1)
)  # fmt: skip
"""Links of a chain in which three joints mimic the third one, two of them by others."""

_equal: list[str] = []
"""Texts that both readers accept."""


@given(_descriptions())
@example(
    '<robot name="r" version="1.1"><link name="l0"/><link name="l1"><inertial><mass value="1"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
    '<joint name="j1" type="revolute"><parent link="l0"/><child link="l1"/>'
    '<origin xyz="1 2 3" quat_xyzw="0.5 -0.1 0.3 2"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="2" velocity="3"/></joint></robot>'
)
@example(f'<robot name="r"><link name="l0"/>{_CHAIN}</robot>')
@settings(
    max_examples=150, deadline=None, derandomize=True, database=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
def _compare(text: str) -> None:
    pin = pytest.importorskip('pinocchio')
    try:
        description = read_urdf(text, 'robot.urdf')
        robot = tree_robot(description, 'robot.urdf')
    except InputError as error:
        assert '\n' not in str(error)
        assert str(error).startswith('robot.urdf')
        return
    _equal.append(text)
    model = pin.buildModelFromXML(text)
    positions = dict(robot.held) | dict.fromkeys((joint.name for joint in robot.joints), 0.4)
    for name, (_, multiplier, offset) in robot.mimics.items():
        positions[name] = multiplier * 0.4 + offset
    q, held = pin.neutral(model), []
    moved = {joint.name for joint in robot.moving}
    for name in model.names[1:]:
        number, at = model.getJointId(name), positions.get(name, 0.0)
        place = model.joints[number]
        q[place.idx_q:place.idx_q + place.nq] = (
            [at] if place.nq == 1 else [math.cos(at), math.sin(at)]
        )
        held += [] if name in moved else [number]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    for joint in description.joints.values():
        rotation, offset = joint_pose(joint, positions.get(joint.name, 0.0))
        ends = [data.oMf[model.getFrameId(link)] for link in (joint.parent, joint.child)]
        other = ends[0].actInv(ends[1])
        np.testing.assert_allclose(np.reshape(rotation, (3, 3)), other.rotation, atol=1e-9)
        np.testing.assert_allclose(offset, other.translation, atol=1e-9)
    model = pin.buildReducedModel(model, held, q)
    for number, joint in enumerate(robot.moving, 1):
        mass, x, y, z, xx, yy, zz, xy, yz, zx = robot.inertial_parameters[number]
        expected = [mass, x, y, z, yy + zz, -xy, xx + zz, -zx, -yz, xx + yy]
        parameters = model.inertias[model.getJointId(joint.name)].toDynamicParameters()
        np.testing.assert_allclose(expected, parameters, atol=1e-9)
    sources = {mimic.source for mimic in robot.mimics.values()}
    for joint in robot.joints:
        place = model.joints[model.getJointId(joint.name)]
        assert joint.effort == model.upperEffortLimit[place.idx_v]
        if joint.name in sources:
            # Mimic joints narrow range and speed, which other tests compare with sums by hand.
            continue
        assert joint.speed == model.velocityLimit[place.idx_v]
        if joint.kind != 'continuous':
            assert joint.lower == model.lowerPositionLimit[place.idx_q]
            assert joint.upper == model.upperPositionLimit[place.idx_q]


def test_urdf_random_files_equal_pinocchio_or_raise() -> None:
    _compare()
    assert 15 < len(_equal) < 150
    assert any('<mimic' in text for text in _equal)
