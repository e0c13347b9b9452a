# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parser of robot descriptions in URDF: links, joints, and their lines.

The parser reads only inertias, joints and file names of meshes. Errors name link or joint and
line. Inside joints and inertias it rejects what it does not know, because a misspelt attribute
would have the value of its default. It rejects document types, and therefore entities. Errors
also identify files of xacro.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
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


VERSIONS = ('1.0', '1.1', '1.2')
"""Versions of URDF; one without quaternions is the first."""

_POSE = {'xyz': True, 'rpy': True, 'quat_xyzw': True}
_SHAPES = {
    '': {'name': False},
    '/origin': dict.fromkeys(_POSE, False),
    '/geometry/box': {'size': False},
    '/geometry/sphere': {'radius': False},
    '/geometry/cylinder': {'radius': False, 'length': False},
    '/geometry/capsule': {'radius': False, 'length': False},
    '/geometry/mesh': {'filename': True, 'scale': False},
}

ATTRIBUTES: Mapping[str, Mapping[str, bool]] = {
    'robot': {'name': True, 'version': True},
    'link': {'name': True, 'type': False},
    'link/inertial': {},
    'link/inertial/origin': _POSE,
    'link/inertial/mass': {'value': True},
    'link/inertial/inertia': dict.fromkeys(('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'), True),
    **{
        f'link/{tag}{path}': attributes
        for tag in ('visual', 'collision')
        for path, attributes in _SHAPES.items()
    },
    'link/visual/material': {'name': False},
    'link/visual/material/color': {'rgba': False},
    'link/visual/material/texture': {'filename': False},
    'joint': {'name': True, 'type': True},
    'joint/origin': _POSE,
    'joint/parent': {'link': True},
    'joint/child': {'link': True},
    # A rotation is part of the file of Husky: zero.
    'joint/axis': {'xyz': True, 'rpy': True},
    'joint/limit': {
        **dict.fromkeys(('lower', 'upper', 'velocity', 'effort'), True),
        **dict.fromkeys(('acceleration', 'deceleration', 'jerk'), False),
        # Of the drives of ANYmal.
        **dict.fromkeys(('command_effort', 'current', 'gear_velocity'), False),
    },
    'joint/dynamics': {
        'damping': True,
        'friction': True,
        # Of Gazebo, and of old descriptions of the Panda.
        'spring_reference': False,
        'spring_stiffness': True,
        **dict.fromkeys(('D', 'K', 'mu_coulomb', 'mu_viscous'), False),
    },
    'joint/mimic': {'joint': True, 'multiplier': True, 'offset': True},
    'joint/safety_controller': dict.fromkeys(
        ('soft_lower_limit', 'soft_upper_limit', 'k_position', 'k_velocity'), False
    ),
    'joint/calibration': dict.fromkeys(('rising', 'falling', 'reference_position'), False),
}
"""
Attributes by element: True if it has an effect, False if it is ignored.

Inside joints and inertias an attribute or element that is missing here is rejected; elsewhere it
belongs to other tools.
"""

FOREIGN = (
    'actuator', 'gazebo', 'hardwareInterface', 'physics', 'plugin', 'ros2_control', 'sensor',
    'transmission',
)  # fmt: skip
"""Elements of other tools inside a joint; those with a colon in the name also are."""

_NUMBER = re.compile(r'[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?')
"""Number as readers of URDF accept it: not hexadecimal, no underscores, point for decimals."""

_SPACE = ' \t\r\n'

