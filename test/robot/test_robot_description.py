# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robot description: valid URDF, equal to the equations in kinematics and inertia."""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from helpers.robots import Array, between, DEFAULT, Machine, machines, PROPERTY, task_positions
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.topics import DRIVEN_JOINTS
from masmc_ros.robot.robot import robot_description
from masmc_ros.robot.two_link.constants import base_parameters
import numpy as np
import pytest

POSITIONS = st.tuples(between(-50.0, 50.0), between(-50.0, 50.0), *[between(-9.0, 9.0)] * 5)


def description(machine: Machine, prefix: str = '') -> Xml.Element:
    """Return the root of a robot's URDF."""
    values = {f'robot.{name}': value for name, value in machine.physical.items()}
    return Xml.fromstring(robot_description(values, prefix))


def numbers(text: str | None) -> Array:
    """Return the numbers of an attribute."""
    assert text is not None
    return np.array(text.split(), dtype=np.float64)


def link_of(joint: Xml.Element, end: str) -> str:
    """Return the name of the parent or child link of a joint."""
    element = joint.find(end)
    assert element is not None
    return element.attrib['link']


def origin(element: Xml.Element) -> Array:
    """Return the position of an element without rotation."""
    element_origin = element.find('origin')
    assert element_origin is not None
    assert not numbers(element_origin.get('rpy', '0 0 0')).any()
    return numbers(element_origin.get('xyz'))


def rotation(axis: Array, angle: float) -> Array:
    """Return the matrix of a rotation about a unit vector, by the formula of Rodrigues."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def places(root: Xml.Element, angles: dict[str, float]) -> dict[str, Array]:
    """Return the pose of every link in the root link (4 x 4), from the URDF's joints."""
    joints = {link_of(joint, 'child'): joint for joint in root.findall('joint')}

    def place(link: str) -> Array:
        if link not in joints:
            return np.eye(4)
        joint = joints[link]
        pose = np.eye(4)
        pose[:3, 3] = origin(joint)
        if joint.get('type') != 'fixed':
            axis = joint.find('axis')
            assert axis is not None
            pose[:3, :3] = rotation(numbers(axis.get('xyz')), angles[joint.attrib['name']])
        return np.asarray(place(link_of(joint, 'parent')) @ pose)

    return {link.attrib['name']: place(link.attrib['name']) for link in root.findall('link')}


@PROPERTY
@given(machines(), POSITIONS)
def test_description_kinematics_equal_equations(
    machine: Machine, position: tuple[float, ...]
) -> None:
    root = description(machine)
    link_poses = places(root, dict(zip(DRIVEN_JOINTS, position[3:], strict=True)))
    base = np.eye(4)
    base[:2, 3] = position[:2]
    base[:3, :3] = rotation(np.array([0.0, 0.0, 1.0]), position[2])
    task = task_positions(np.array(machine.geometry), np.array([position]))[0]
    for link, expected in (('end_effector', task[:2]), ('link_1', task[2:])):
        actual = (base @ link_poses[link])[:2, 3]
        np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-12 + 1e-15 * 50.0)


@PROPERTY
@given(machines())
def test_description_inertias_equal_base_parameters(machine: Machine) -> None:
    """Compare base parameters from the URDF's masses, positions and vertical inertias."""
    root = description(machine)
    mass, centre, about_z = {}, {}, {}
    for link in root.findall('link'):
        inertial = link.find('inertial')
        if inertial is None:
            continue
        name = link.attrib['name']
        centre[name] = origin(inertial)
        for tag, table, attribute in (('mass', mass, 'value'), ('inertia', about_z, 'izz')):
            element = inertial.find(tag)
            assert element is not None
            table[name] = float(element.attrib[attribute])
    joint = places(root, dict.fromkeys(DRIVEN_JOINTS, 0.0))
    p = machine.physical
    assert centre['base_link'][0] == p['com_offset']
    assert mass.get('wheel_right', 0.0) == mass.get('wheel_left', 0.0) == p['wheel_mass']
    for side, sign in (('right', -1.0), ('left', 1.0)):
        wheel = joint[f'wheel_{side}'][:3, 3]
        assert wheel.tolist() == [0.0, sign * p['half_track'], p['wheel_radius']]
    parameters = base_parameters(
        **{
            **p,
            'com_offset': centre['base_link'][0],
            'arm_offset': joint['link_1'][0, 3] - centre['base_link'][0],
            'link_1_length': joint['link_2'][0, 3] - joint['link_1'][0, 3],
            'link_2_length': joint['end_effector'][0, 3] - joint['link_2'][0, 3],
            'platform_mass': mass['base_link'],
            'platform_inertia': about_z['base_link'],
            **{f'{link}_com': centre[link][0] for link in ('link_1', 'link_2')},
            **{f'{link}_mass': mass[link] for link in ('link_1', 'link_2')},
            **{f'{link}_inertia': about_z[link] for link in ('link_1', 'link_2')},
        }
    )
    np.testing.assert_allclose(parameters, machine.theta, rtol=1e-12)


