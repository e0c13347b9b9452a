# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Visual shapes and mesh files of a robot description, for displays.

A display must not fail because of a shape: a shape that cannot be read is skipped. The parser of
`urdf.py`, which checks a description first, ignores shapes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from masmc_ros.aliases import Numbers
from masmc_ros.errors import InputError
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.urdf import read_urdf

_GREY = (0.6, 0.6, 0.6)
"""Colour of a shape without one."""

_SIZES = {
    'box': ('size',),
    'sphere': ('radius',),
    'cylinder': ('radius', 'length'),
    'capsule': ('radius', 'length'),
}
"""Attributes with the sizes of each primitive."""


class Visual(NamedTuple):
    """
    Shape of a link.

    Attributes
    ----------
    link
        Name of the link.
    kind
        `box`, `sphere`, `cylinder`, `capsule` or `mesh`.
    sizes
        Edges of a box, radius of a sphere, radius and length of a cylinder or capsule along z,
        in m; factors (3) of a mesh.
    offset
        Position (3) in the frame of the link, m.
    quaternion
        Rotation in the frame of the link: w, x, y, z.
    colour
        Red, green and blue from 0 to 1.
    mesh
        File name of a mesh as in the description; empty for a primitive.

    """

    link: str
    kind: str
    sizes: Numbers
    offset: Numbers
    quaternion: Numbers
    colour: Numbers
    mesh: str = ''


def visual_shapes(description: str) -> list[Visual]:
    """
    Return the visual shapes of all links of a URDF, in the order of the description.

    Raises InputError for an invalid description.
    """
    read_urdf(description, 'the description')
    root = Xml.fromstring(description)
    materials = {
        material.get('name', ''): colour
        for material in root.iter('material')
        if (colour := _colour(material)) is not None
    }
    shapes: list[Visual] = []
    for link in root.iter('link'):
        for visual in link.iter('visual'):
            # Numbers that are missing or malformed raise ValueError.
            with suppress(ValueError):
                shapes += _shapes(link.get('name', ''), visual, materials)
    return shapes


def _shapes(link: str, visual: Xml.Element, materials: dict[str, Numbers]) -> Iterator[Visual]:
    origin = visual.find('origin')
    colour: Numbers = _GREY
    offset, quaternion = _vector(origin, 'xyz', '0 0 0'), _quaternion(origin)
    if (material := visual.find('material')) is not None:
        colour = _colour(material) or materials.get(material.get('name', ''), _GREY)
    for shape in visual.iterfind('geometry/*'):
        if shape.tag == 'mesh':
            factors = _vector(shape, 'scale', '1 1 1')
            yield Visual(
                link, 'mesh', factors, offset, quaternion, colour, shape.get('filename', '')
            )
        elif shape.tag in _SIZES:
            names = _SIZES[shape.tag]
            sizes = tuple(number for name in names for number in _numbers(shape.get(name, '')))
            count = 3 if shape.tag == 'box' else len(names)
            if len(sizes) == count and all(0.0 < size < math.inf for size in sizes):
                yield Visual(link, shape.tag, sizes, offset, quaternion, colour)


def _colour(material: Xml.Element) -> Numbers | None:
    """Return the colour that a material defines; None if it only names one, or is malformed."""
    colour = material.find('color')
    if colour is None:
        return None
    with suppress(ValueError):
        red, green, blue, *_ = _numbers(colour.get('rgba', ''))
        return tuple(min(1.0, max(0.0, part)) for part in (red, green, blue))
    return None


def _quaternion(origin: Xml.Element | None) -> Numbers:
    """Return the rotation of an origin as w, x, y, z."""
    if origin is not None and 'quat_xyzw' in origin.attrib:
        x, y, z, w = _numbers(origin.get('quat_xyzw', ''))
        length = math.sqrt(x * x + y * y + z * z + w * w)
        if not 0.0 < length < math.inf:
            raise ValueError(origin.get('quat_xyzw'))
        return w / length, x / length, y / length, z / length
    roll, pitch, yaw = (0.5 * angle for angle in _vector(origin, 'rpy', '0 0 0'))
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _vector(element: Xml.Element | None, name: str, otherwise: str) -> Numbers:
    x, y, z = _numbers(otherwise if element is None else element.get(name, otherwise))
    return x, y, z


def _numbers(text: str) -> Numbers:
    numbers = tuple(map(float, text.split()))
    if not all(map(math.isfinite, numbers)):
        raise ValueError(text)
    return numbers


_SUFFIXES = {'.dae', '.glb', '.gltf', '.obj', '.ply', '.stl'}
"""Suffixes of mesh files; a viewer gets no other files of this machine."""


def mesh_files(description: str) -> dict[str, Path]:
    """
    Return the files of those meshes that are on this machine, by their names in a description.

    Relative names are ignored, because a published description has no folder. Raises InputError
    for an invalid description.
    """
    paths = {}
    for link in read_urdf(description, 'the description').links.values():
        for name in link.meshes:
            with suppress(InputError):
                path = resource_path(name)
                if '://' in name and path.suffix.lower() in _SUFFIXES and path.is_file():
                    paths[name] = path
    return paths