_NEAR = 0.85
"""Least similarity of a misspelt element, from 0 to 1."""


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
    quaternion
        x, y, z, w of length 1, which replace the angles; empty without them.

    """

    offset: Numbers = (0.0, 0.0, 0.0)
    angles: Numbers = (0.0, 0.0, 0.0)
    quaternion: Numbers = ()


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
    radius
        Radius in m of its first cylinder or sphere, that of a wheel; 0 without one.

    """

    name: str
    line: int
    mass: float = 0.0
    centre: Pose = field(default_factory=Pose)
    inertia: Numbers = (0.0,) * 6
    meshes: tuple[str, ...] = ()
    radius: float = 0.0


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
    multiplier, mimic_offset
        Position as a multiple of that of the mimicked joint, and its addend in rad or m.

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
    multiplier: float = 1.0
    mimic_offset: float = 0.0


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
    text: list[str] = field(default_factory=list)

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
    reader = _Reader(where, _version(root, where))
    links: dict[str, Link] = {}
    joints: dict[str, Joint] = {}
    for element in root.children:
        if element.tag == 'link':
            _keep(links, reader.link(element), where)
        elif element.tag == 'joint':
            _keep(joints, reader.joint(element), where)
        else:
            reader.check_misspelt(element, ('link', 'joint'), 'the robot')
    if not links:
        raise InputError(f'{where}: no link, expected at least one')
    description = Description(
        root.attributes.get('name', ''), links, joints, _root(links, joints, where)
    )
    _check_mimics(joints, where)
    return description


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

    def text_inside(data: str) -> None:
        if not data.isspace():
            open_elements[-1].text.append(data)

    def document_type(*_: object) -> None:
        raise InputError(
            f'{where}, line {parser.CurrentLineNumber}: a document type, which no URDF has'
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = document_type
    parser.CharacterDataHandler = text_inside
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


def _version(robot: _Element, where: str) -> tuple[int, ...]:
    version = robot.attributes.get('version', VERSIONS[0])
    if version not in VERSIONS:
        raise InputError(
            f"{where}, line {robot.line}: <robot> version '{version}', expected"
            f' {", ".join(VERSIONS[:-1])} or {VERSIONS[-1]}'
        )
    return tuple(map(int, version.split('.')))


class _Reader:
    """Reader of elements; errors name the line."""

    def __init__(self, where: str, version: tuple[int, ...]) -> None:
        self._where = where
        self._version = version

    def link(self, element: _Element) -> Link:
        name = self._name(element)
        about = f"link '{name}'"
        for part in element.children:
            if part.tag in ('mass', 'inertia'):
                self._reject(part, about, f'<{part.tag}> outside of <inertial>, expected inside')
            self.check_misspelt(part, ('inertial', 'visual', 'collision'), about)
        meshes = tuple(
            self._attribute(mesh, 'filename', about)
            for shape in element.children
            for geometry in shape.children
            for mesh in geometry.children
            if mesh.tag == 'mesh'
        )
        self._check_single(element, about, ('inertial',))
        inertial, radius = element.child('inertial'), _radius(element)
        if inertial is None:
            return Link(name, element.line, meshes=meshes, radius=radius)
        self._check_parts(inertial, 'link/inertial', about)
        self._check_single(inertial, about)
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
            radius,
        )

    def joint(self, element: _Element) -> Joint:
        name = self._name(element)
        about = f"joint '{name}'"
        kind = element.attributes.get('type', '')
        if kind not in KINDS:
            remedy = (
                '; if it connects the robot to the world, remove it and its parent link:'
                ' robot.base is the type of base'
                if kind in ('floating', 'planar')
                else ''
            )
            self._reject(element, about, f"type '{kind}'; {suggestion(kind, KINDS)}{remedy}")
        self._check_joint(element, about)
        ends = {
            key: self._joined(self._child(element, key, about), 'link', about)
            for key in ('parent', 'child')
        }
        axis: Numbers = (1.0, 0.0, 0.0)
        if kind != 'fixed' and (axis_element := element.child('axis')) is not None:
            self._attribute(axis_element, 'xyz', about)
            axis = self._vector(axis_element, 'xyz', about)
            if any(self._vector(axis_element, 'rpy', about)):
                turned = axis_element.attributes['rpy']
                self._reject(
                    axis_element, about, f'rpy {turned} of the axis, expected no rotation'
                )
            # Not by `sum`, which Python 3.12 rounds in another way.
            length = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
            if not 1.0e-6 < length < math.inf:
                self._reject(axis_element, about, f'axis {axis}, expected a vector of length 1')
            # An axis of length 1 is unmodified, including rounded decimals.
            axis = axis if abs(length - 1.0) < 1.0e-12 else tuple(e / length for e in axis)
        bounds: dict[str, float] = {}
        limit, dynamics = element.child('limit'), element.child('dynamics')
        if kind == 'fixed':
            # Without effect, but others reject the whole file if these are no numbers.
            for part in filter(None, (limit, dynamics)):
                for key, has_effect in ATTRIBUTES[f'joint/{part.tag}'].items():
                    if has_effect and key in part.attributes:
                        self._number(part, key, about)
        elif limit is not None:
            bounds = self._limits(limit, kind, about)
        elif kind in ('revolute', 'prismatic'):
            self._reject(element, about, f'no <limit>, which a {kind} joint needs')
        if kind != 'fixed' and dynamics is not None:
            for key in ('damping', 'friction'):
                if key in dynamics.attributes:
                    bounds[key] = self._number(
                        dynamics, key, about, lambda x: x >= 0.0, 'a number >= 0'
                    )
            if 'spring_stiffness' in dynamics.attributes:
                self._number(
                    dynamics, 'spring_stiffness', about, lambda x: x == 0.0,
                    '0: springs are not supported',
                )  # fmt: skip
        mimics = ''
        if (mimic := element.child('mimic')) is not None:
            mimics = self._joined(mimic, 'joint', about)
            for key, own in (('multiplier', 'multiplier'), ('offset', 'mimic_offset')):
                if key in mimic.attributes:
                    bounds[own] = self._number(mimic, key, about)
        return Joint(
            name,
            element.line,
            kind,
            ends['parent'],
            ends['child'],
            self._pose(element.child('origin'), about),
            axis,
            mimics=mimics,
            **bounds,
        )

    def _check_joint(self, element: _Element, about: str) -> None:
        """Raise InputError for unknown parts of a joint."""
        parts = {path.partition('/')[2] for path in ATTRIBUTES if path.startswith('joint/')}
        for part in element.children:
            if part.tag in FOREIGN or ':' in part.tag:
                continue
            if part.tag not in parts:
                self._reject(
                    part,
                    about,
                    f'<{part.tag}> is unknown; {suggestion(part.tag, sorted(parts))}; elements'
                    ' of other tools belong outside of joints',
                )
            self._check_parts(part, f'joint/{part.tag}', about)
        self._check_single(element, about, parts)

    def check_misspelt(self, element: _Element, known: tuple[str, ...], about: str) -> None:
        """Raise InputError for an element whose name is nearly a known one."""
        near = get_close_matches(element.tag.lower(), known, n=1, cutoff=_NEAR)
        if element.tag not in known and near:
            self._reject(element, about, f'<{element.tag}> is unknown; did you mean {near[0]}?')

    def _check_parts(self, element: _Element, path: str, about: str) -> None:
        """Raise InputError for unknown attributes, elements and text of an element."""
        attributes = ATTRIBUTES[path]
        for key in element.attributes:
            if key not in attributes:
                hint = suggestion(key, attributes)
                self._reject(element, about, f'<{element.tag}> has unknown {key}; {hint}')
        if element.text:
            text = ' '.join(element.text)[:40]
            self._reject(element, about, f"<{element.tag}> has text '{text}', expected attributes")
        inside = [key.rpartition('/')[2] for key in ATTRIBUTES if key.startswith(f'{path}/')]
        for part in element.children:
            if part.tag not in inside:
                hint = suggestion(part.tag, inside) if inside else 'expected attributes only'
                self._reject(part, about, f'<{part.tag}> in <{element.tag}> is unknown; {hint}')
            self._check_parts(part, f'{path}/{part.tag}', about)

    def _check_single(
        self, element: _Element, about: str, tags: Iterable[str] | None = None
    ) -> None:
        """Raise InputError for repeated elements: readers would use the first one."""
        lines: dict[str, int] = {}
        for part in element.children:
            if tags is None or part.tag in tags:
                if part.tag in lines:
                    self._reject(
                        part, about, f'<{part.tag}> again, after line {lines[part.tag]}'
                    )
                lines[part.tag] = part.line

    def _limits(self, limit: _Element, kind: str, about: str) -> dict[str, float]:
        bounds = {}
        for key, own in (('velocity', 'speed'), ('effort', 'effort')):
            if key in limit.attributes:
                bounds[own] = self._number(
                    limit, key, about, lambda x: x >= 0.0,
                    'a number >= 0; 0 or no attribute: no limit',
                )  # fmt: skip
        if kind == 'continuous':
            # Without effect, but others reject the whole file if these are no numbers.
            for key in ('lower', 'upper'):
                if key in limit.attributes:
                    self._number(limit, key, about)
        else:
            endless = '; a joint without range is continuous' if kind == 'revolute' else ''
            for key in ('lower', 'upper'):
                if key not in limit.attributes and self._version >= (1, 2):
                    self._reject(limit, about, f'<limit> without {key}, which version 1.2 needs')
                # The default of URDF is 0.
                bounds[key] = (
                    self._number(limit, key, about, expected=f'a finite number{endless}')
                    if key in limit.attributes
                    else 0.0
                )
            if bounds['lower'] > bounds['upper']:
                self._reject(
                    limit, about, f'lower {bounds["lower"]} above upper {bounds["upper"]}'
                )
        return bounds

    def _name(self, element: _Element) -> str:
        return self._joined(element, 'name', f'<{element.tag}>')

    def _joined(self, element: _Element, key: str, about: str) -> str:
        """Return a name, which other readers do not trim."""
        value = self._attribute(element, key, about)
        if value != element.attributes[key]:
            given = element.attributes[key]
            self._reject(element, about, f"{key} '{given}', expected no space around the name")
        return value

    def _attribute(self, element: _Element, key: str, about: str) -> str:
        value = element.attributes.get(key, '').strip(_SPACE)
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
        value = _number(text)
        if not (math.isfinite(value) and is_right(value)):
            self._reject(element, about, f"{key} '{text[:40]}', expected {expected}")
        return value

    def _vector(
        self, element: _Element, key: str, about: str, otherwise: str = '0 0 0'
    ) -> Numbers:
        text, size = element.attributes.get(key, otherwise), len(otherwise.split())
        values = tuple(_number(part) for part in text.strip(_SPACE).split(' ') if part)
        if len(values) != size or not all(map(math.isfinite, values)):
            self._reject(element, about, f"{key} '{text[:40]}', expected {size} finite numbers")
        return values

    def _pose(self, origin: _Element | None, about: str) -> Pose:
        if origin is None:
            return Pose()
        offset = self._vector(origin, 'xyz', about)
        if 'quat_xyzw' not in origin.attributes:
            return Pose(offset, self._vector(origin, 'rpy', about))
        if 'rpy' in origin.attributes:
            self._reject(origin, about, 'rpy and quat_xyzw, expected one of them')
        if self._version < (1, 1):
            self._reject(
                origin, about, 'quat_xyzw, which readers of URDF 1.0 ignore; expected rpy, or'
                ' <robot version="1.1">',
            )  # fmt: skip
        x, y, z, w = self._vector(origin, 'quat_xyzw', about, '0 0 0 1')
        length = math.sqrt(x * x + y * y + z * z + w * w)
        if not 1.0e-6 < length < math.inf:
            self._reject(
                origin, about, f'quat_xyzw {(x, y, z, w)}, expected a quaternion of length 1'
            )
        return Pose(offset, quaternion=(x / length, y / length, z / length, w / length))

    def _reject(self, element: _Element, about: str, what: str) -> NoReturn:
        raise InputError(f'{self._where}, line {element.line}: {about}: {what}')


