# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
URDF of the robot: shapes, masses and joints; and the robot seen from above, to scale.

Frames and joints are those of `frames` and of joint_states. Masses, centres of mass and
inertias about the vertical are the parameters'. Values that a planar
model does not have are physically plausible: heights, shapes, and inertias about other axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from masmc_ros.aliases import Array
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Outline, Shape
from masmc_ros.robot.two_link.constants import constants
from masmc_ros.robot.two_link.frames import frame_origins, link_thickness, PLATFORM_TOP
from masmc_ros.robot.two_link.geometry import Geometry
from masmc_ros.robot.two_link.paper_robot import FIXED_JOINT, FRAMES, ROBOT
import numpy as np

_COLOURS = {
    'platform': '0.16 0.20 0.27 1.0',
    'wheel': '0.08 0.08 0.09 1.0',
    'link': '0.93 0.49 0.13 1.0',
    'joint': '0.55 0.58 0.62 1.0',
    'tip': '0.85 0.16 0.16 1.0',
}

_AXES = {'wheel_right': '0 1 0', 'wheel_left': '0 1 0', 'link_1': '0 0 1', 'link_2': '0 0 1'}

Vector = tuple[float, float, float]


class _Inertia(NamedTuple):
    """Mass in kg, centre of mass in m, inertias about it in kg·m²."""

    mass: float
    centre: Vector
    moments: Vector


class _Shape(NamedTuple):
    """Primitive: name of the URDF element, its sizes in m, its position, its colour."""

    kind: str
    sizes: Mapping[str, str]
    centre: Vector
    colour: str
    roll: float = 0.0


def description(values: Values, driven: Sequence[str], frame_prefix: str) -> str:
    """
    Return the URDF of a robot.

    Parameters
    ----------
    values
        Checked values of ROBOT by name; others are ignored.
    driven
        Names of the driven joints, in the order of v.
    frame_prefix
        Prefix of the name of every link, so links and frames have equal names.

    Raises
    ------
    InputError
        If `constants` raises it.

    """
    p = {parameter.name.removeprefix('robot.'): values[parameter.name] for parameter in ROBOT}
    geometry, _ = constants(p)
    root = Xml.Element('robot', name='mobile_manipulator')
    for name, colour in _COLOURS.items():
        material = Xml.SubElement(root, 'material', name=name)
        Xml.SubElement(material, 'color', rgba=colour)
    shapes, inertias = _shapes(geometry, p['com_offset']), _inertias(p, geometry)
    for _, link in FRAMES:
        _add_link(root, frame_prefix + link, inertias.get(link), shapes[link])
    joints = (*driven, FIXED_JOINT)
    origins = frame_origins(geometry)[1:].tolist()
    for name, (parent, child), origin in zip(joints, FRAMES[1:], origins, strict=True):
        axis = _AXES.get(child)
        joint = Xml.SubElement(root, 'joint', name=name, type='continuous' if axis else 'fixed')
        Xml.SubElement(joint, 'parent', link=frame_prefix + parent)
        Xml.SubElement(joint, 'child', link=frame_prefix + child)
        Xml.SubElement(joint, 'origin', xyz=_text(*origin))
        if axis:
            Xml.SubElement(joint, 'axis', xyz=axis)
    Xml.indent(root)
    # Without an encoding: some parsers reject one in a decoded text.
    return f'<?xml version="1.0"?>\n{Xml.tostring(root, encoding="unicode")}\n'


def _inertias(p: Mapping[str, float], geometry: Geometry) -> dict[str, _Inertia]:
    """Return the inertia of every link that has one."""
    radius, thickness = geometry.wheel_radius, link_thickness(geometry)
    # No body has less inertia about a diameter than a flat one: half of that about its axle.
    wheel_yaw = max(p['wheel_yaw_inertia'], 0.5 * p['wheel_spin_inertia'])
    wheel = _Inertia(
        p['wheel_mass'], (0.0, 0.0, 0.0), (wheel_yaw, p['wheel_spin_inertia'], wheel_yaw)
    )
    platform = p['platform_inertia']
    inertias = {
        'base_link': _Inertia(
            p['platform_mass'],
            (p['com_offset'], 0.0, 0.5 * PLATFORM_TOP * radius),
            (0.5 * platform, 0.5 * platform, platform),
        ),
        'wheel_right': wheel,
        'wheel_left': wheel,
    }
    for link in ('link_1', 'link_2'):
        mass, inertia = p[f'{link}_mass'], p[f'{link}_inertia']
        along = min(mass * thickness * thickness / 6.0, inertia)
        centre = (p[f'{link}_com'], 0.0, 0.0)
        inertias[link] = _Inertia(mass, centre, (along, inertia, inertia))
    return {link: inertia for link, inertia in inertias.items() if inertia.mass > 0.0}