@PROPERTY
@given(machines())
def test_description_any_robot_is_valid_urdf(machine: Machine) -> None:
    root = description(machine)
    assert root.tag == 'robot'
    assert root.get('name')
    links = [link.attrib['name'] for link in root.findall('link')]
    joints = root.findall('joint')
    assert len(set(links)) == len(links) == len(joints) + 1
    assert [j.attrib['name'] for j in joints if j.get('type') == 'continuous'] == list(
        DRIVEN_JOINTS
    )
    # A tree: every link except the root is the child of one joint and reachable.
    assert sorted([*(link_of(joint, 'child') for joint in joints), 'base_link']) == sorted(links)
    assert set(places(root, dict.fromkeys(DRIVEN_JOINTS, 0.0))) == set(links)
    materials = {material.get('name') for material in root.findall('material')}
    for visual in root.iter('visual'):
        (shape,) = visual.findall('geometry/*')
        for size in shape.attrib.values():
            assert (numbers(size) > 0.0).all(), Xml.tostring(shape)
        used = visual.find('material')
        assert used is not None
        assert used.get('name') in materials
    for inertial in root.iter('inertial'):
        element = inertial.find('inertia')
        assert element is not None
        moments = np.array([float(element.attrib[name]) for name in ('ixx', 'iyy', 'izz')])
        assert (moments >= 0.0).all()
        # No moment of inertia of a body exceeds the sum of the two others. Half of the smallest
        # subnormal number rounds to zero.
        assert (2.0 * moments <= moments.sum() * (1.0 + 1e-12) + 1e-300).all()


@PROPERTY
@given(machines())
def test_description_wheels_touch_the_ground(machine: Machine) -> None:
    root = description(machine)
    link_poses = places(root, dict.fromkeys(DRIVEN_JOINTS, 0.0))
    lowest = []
    for link in root.findall('link'):
        for visual in link.findall('visual'):
            visual_origin = visual.find('origin')
            (shape,) = visual.findall('geometry/*')
            assert visual_origin is not None
            height = link_poses[link.attrib['name']][2, 3] + numbers(visual_origin.get('xyz'))[2]
            if shape.tag == 'box':
                height -= 0.5 * numbers(shape.get('size'))[2]
            elif shape.tag == 'cylinder' and visual_origin.get('rpy', '').startswith('0.0 '):
                height -= 0.5 * numbers(shape.get('length'))[0]
            else:
                height -= numbers(shape.get('radius'))[0]
            lowest.append((height, link.attrib['name']))
    assert min(lowest)[1].startswith('wheel_')
    assert math.isclose(min(lowest)[0], 0.0, abs_tol=1e-15)


def test_description_prefix_applies_to_links_only() -> None:
    plain = robot_description({f'robot.{n}': v for n, v in DEFAULT.items()})
    root = description(Machine(DEFAULT), 'left/')
    for joint in root.findall('joint'):
        assert '/' not in joint.attrib['name']
        for end in ('parent', 'child'):
            assert link_of(joint, end).startswith('left/')
    assert all(link.attrib['name'].startswith('left/') for link in root.findall('link'))
    prefixed = Xml.tostring(root, encoding='unicode')
    assert Xml.tostring(Xml.fromstring(plain), encoding='unicode') == prefixed.replace('left/', '')


def test_description_arm_on_axle_raises() -> None:
    on_the_axle = {**DEFAULT, 'arm_offset': 0.0}
    with pytest.raises(InputError, match=r'robot\.com_offset \+ robot\.arm_offset'):
        description(Machine(on_the_axle))
