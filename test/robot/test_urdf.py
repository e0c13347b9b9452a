# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""URDF reader: parsed content, and a one-line error for invalid descriptions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import random
import re
import xml.etree.ElementTree as ElementTree

from masmc_ros.errors import InputError
from masmc_ros.robot.tree.assembly import tree_robot
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.urdf import read_urdf
import numpy as np
import pytest

INERTIA = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="2.0"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)
URDF = f"""<?xml version="1.0"?>
<robot name="two arms">
  <link name="base">{INERTIA}</link>
  <link name="upper">{INERTIA}</link>
  <link name="lower">{INERTIA}</link>
  <link name="hand"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.5" rpy="0 0 1.5"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
  </joint>
  <joint name="elbow" type="prismatic">
    <parent link="upper"/><child link="lower"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.3" effort="10" velocity="2"/>
  </joint>
  <joint name="wrist" type="fixed">
    <parent link="lower"/><child link="hand"/><origin xyz="0 0 0.2"/>
  </joint>
</robot>
"""


def error_of(text: str | bytes) -> str:
    """Return the error message for a text."""
    with pytest.raises(InputError) as raised:
        tree_robot(read_urdf(text, 'robot.urdf'), 'robot.urdf')
    return str(raised.value)


def test_urdf_valid_text_yields_links_joints_and_lines() -> None:
    description = read_urdf(URDF, 'robot.urdf')
    assert (description.name, description.root, list(description.links)) == (
        'two arms',
        'base',
        ['base', 'upper', 'lower', 'hand'],
    )
    shoulder = description.joints['shoulder']
    assert (shoulder.line, shoulder.axis, shoulder.origin.offset) == (7, (0, 0, 1), (0, 0, 0.5))
    assert (shoulder.lower, shoulder.upper, shoulder.speed, shoulder.effort) == (-1, 1, 2, 10)
    robot = tree_robot(description, 'robot.urdf')
    assert [joint.name for joint in robot.joints] == ['shoulder', 'elbow']
    assert [limit.tolist() for limit in robot.limits] == [[-1, 0], [1, 0.3], [2, 2], [10, 10]]
    assert robot.frames['hand'].body == 2
    assert robot.frames['hand'].offset == (0.0, 0.0, 0.2)


def test_tree_robot_held_joint_and_base_frame_move_subtrees() -> None:
    robot = tree_robot(
        read_urdf(URDF, 'x'), 'x', joints=('elbow',), held={'shoulder': 0.3}, base_frame='upper'
    )
    assert robot.frames['upper'].offset == (0.0, 0.0, 0.0)
    assert robot.frames['base'].offset == pytest.approx((0.0, 0.0, -0.5))
    assert robot.inertial_parameters[0][0] == 4.0


@pytest.mark.parametrize(
    ('old', 'new', 'expected'),
    [
        ('<mass value="2.0"/>', '<mass value="-2"/>', "line 3: link 'base': value '-2', expect"),
        ('<mass value="2.0"/>', '<mass value="NaN"/>', "line 3: link 'base': value 'NaN'"),
        ('<mass value="2.0"/>', '', "line 3: link 'base': no <mass>"),
        ('ixx="0.1"', 'ixx="0.9"', "line 4: link 'upper' has an inertia that no body has: the le"),
        ('link="upper"', 'link="uper"', "joint 'shoulder': no link 'uper'; did you mean upper?"),
        ('child link="lower"', 'child link="base"', "joint 'elbow' closes a loop of links"),
        ('child link="hand"', 'child link="upper"', "joint 'wrist': link 'upper' hangs on joint"),
        ('name="elbow"', 'name="shoulder"', "line 12: 'shoulder' again, after line 7"),
        ('name="elbow" ', '', 'line 12: <joint>: <joint> without name'),
        ('type="revolute"', 'type="floating"', "line 7: joint 'shoulder': type 'floating'; known"),
        ('xyz="0 0 2"', 'xyz="0 0 0"', "joint 'shoulder': axis (0.0, 0.0, 0.0), expected"),
        ('xyz="0 0 2"', 'xyz="0 0"', "line 9: joint 'shoulder': xyz '0 0', expected 3 finite"),
        ('lower="-1"', 'lower="7"', "line 10: joint 'shoulder': lower 7.0 above upper 1.0"),
        ('effort="10"', 'effort="-3"', "line 10: joint 'shoulder': effort '-3', expected a numb"),
        ('velocity="2"', 'velocity="fast"', "line 10: joint 'shoulder': velocity 'fast', expecte"),
        ('<limit lower="0" upper="0.3" effort="10" velocity="2"/>', '', "elbow': no <limit>, whi"),
        ('<parent link="lower"/>', '', "joint 'wrist': no <parent>"),
        (
            '<link name="hand"/>',
            '<link name="hand"/><link name="b"/>',
            "link 'b' hangs on nothing",
        ),
        ('</robot>', '', 'no XML: no element found'),
        ('<robot ', '<robot/><robot ', 'no XML: junk after document element'),
        ('<robot ', '<xacro:macro name="m"/><robot ', 'is xacro, which makes URDF; give what `xa'),
        ('<link name="hand"/>', '<link name="hand"><xacro:i/></link>', 'line 6: <xacro:i> is xac'),
        ('  <link name="hand"/>', '<xacro:include filename="h"/>', 'is xacro, which makes URDF'),
        ('robot>\n', 'sdf>\n', 'no XML: mismatched tag'),
    ],
)
def test_urdf_invalid_text_raises_one_line(old: str, new: str, expected: str) -> None:
    assert old in URDF
    message = error_of(URDF.replace(old, new))
    assert expected in message
    assert message.startswith('robot.urdf')
    assert '\n' not in message


