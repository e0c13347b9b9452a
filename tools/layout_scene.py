# SPDX-License-Identifier: Apache-2.0
"""The 3D panel of a Foxglove layout: robot, frames and paths as its camera sees them."""

from __future__ import annotations

from collections.abc import Mapping
import itertools
from typing import Any
from xml.etree import ElementTree as Xml

from layout_log import LayoutLog
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
import numpy as np
from numpy.typing import NDArray

from masmc_ros.errors import InputError

Floats = NDArray[np.float64]

_LIGHT = np.array([-0.35, -0.5, 0.79])
_SIDES = 24
"""Of a cylinder, and of a sphere's equator."""

_LEVEL = 0.05
"""Height in m between parts of the robot that lie on one another."""


class Camera:
    """Foxglove's perspective camera on a panel of `height` pixels."""

    def __init__(self, state: Mapping[str, Any], height: float) -> None:
        """Place it: `phi` from the vertical, `thetaOffset` about it, degrees and m."""
        phi, theta = np.radians(state['phi']), np.radians(state['thetaOffset'])
        back = np.array(
            [-np.sin(phi) * np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi)]
        )
        self._eye = np.array(state['targetOffset']) + state['distance'] * back
        right = np.array([np.cos(theta), -np.sin(theta), 0.0])
        self._axes = np.array([right, np.cross(back, right), back])
        self._near = state['near']
        self._scale = 0.5 * height / np.tan(0.5 * np.radians(state['fovy']))

    def see(self, points: Floats) -> tuple[Floats, Floats]:
        """Return pixels right of and above the middle (n, 2) and depths (n) of points (n, 3)."""
        seen = (points - self._eye) @ self._axes.T
        depth = np.maximum(-seen[:, 2], self._near)
        return self._scale * seen[:, :2] / depth[:, None], depth

    def width(self, metres: float, depths: Floats) -> float:
        """Return how many pixels wide a line is at these depths in the mean."""
        return float(metres * self._scale / depths.mean())

    def faces(self, faces: list[Floats]) -> list[bool]:
        """Tell of flat faces, counter-clockwise from outside, which are seen from outside."""
        return [float(_normal(face) @ (self._eye - face[0])) > 0.0 for face in faces]


def draw_scene(
    axes: Axes, config: Mapping[str, Any], height: float, log: LayoutLog, at: float
) -> list[str]:
    """Draw what is visible at a time in s, `height` pixels high; return what was drawn."""
    camera = Camera(config['cameraState'], height)
    drawn = []
    for layer in config['layers'].values():
        if layer['visible'] and layer['layerId'] == 'foxglove.Grid':
            _grid(axes, camera, layer)
            drawn.append('grid')
    frames = _frames(log.latest('/tf', at), config['fixedFrame'])
    for topic, shown in config['topics'].items():
        if not shown['visible']:
            continue
        message = log.latest(topic, at)
        if 'lineWidth' in shown:
            points = np.array([_vector(pose.pose.position) for pose in message.poses])
            pixels, depths = camera.see(points)
            width = max(camera.width(shown['lineWidth'], depths), 1.2)
            axes.plot(*pixels.T, color=shown['gradient'][0], lw=0.72 * width, zorder=2)
            drawn.append(f'{topic}: {len(points)} poses')
        else:
            count = _robot(axes, camera, message.data, frames)
            drawn.append(f'{topic}: {count} faces')
    transforms = config['scene']['transforms']
    if transforms['visible']:
        for place in frames.values():
            ends = place[:3, 3] + transforms['axisSize'] * place[:3, :3].T
            for end, colour in zip(ends, ('#ff4040', '#40c040', '#5080ff'), strict=True):
                pixels, _ = camera.see(np.array([place[:3, 3], end]))
                axes.plot(*pixels.T, color=colour, lw=1.0, zorder=4)
        drawn.append(f'{len(frames)} frames')
    return drawn


def _grid(axes: Axes, camera: Camera, layer: Mapping[str, Any]) -> None:
    half = 0.5 * layer['size']
    marks = np.linspace(-half, half, layer['divisions'] + 1)
    along = np.linspace(-half, half, 2)
    lines = [[(m, a, 0.0) for a in along] for m in marks]
    lines += [[(a, m, 0.0) for a in along] for m in marks]
    pixels = [camera.see(np.array(line) + layer['position'])[0] for line in lines]
    axes.add_collection(
        LineCollection(pixels, colors=layer['color'], linewidths=0.6, alpha=0.5, zorder=1)
    )


