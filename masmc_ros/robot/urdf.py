# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parser of robot descriptions in URDF: links, joints, and their lines.

The parser reads only inertias, joints and file names of meshes. Errors name link or joint and
line. It rejects document types, and therefore entities. Errors also identify files of xacro.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import NoReturn, TypeVar
from xml.parsers import expat

from masmc_ros.aliases import Numbers
from masmc_ros.errors import InputError, suggestion
from masmc_ros.robot.packages import resource_path

MOST_BYTES = 10_000_000
"""Longest description in bytes that is read; the longest known has one million."""

_DECLARED = re.compile(r"""(<\?xml[^>]*?)\s+encoding\s*=\s*["']([\w.:-]+)["']""")
"""XML declaration up to its encoding, and the name of the encoding."""

KINDS = ('revolute', 'continuous', 'prismatic', 'fixed')
"""Supported types of joints; floating and planar ones have more than one axis."""


@dataclass(frozen=True)
class Pose:
    """
    Pose of a frame in another one.

    Attributes
    ----------
    offset
        x, y, z in m.
    angles
        roll, pitch, yaw in rad: rotations about the fixed axes x, y, z, in that order.

    """

    offset: Numbers = (0.0, 0.0, 0.0)
    angles: Numbers = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Link:
    """
    A link.

    Attributes
    ----------
    name
        Name of the link.
    line
        Line of its start.
    mass
        in kg; 0 for a link without inertia.
    centre
        frame at the centre of mass, in the link's.
    inertia
        xx, xy, xz, yy, yz, zz about the centre of mass, in that frame, in kg·m².
    meshes
        File names of its meshes as in the file; `packages.resource_path` finds them.

    """

    name: str
    line: int
    mass: float = 0.0
    centre: Pose = field(default_factory=Pose)
    inertia: Numbers = (0.0,) * 6
    meshes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Joint:
    """
    A joint between two links.

    Attributes
    ----------
    name, line
        Name of the joint, and line of its start.
    kind
        one of KINDS.
    parent, child
        names of its links.
    origin
        of the joint, and of the child at zero, in the parent's frame.
    axis
        unit vector in the child's frame.
    lower, upper
        Range in rad or m; infinite without a limit.
    speed, effort
        Maxima in rad/s or m/s, and N·m or N; infinite without a limit.
    damping, friction
        viscous friction in N·m·s or N·s/m, and Coulomb's in N·m or N.
    mimics
        Name of the mimicked joint; empty without one.

    """

    name: str
    line: int
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: Numbers
    lower: float = -math.inf
    upper: float = math.inf
    speed: float = math.inf
    effort: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    mimics: str = ''


@dataclass(frozen=True)
class Description:
    """
    Robot description of a URDF.

    Attributes
    ----------
    name
        of the robot.
    links, joints
        by name, in the order of the file.
    root
        name of the link that has no parent.

    """

    name: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    root: str


@dataclass
class _Element:
    tag: str
    line: int
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)

    def child(self, tag: str) -> _Element | None:
        return next((element for element in self.children if element.tag == tag), None)


def read_urdf(text: str | bytes, where: str) -> Description:
    """
    Return the description in a URDF.

    Parameters
    ----------
    text
        URDF.
    where
        Source for messages: a path, or the name of a topic.

    Raises
    ------
    InputError
        If the text is invalid, or the robot is not supported.

    """
    root = _parsed(text, where)
    if root.tag != 'robot':
        raise InputError(f'{where}, line {root.line}: <{root.tag}>, expected <robot>')
    reader = _Reader(where)
    links: dict[str, Link] = {}
    joints: dict[str, Joint] = {}
    for element in root.children:
        if element.tag == 'link':
            _keep(links, reader.link(element), where)
        elif element.tag == 'joint':
            _keep(joints, reader.joint(element), where)
    if not links:
        raise InputError(f'{where}: no link, expected at least one')
    return Description(
        root.attributes.get('name', ''), links, joints, _root(links, joints, where)
    )


def read_urdf_file(uri: str | Path) -> Description:
    """
    Read a description from a file.

    Parameters
    ----------
    uri
        Path, or URI such as `package://NAME/path`, see `packages.resource_path`.

    Raises
    ------
    InputError
        If there is no such file, or `read_urdf` raises it.

    """
    path = resource_path(str(uri))
    try:
        with path.open('rb') as file:
            text = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}') from error
    return read_urdf(text, str(path))