def _shapes(geometry: Geometry, com_offset: float) -> dict[str, list[_Shape]]:
    """Return the shapes of every link."""
    radius, thickness = geometry.wheel_radius, link_thickness(geometry)
    wheel_width = min(0.6 * radius, 0.5 * geometry.half_track)
    # The platform carries axle, centre of mass and arm, with a margin in front and behind.
    front = max(0.0, com_offset, geometry.arm_base) + 2.0 * radius
    rear = min(0.0, com_offset, geometry.arm_base) - 2.0 * radius
    bottom, top = 0.5 * radius, PLATFORM_TOP * radius
    platform = _Shape(
        'box',
        {'size': _text(front - rear, 2.0 * (geometry.half_track - wheel_width), top - bottom)},
        (0.5 * (front + rear), 0.0, 0.5 * (bottom + top)),
        'platform',
    )
    quarter_turn = 1.5707963267948966
    wheel = _Shape(
        'cylinder',
        {'radius': _text(radius), 'length': _text(wheel_width)},
        (0.0, 0.0, 0.0),
        'wheel',
        roll=quarter_turn,
    )
    tip = _Shape('sphere', {'radius': _text(0.7 * thickness)}, (0.0, 0.0, 0.0), 'tip')
    return {
        'base_link': [platform],
        'wheel_right': [wheel],
        'wheel_left': [wheel],
        'link_1': _link(geometry.link_1, thickness),
        'link_2': _link(geometry.link_2, thickness),
        'end_effector': [tip],
    }


def _link(length: float, thickness: float) -> list[_Shape]:
    """Return the shapes of an arm link along x, its bar and its first joint; lengths in m."""
    return [
        _Shape(
            'box',
            {'size': _text(length, 1.4 * thickness, thickness)},
            (0.5 * length, 0.0, 0.0),
            'link',
        ),
        _Shape(
            'cylinder',
            {'radius': _text(thickness), 'length': _text(1.02 * thickness)},
            (0.0, 0.0, 0.0),
            'joint',
        ),
    ]


def _add_link(
    root: Xml.Element, name: str, inertia: _Inertia | None, shapes: list[_Shape]
) -> None:
    link = Xml.SubElement(root, 'link', name=name)
    if inertia is not None:
        inertial = Xml.SubElement(link, 'inertial')
        Xml.SubElement(inertial, 'origin', xyz=_text(*inertia.centre))
        Xml.SubElement(inertial, 'mass', value=_text(inertia.mass))
        ixx, iyy, izz = map(_text, inertia.moments)
        Xml.SubElement(
            inertial, 'inertia', ixx=ixx, iyy=iyy, izz=izz, ixy='0', ixz='0', iyz='0'
        )
    for shape in shapes:
        visual = Xml.SubElement(link, 'visual')
        Xml.SubElement(
            visual, 'origin', xyz=_text(*shape.centre), rpy=_text(shape.roll, 0.0, 0.0)
        )
        geometry = Xml.SubElement(visual, 'geometry')
        Xml.SubElement(geometry, shape.kind, dict(shape.sizes))
        Xml.SubElement(visual, 'material', name=shape.colour)


def _text(*numbers: float) -> str:
    return ' '.join(repr(float(number)) for number in numbers)


_WHEEL_WIDTH = 0.35
"""Width relative to a wheel's radius; no parameter has it."""


def outline(lengths: Array, position: Array) -> Outline:
    """Return the drawing of lengths (5) at one position (7) in the order of joint_states."""
    geometry = Geometry(*lengths)
    x, y, yaw = (float(value) for value in position[:3])
    b, r = geometry.half_track, geometry.wheel_radius
    half = max(abs(geometry.arm_base), r)
    wheel = r, _WHEEL_WIDTH * r
    shapes = (
        Shape('body', _place(_rectangle(0.0, half, b), x, y, yaw)),
        Shape('part', _place(_rectangle(b, *wheel), x, y, yaw)),
        Shape('part', _place(_rectangle(-b, *wheel), x, y, yaw)),
        Shape('links', arm_points(geometry, position)),
    )
    return Outline((x, y), shapes, below=b + 2.0 * r, text=2.0 * r)


def arm_points(geometry: Geometry, position: Array) -> Array:
    """Return (3, 2) world positions in m of the arm's base, its elbow and its end."""
    x, y, yaw, _, _, arm_1, arm_2 = (float(value) for value in position)
    lengths = (geometry.arm_base, geometry.link_1, geometry.link_2)
    headings = (yaw, yaw + arm_1, yaw + arm_1 + arm_2)
    steps = [
        (length * math.cos(heading), length * math.sin(heading))
        for length, heading in zip(lengths, headings, strict=True)
    ]
    points: Array = np.array([x, y]) + np.cumsum(steps, axis=0)
    return points


def _rectangle(left: float, half_length: float, half_width: float) -> Array:
    """Return the corners (4, 2) of a rectangle, `left` of the axle's middle by so many m."""
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
    corners: Array = np.array([0.0, left]) + signs * (half_length, half_width)
    return corners


def _place(points: Array, x: float, y: float, yaw: float) -> Array:
    """Move points (n, 2) from the platform's frame into the world."""
    c, s = math.cos(yaw), math.sin(yaw)
    placed: Array = points @ np.array([[c, s], [-s, c]]) + (x, y)
    return placed