def _radius(link: _Element) -> float:
    """Return the radius of the first cylinder or sphere of a link in m, 0 without one."""
    radii = (
        _number(solid.attributes.get('radius', '').strip(_SPACE))
        for tag in ('collision', 'visual')
        for shape in link.children
        for geometry in shape.children
        for solid in geometry.children
        if shape.tag == tag and solid.tag in ('cylinder', 'sphere')
    )
    return next((radius for radius in radii if 0.0 < radius < math.inf), 0.0)


def _number(text: str) -> float:
    """Return the number of a text; NaN if readers of URDF do not accept it."""
    return float(text) if _NUMBER.fullmatch(text) else math.nan


def _check_mimics(joints: Mapping[str, Joint], where: str) -> None:
    """Raise InputError for joints that mimic an unknown joint or, in the end, themselves."""
    for joint in joints.values():
        about = f"{where}, line {joint.line}: joint '{joint.name}'"
        source, sources = joint, {joint.name}
        while source.mimics:
            if source.mimics not in joints:
                raise InputError(
                    f"{where}, line {source.line}: joint '{source.name}' mimics"
                    f" '{source.mimics}', which is no joint;"
                    f' {suggestion(source.mimics, tuple(joints))}'
                )
            if source.mimics in sources:
                raise InputError(
                    f"{about} mimics '{joint.mimics}', which mimics it; expected a joint that"
                    ' moves independently'
                )
            source = joints[source.mimics]
            sources.add(source.name)


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