def _frames(message: Any, fixed: str) -> dict[str, Floats]:
    """Return where every frame of a message of /tf is in the fixed one, (4, 4)."""
    places = {fixed: np.eye(4)}
    for each in message.transforms:  # parents come before their children
        parent = places.get(each.header.frame_id)
        if parent is None:
            raise InputError(f'/tf: expected {each.header.frame_id} to hang on {fixed}')
        x, y, z = _vector(each.transform.rotation)
        w = each.transform.rotation.w
        place = np.eye(4)
        place[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        place[:3, 3] = _vector(each.transform.translation)
        places[each.child_frame_id] = parent @ place
    return places


def _robot(axes: Axes, camera: Camera, urdf: str, frames: Mapping[str, Floats]) -> int:
    """Draw the shapes of a description in their frames, the farthest first."""
    root = Xml.fromstring(urdf)
    colours = {
        each.attrib['name']: _numbers(each.find('color').attrib['rgba'])[:3]  # type: ignore[union-attr]
        for each in root.findall('material')
    }
    seen = []
    for link in root.findall('link'):
        for visual in link.findall('visual'):
            place = frames[link.attrib['name']] @ _origin(visual)
            faces = [face @ place[:3, :3].T + place[:3, 3] for face in _shape(visual)]
            # What stands on top hides what is below, for a camera that looks down.
            level = int(min(face[:, 2].min() for face in faces) / _LEVEL)
            colour = colours[visual.find('material').attrib['name']]  # type: ignore[union-attr]
            for face, front in zip(faces, camera.faces(faces), strict=True):
                if front:
                    light = 0.55 + 0.6 * max(float(_normal(face) @ _LIGHT), 0.0)
                    pixels, depths = camera.see(face)
                    order = (level, -float(depths.mean()))
                    shade = np.clip((0.12 + 0.88 * colour) * light, 0.0, 1.0)
                    seen.append((order, pixels, tuple(shade)))
    seen.sort(key=lambda each: each[0])
    polygons, shades = [each[1] for each in seen], [each[2] for each in seen]
    axes.add_collection(
        PolyCollection(polygons, facecolors=shades, edgecolors=shades, lw=0.3, zorder=3)
    )
    return len(seen)


def _shape(visual: Xml.Element) -> list[Floats]:
    """Return the faces of a box, cylinder or sphere about its origin."""
    (shape,) = visual.find('geometry')  # type: ignore[misc]
    turn = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    if shape.tag == 'box':
        half = 0.5 * _numbers(shape.attrib['size'])
        faces = []
        for axis, sign in itertools.product(range(3), (1.0, -1.0)):
            u, v = np.eye(3)[(axis + 1) % 3], sign * np.eye(3)[(axis + 2) % 3]
            middle = sign * np.eye(3)[axis]
            faces.append(half * [middle + u + v, middle - u + v, middle - u - v, middle + u - v])
        return faces
    radius = float(shape.attrib['radius'])
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    if shape.tag == 'cylinder':
        up = np.array([0.0, 0.0, 0.5 * float(shape.attrib['length'])])
        sides = [
            np.array([a - up, b - up, b + up, a + up]) for a, b in itertools.pairwise(ring)
        ]
        return [*sides, ring[:-1] + up, ring[:-1][::-1] - up]
    heights = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _SIDES // 2 + 1)
    return [
        np.array([_on(a, low), _on(b, low), _on(b, high), _on(a, high)]) * (1.0, 1.0, radius)
        for low, high in itertools.pairwise(heights)
        for a, b in itertools.pairwise(ring)
    ]


def _on(point: Floats, height: float) -> Floats:
    """Move a point of the equator up to a latitude, z on the unit sphere."""
    moved: Floats = point * np.cos(height) + (0.0, 0.0, np.sin(height))
    return moved


def _normal(face: Floats) -> Floats:
    normal: Floats = np.cross(face[1] - face[0], face[2] - face[0])
    if not normal.any():  # the triangles at a sphere's poles
        normal = np.cross(face[2] - face[0], face[3] - face[0])
    return normal / np.linalg.norm(normal)


def _origin(visual: Xml.Element) -> Floats:
    origin = visual.find('origin')
    place = np.eye(4)
    roll, pitch, yaw = _numbers(origin.attrib['rpy'])  # type: ignore[union-attr]
    if pitch or yaw:
        raise InputError('robot_description: expected shapes that are turned about x alone')
    place[1:3, 1:3] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    place[:3, 3] = _numbers(origin.attrib['xyz'])  # type: ignore[union-attr]
    return place


def _vector(message: Any) -> tuple[float, float, float]:
    return message.x, message.y, message.z


def _numbers(text: str) -> Floats:
    return np.array([float(word) for word in text.split()])