def urdf_text(path: Path) -> str:
    """
    Return the text of a file that `read_urdf_file` accepts.

    The text is published as UTF-8. If the file is in another encoding, the text declares none.

    Raises
    ------
    InputError
        If the content does not have the declared encoding.

    """
    content = path.read_bytes().removeprefix(codecs.BOM_UTF8)
    declared = _DECLARED.match(content[:200].decode('latin-1'))
    encoding = declared[2] if declared else 'utf-8'
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = 'utf-16'
    elif b'\0' in content[:2]:
        encoding = 'utf-16-be' if content[0] == 0 else 'utf-16-le'
    try:
        text = content.decode(encoding)
        if text.encode() != content:
            text = _DECLARED.sub(r'\1', text, count=1)
    except (UnicodeError, LookupError) as error:
        raise InputError(f'{path}: no XML: {error}') from error
    return text.replace('\r\n', '\n').replace('\r', '\n')


def _parsed(text: str | bytes, where: str) -> _Element:
    if len(text) > MOST_BYTES:
        raise InputError(f'{where}: more than {MOST_BYTES} bytes, which no robot needs')
    parser = expat.ParserCreate()
    open_elements: list[_Element] = [_Element('', 0, {})]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag.startswith('xacro:'):
            raise InputError(
                f'{where}, line {parser.CurrentLineNumber}: <{tag}> is xacro, which makes URDF;'
                f' give what `xacro {where}` prints'
            )
        element = _Element(tag, parser.CurrentLineNumber, attributes)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        open_elements.pop()

    def document_type(*_: object) -> None:
        raise InputError(
            f'{where}, line {parser.CurrentLineNumber}: a document type, which no URDF has'
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise InputError(
            f'{where}, line {error.lineno}: no XML: {expat.errors.messages[error.code]}'
        ) from error
    except (LookupError, ValueError) as error:
        raise InputError(f'{where}: no XML: {error}') from error
    return open_elements[0].children[0]


_Named = TypeVar('_Named', Link, Joint)


def _keep(among: dict[str, _Named], named: _Named, where: str) -> None:
    if named.name in among:
        raise InputError(
            f"{where}, line {named.line}: '{named.name}' again, after line"
            f' {among[named.name].line}; names are to differ'
        )
    among[named.name] = named


class _Reader:
    """Reader of elements; errors name the line."""

    def __init__(self, where: str) -> None:
        self._where = where

    def link(self, element: _Element) -> Link:
        name = self._name(element)
        inertial = element.child('inertial')
        meshes = tuple(
            self._attribute(mesh, 'filename', f"link '{name}'")
            for shape in element.children
            for geometry in shape.children
            for mesh in geometry.children
            if mesh.tag == 'mesh'
        )
        if inertial is None:
            return Link(name, element.line, meshes=meshes)
        about = f"link '{name}'"
        mass = self._child(inertial, 'mass', about)
        matrix = self._child(inertial, 'inertia', about)
        return Link(
            name,
            element.line,
            self._number(mass, 'value', about, lambda x: x >= 0.0, 'a number >= 0'),
            self._pose(inertial.child('origin'), about),
            tuple(
                self._number(matrix, key, about)
                for key in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
            ),
            meshes,
        )

    def joint(self, element: _Element) -> Joint:
        name = self._name(element)
        about = f"joint '{name}'"
        kind = element.attributes.get('type', '')
        if kind not in KINDS:
            self._reject(element, about, f"type '{kind}'; {suggestion(kind, KINDS)}")
        limits = {
            key: self._attribute(self._child(element, key, about), 'link', about)
            for key in ('parent', 'child')
        }
        axis: Numbers = (1.0, 0.0, 0.0)
        if kind != 'fixed' and (axis_element := element.child('axis')) is not None:
            axis = self._vector(axis_element, 'xyz', about)
            # Not by `sum`, which Python 3.12 rounds in another way.
            length = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
            if not 1.0e-6 < length < math.inf:
                self._reject(axis_element, about, f'axis {axis}, expected a vector of length 1')
            # An axis of length 1 is unmodified, including rounded decimals.
            axis = axis if abs(length - 1.0) < 1.0e-12 else tuple(e / length for e in axis)
        bounds: dict[str, float] = {}
        if kind != 'fixed' and (limit := element.child('limit')) is not None:
            bounds = self._limits(limit, kind, about)
        elif kind in ('revolute', 'prismatic'):
            self._reject(element, about, f'no <limit>, which a {kind} joint needs')
        if kind != 'fixed' and (dynamics := element.child('dynamics')) is not None:
            for key in ('damping', 'friction'):
                if key in dynamics.attributes:
                    bounds[key] = self._number(
                        dynamics, key, about, lambda x: x >= 0.0, 'a number >= 0'
                    )
        mimic = element.child('mimic')
        return Joint(
            name,
            element.line,
            kind,
            limits['parent'],
            limits['child'],
            self._pose(element.child('origin'), about),
            axis,
            mimics='' if mimic is None else self._attribute(mimic, 'joint', about),
            **bounds,
        )

    def _limits(self, limit: _Element, kind: str, about: str) -> dict[str, float]:
        bounds = {}
        for key, own in (('velocity', 'speed'), ('effort', 'effort')):
            if key in limit.attributes:
                bounds[own] = self._number(limit, key, about, lambda x: x >= 0.0, 'a number >= 0')
        if kind != 'continuous':
            # The default of URDF is 0.
            for key in ('lower', 'upper'):
                bounds[key] = self._number(limit, key, about) if key in limit.attributes else 0.0
            if bounds['lower'] > bounds['upper']:
                self._reject(
                    limit, about, f'lower {bounds["lower"]} above upper {bounds["upper"]}'
                )
        return bounds

    def _name(self, element: _Element) -> str:
        return self._attribute(element, 'name', f'<{element.tag}>')

    def _attribute(self, element: _Element, key: str, about: str) -> str:
        value = element.attributes.get(key, '').strip()
        if not value:
            self._reject(element, about, f'<{element.tag}> without {key}')
        return value

    def _child(self, element: _Element, tag: str, about: str) -> _Element:
        child = element.child(tag)
        if child is None:
            self._reject(element, about, f'no <{tag}>')
        return child

    def _number(
        self,
        element: _Element,
        key: str,
        about: str,
        is_right: Callable[[float], bool] = math.isfinite,
        expected: str = 'a finite number',
    ) -> float:
        text = self._attribute(element, key, about)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and is_right(value)):
            self._reject(element, about, f"{key} '{text[:40]}', expected {expected}")
        return value

    def _vector(self, element: _Element, key: str, about: str) -> Numbers:
        text = element.attributes.get(key, '0 0 0')
        try:
            values = tuple(float(part) for part in text.split())
        except ValueError:
            values = ()
        if len(values) != 3 or not all(map(math.isfinite, values)):
            self._reject(element, about, f"{key} '{text[:40]}', expected 3 finite numbers")
        return values

    def _pose(self, origin: _Element | None, about: str) -> Pose:
        if origin is None:
            return Pose()
        return Pose(self._vector(origin, 'xyz', about), self._vector(origin, 'rpy', about))

    def _reject(self, element: _Element, about: str, what: str) -> NoReturn:
        raise InputError(f'{self._where}, line {element.line}: {about}: {what}')


def _root(links: Mapping[str, Link], joints: Mapping[str, Joint], where: str) -> str:
    """Return the name of the root link, the ancestor of all others."""
    above: dict[str, Joint] = {}
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                raise InputError(
                    f"{where}, line {joint.line}: joint '{joint.name}': no link '{end}';"
                    f' {suggestion(end, tuple(links))}'
                )
        if joint.child in above:
            raise InputError(
                f"{where}, line {joint.line}: joint '{joint.name}': link '{joint.child}' hangs on"
                f" joint '{above[joint.child].name}' already (line {above[joint.child].line})"
            )
        above[joint.child] = joint
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        second = links[roots[1]]
        raise InputError(
            f"{where}, line {second.line}: link '{second.name}' hangs on nothing, as does"
            f" '{roots[0]}'; a robot has one root"
        )
    reached = set(roots)
    for name in links:
        way: set[str] = set()
        while name not in reached and name not in way:
            way.add(name)
            name = above[name].parent
        if name in way:
            joint = above[name]
            raise InputError(
                f"{where}, line {joint.line}: joint '{joint.name}' closes a loop of links;"
                ' a robot is a tree'
            )
        reached.update(way)
    return roots[0]