@pytest.mark.parametrize(
    ('joints', 'positions', 'expected'),
    [
        (('wrist',), (0.0,), "line 16: joint 'wrist' does not move"),
        (('shoulder',), (1.2,), "line 7: joint 'shoulder' is held at 1.2, expected -1.0 to 1.0"),
        (('elbow',), (-0.1,), "line 12: joint 'elbow' is held at -0.1, expected 0.0 to 0.3"),
        (('elbow', 'elbow'), (0.1, 0.2), "held_joints ['elbow', 'elbow']: expected different"),
        (('hip',), (0.0,), "no joint 'hip'; known are shoulder, elbow, wrist"),
    ],
)
def test_urdf_invalid_held_joint_raises_one_line(
    joints: tuple[str, ...], positions: tuple[float, ...], expected: str
) -> None:
    values = {'robot.urdf': URDF, 'robot.held_joints': joints, 'robot.held_positions': positions}
    with pytest.raises(InputError) as raised:
        tree_mechanism(values)
    assert expected in str(raised.value)
    assert '\n' not in str(raised.value)


FLANGE = """<link name="flange"><inertial><mass value="{}"/>
<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial></link>
<joint name="mount" type="{}"><parent link="{}"/><child link="flange"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize('kind', ['fixed', 'revolute'])
def test_tree_robot_bad_inertia_of_merged_link_raises(kind: str) -> None:
    text = URDF.replace('</robot>', FLANGE.format(0.05, -0.003, 1e-4, 1e-4, kind, 'upper'))
    held = {'mount': 0.1} if kind == 'revolute' else {}
    expected = "^x, line 19: link 'flange' has an inertia that no body has.* -0.0015 kg"
    with pytest.raises(InputError, match=expected):
        tree_robot(read_urdf(text, 'x'), 'x', held=held)
    # The base of this robot does not move.
    on_base = text.replace('<parent link="upper"/><child link="flange"', '<parent link="base"/>'
                           '<child link="flange"')  # fmt: skip
    assert len(tree_robot(read_urdf(on_base, 'x'), 'x', held=held).joints) == 2


def test_tree_robot_zero_mass_with_inertia_raises() -> None:
    text = URDF.replace('mass value="2.0"', 'mass value="0"')
    expected = "^x, line 4: link 'upper' has mass 0 with a moment of inertia; expected a mass > 0"
    with pytest.raises(InputError, match=expected):
        tree_robot(read_urdf(text, 'x'), 'x')


@pytest.mark.parametrize(
    ('mass', 'inertia', 'notes'),
    [
        (0.1, (1e-9, 1e-9, 4e-9), ()),
        (0.1, (1e-3, 1e-3, 4e-3), ("link 'flange' has an inertia that no body has: the least",)),
        (0.0, (1e-3, 1e-3, 1e-3), ("link 'flange' has mass 0 with a moment of inertia, 0.58 % ",)),
    ],
)
def test_tree_robot_possible_body_of_bad_link_is_noted(
    mass: float, inertia: tuple[float, ...], notes: tuple[str, ...]
) -> None:
    text = URDF.replace('</robot>', FLANGE.format(mass, *inertia, 'fixed', 'upper'))
    robot = tree_robot(read_urdf(text, 'x'), 'x')
    assert [note[:len(start)] for note, start in zip(robot.notes, notes, strict=True)] == [*notes]


def test_urdf_robot_without_moving_mass_raises() -> None:
    massless = re.sub('<inertial>.*?</inertial>', '', URDF)
    text = massless.replace('<link name="base"></link>', f'<link name="base">{INERTIA}</link>')
    assert text != massless
    with pytest.raises(InputError, match='no link that moves has a mass; expected an <inertial>'):
        tree_mechanism({'robot.urdf': text})
    # A base with a mass moves.
    assert tree_mechanism({'robot.urdf': text, 'robot.base': 'omnidirectional'}).joints


@pytest.mark.parametrize('name', ['base_yaw_joint', 'base_turn_joint'])
def test_urdf_joint_named_like_base_raises(name: str) -> None:
    expected = f"line 12: joint '{name}': this name is reserved for the base; rename the joint"
    with pytest.raises(InputError, match=expected):
        tree_mechanism({'robot.urdf': URDF.replace('name="elbow"', f'name="{name}"')})


MIMIC = '<limit lower="0" upper="0.3" effort="10" velocity="2"/>'


def test_urdf_mimic_joint_of_controlled_joint_moves() -> None:
    text = URDF.replace(MIMIC, f'{MIMIC}<mimic joint="shoulder" multiplier="0.5" offset="0.2"/>')
    mechanism = tree_mechanism({'robot.urdf': text})
    assert [joint.name for joint in mechanism.joints] == ['shoulder']
    assert mechanism.robot.mimics == {'elbow': ('shoulder', 0.5, 0.2)}
    assert mechanism.notes == (
        "mimic joint 'elbow' limits 'shoulder' to -0.4 to 0.2 rad",
        "the effort limit of mimic joint 'elbow', which the drive of 'shoulder' moves, is ignored",
    )
    assert {name: end.tolist() for name, end in mechanism.joint_limits.items()} == {
        'lower': [pytest.approx(-0.4)], 'upper': [pytest.approx(0.2)], 'speed': [2.0],
    }  # fmt: skip


def test_urdf_mimic_joint_of_held_joint_has_its_position() -> None:
    text = URDF.replace(MIMIC, f'{MIMIC}<mimic joint="shoulder" multiplier="0.5" offset="0.2"/>')
    wrist = f'<axis xyz="0 0 1"/>{MIMIC}<mimic joint="elbow" multiplier="-2"/></joint>'
    text = text.replace('"wrist" type="fixed"', '"wrist" type="prismatic"')
    text = text.replace('0 0 0.2"/>\n  </joint>', f'0 0 0.2"/>{wrist}')
    free = FLANGE.format(1.0, 0.1, 0.1, 0.1, 'revolute', 'hand')
    description = read_urdf(text.replace('</robot>', free), 'x')
    robot = tree_robot(description, 'x', held={'shoulder': 0.3})
    assert (robot.notes, [joint.name for joint in robot.joints]) == ((), ['mount'])
    assert robot.held == pytest.approx({'shoulder': 0.3, 'elbow': 0.35, 'wrist': -0.7})


def test_tree_robot_order_of_joints_is_kept() -> None:
    arm = FLANGE.format(1.0, 0.1, 0.1, 0.1, 'revolute', 'base')
    text = URDF.replace('</robot>', arm)
    names = ['mount', 'shoulder', 'elbow']
    by_file = tree_robot(read_urdf(text, 'x'), 'x')
    assert [joint.name for joint in by_file.joints] == ['shoulder', 'elbow', 'mount']
    robot = tree_robot(read_urdf(text, 'x'), 'x', joints=names)
    assert [joint.name for joint in robot.joints] == names
    assert robot.tree.parent.tolist() == [-1, 0, 0, 2]
    assert robot.limits.effort.tolist() == [1, 10, 10]
    assert robot.inertial_parameters[1][0] == 1.0
    mechanism = tree_mechanism({'robot.urdf': text, 'robot.joints': names})
    assert [joint.name for joint in mechanism.joints] == names


@pytest.mark.parametrize('joints', [('elbow', 'shoulder'), ('shoulder', 'elbow', 'elbow')])
def test_tree_robot_impossible_order_of_joints_raises(joints: tuple[str, ...]) -> None:
    expected = r'^robot.joints \[.*\]: expected each joint once, and .*: \[shoulder, elbow\]$'
    with pytest.raises(InputError, match=expected):
        tree_robot(read_urdf(URDF, 'x'), 'x', joints=joints)


def test_urdf_joint_at_end_of_range_is_found() -> None:
    mechanism = tree_mechanism({'robot.urdf': URDF, 'robot.task': ('joints',)})
    positions = np.array([[0.0, 0.0], [-0.9999, 0.15], [0.99, 0.2999], [1.5, -0.1]])
    assert mechanism.at_range_ends(positions).tolist() == [
        [False, True], [True, False], [False, True], [True, True],
    ]  # fmt: skip
    text = mechanism.range_ends_text(np.array([True, True]))
    assert text == 'shoulder and elbow at the ends of their ranges'
    ignored = tree_mechanism({'robot.urdf': URDF, 'robot.limit_margin': 0.0})
    assert not ignored.at_range_ends(positions).any()


@pytest.mark.parametrize('kind', ['continuous', 'prismatic'])
def test_urdf_last_joint_without_inertia_needs_armature(kind: str) -> None:
    limit = '<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
    text = URDF.replace('type="fixed"', f'type="{kind}"')
    text = text.replace('0.2"/>\n  </joint>', f'0.2"/>{limit}')
    with pytest.raises(InputError) as raised:
        tree_mechanism({'robot.urdf': text, 'robot.armature': 0.0})
    assert str(raised.value) == (
        "robot_description, line 16: joint 'wrist': the links that it moves have no inertia,"
        ' expected an <inertial> or robot.armature > 0'
    )
    assert len(tree_mechanism({'robot.urdf': text, 'robot.armature': 1e-9}).joints) == 3
    fixed = tree_mechanism({'robot.urdf': URDF, 'robot.armature': 0.0})
    assert [joint.name for joint in fixed.joints] == ['shoulder', 'elbow']


def test_urdf_held_joint_of_range_zero_at_any_position() -> None:
    # A range from 0 to 0 is that of a limit without range, and is ignored.
    text = URDF.replace('lower="-1" upper="1"', 'lower="0" upper="0"')
    assert text != URDF
    robot = tree_robot(read_urdf(text, 'x'), 'x', held={'shoulder': 1.2})
    assert [joint.name for joint in robot.joints] == ['elbow']


@pytest.mark.parametrize('base', ['differential', 'omnidirectional'])
def test_tree_robot_impossible_inertia_of_moving_base_raises(base: str) -> None:
    wheels = ('right', 'left') if base == 'differential' else ()
    wheel = (
        f'<link name="{{0}}_wheel">{INERTIA}</link><joint name="{{0}}" type="continuous">'
        '<parent link="base"/><child link="{0}_wheel"/><origin xyz="0 {1} 0.1"/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )
    text = URDF
    for name, y in zip(wheels, ('-0.2', '0.2'), strict=False):
        text = text.replace('</robot>', wheel.format(name, y))
    assert tree_robot(read_urdf(text, 'x'), 'x', base=base, wheels=wheels).tree.base > 0
    description = read_urdf(text.replace('ixx="0.1"', 'ixx="0.9"', 1), 'robot.urdf')
    expected = "^robot.urdf, line 3: link 'base'.* has an inertia that no body has"
    with pytest.raises(InputError, match=expected):
        tree_robot(description, 'robot.urdf', base=base, wheels=wheels)
    # The inertia of a fixed base has no effect.
    assert tree_robot(description, 'x').tree.base == 0


def test_urdf_entities_or_excessive_size_raise() -> None:
    bomb = '<!DOCTYPE r [<!ENTITY a "x"><!ENTITY b "&a;&a;&a;">]>\n<robot name="&b;"/>'
    assert error_of(bomb) == 'robot.urdf, line 1: a document type, which no URDF has'
    assert 'more than 10000000 bytes' in error_of(b' ' * 10_000_001)
    assert 'no link' in error_of('<robot>' + '<a>' * 100_000 + '</a>' * 100_000 + '</robot>')
    chain = ''.join(
        f'<link name="l{i}"/><joint name="j{i}" type="fixed"><parent link="l{i}"/>'
        f'<child link="l{i + 1}"/></joint>'
        for i in range(5_000)
    )
    description = read_urdf(f'<robot>{chain}<link name="l5000"/></robot>', 'x')
    assert tree_robot(description, 'x').frames['l5000'].body == 0


@pytest.mark.parametrize(
    ('declaration', 'encoding', 'published'),
    [
        ('<?xml version="1.0"?>', 'utf-8', '<?xml version="1.0"?>'),
        ('<?xml version="1.0"?>', 'utf-8-sig', '<?xml version="1.0"?>'),
        ('<?xml version="1.0" encoding="UTF-8"?>', 'utf-8', None),
        ("<?xml version='1.0' encoding='ISO-8859-1'?>", 'iso-8859-1', "<?xml version='1.0'?>"),
        ('<?xml version="1.0" encoding="cp1252" ?>', 'cp1252', '<?xml version="1.0" ?>'),
        ('<?xml version="1.0" encoding="UTF-16"?>', 'utf-16', '<?xml version="1.0"?>'),
        ('<?xml version="1.0" encoding="UTF-16"?>', 'utf-16-be', '<?xml version="1.0"?>'),
        ('<?xml version="1.0"?>', 'utf-16-le', '<?xml version="1.0"?>'),
    ],
)
def test_urdf_file_any_declared_encoding_is_published_as_utf_8(
    declaration: str, encoding: str, published: str | None, tmp_path: Path
) -> None:
    path = tmp_path / 'robot.urdf'
    content = URDF.replace('<?xml version="1.0"?>', declaration).replace('elbow', 'coude_é')
    path.write_bytes(content.replace('\n', '\r\n').encode(encoding))
    mechanism = tree_mechanism({'robot.urdf': str(path)})
    assert [joint.name for joint in mechanism.joints] == ['shoulder', 'coude_é']
    text = mechanism.formulas.description({}, ['shoulder', 'coude_é'], '')
    assert text == content.replace(declaration, published or declaration)
    # A receiver parses bytes, so the declaration must agree with them.
    names = [joint.get('name') for joint in ElementTree.fromstring(text.encode()).iter('joint')]
    assert names == ['shoulder', 'coude_é', 'wrist']


def test_urdf_file_ascii_text_keeps_its_declaration(tmp_path: Path) -> None:
    path = tmp_path / 'robot.urdf'
    text = URDF.replace('1.0"?', '1.0" encoding="us-ascii"?')
    path.write_text(text, encoding='ascii')
    assert tree_mechanism({'robot.urdf': str(path)}).text == text


@pytest.mark.parametrize(
    ('declared', 'encoding', 'expected'),
    [
        ('UTF-8', 'latin-1', 'no XML: not well-formed'),
        ('UTF-16', 'utf-8', 'no XML: encoding specified in XML declaration is incorrect'),
        ('shift_jis', 'shift_jis', 'no XML: multi-byte encodings are not supported'),
        ('klingon', 'utf-8', 'no XML: unknown encoding: klingon'),
    ],
)
def test_urdf_file_invalid_encoding_raises_one_line(
    declared: str, encoding: str, expected: str, tmp_path: Path
) -> None:
    path = tmp_path / 'robot.urdf'
    text = URDF.replace('1.0"?', f'1.0" encoding="{declared}"?')
    path.write_bytes(text.replace('two arms', '¶ ¶').encode(encoding))
    with pytest.raises(InputError) as raised:
        tree_mechanism({'robot.urdf': str(path)})
    assert expected in str(raised.value)
    assert str(raised.value).startswith(str(path))
    assert '\n' not in str(raised.value)


_Damage = Callable[[str, random.Random], str]


def _flip(text: str, draw: random.Random) -> str:
    at = draw.randrange(len(text))
    return text[:at] + chr(draw.randrange(32, 127)) + text[at + 1:]


def _drop(text: str, draw: random.Random) -> str:
    lines = text.split('\n')
    del lines[draw.randrange(len(lines))]
    return '\n'.join(lines)


def _double(text: str, draw: random.Random) -> str:
    lines = text.split('\n')
    at = draw.randrange(len(lines))
    return '\n'.join([*lines[:at], lines[at], *lines[at:]])


def _number(text: str, draw: random.Random) -> str:
    at = draw.choice(list(re.finditer(r'"(-?[\d.]+)"', text)))
    new = draw.choice(['nan', 'inf', '-1', '1e400', '', '0x1', '1,5', '-0.0', '1e308'])
    return f'{text[:at.start(1)]}{new}{text[at.end(1):]}'


def _name(text: str, draw: random.Random) -> str:
    at = draw.choice(list(re.finditer(r'(?:link|name)="([a-z]+)"', text)))
    return f'{text[:at.start(1)]}{draw.choice(["base", "hand", "", "é"])}{text[at.end(1):]}'


def _truncate(text: str, draw: random.Random) -> str:
    return text[:draw.randrange(len(text))]


def test_urdf_random_damage_is_read_or_raises_one_line() -> None:
    draw = random.Random(5)
    ways: list[_Damage] = [_drop, _double, _number, _name]
    count = 0
    for _ in range(400):
        text = URDF
        for _ in range(draw.randrange(1, 4)):
            text = draw.choice(ways)(text, draw)
        text = draw.choice([_flip, _flip, _truncate])(text, draw)
        try:
            tree_robot(read_urdf(text, 'robot.urdf'), 'robot.urdf')
        except InputError as raised:
            count += 1
            assert str(raised).startswith('robot.urdf')
            assert '\n' not in str(raised)
    assert count > 200
