# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Outputs of the task of a tree, each of a frame or of joints, and their axes.

Only this module defines outputs; coordinates, names, units and reports are derived from it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
import re
from string import ascii_uppercase
from typing import NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.robot.declaration import Coordinate, Point, Quantity
from masmc_ros.robot.tree.tree_model import MOST_COORDINATES

OUTPUTS = {
    'pose': (0, 1, 2, 3, 4, 5),
    'position': (0, 1, 2),
    'orientation': (3, 4, 5),
    'planar': (0, 1),
    'base': (0, 1, 5),
    'heading': (5,),
}
"""Types of outputs of frames, with their entries of x, y, z and the rotations."""

JOINTS = 'joints'
"""Type of output of joints."""

_OF_BASE = ('base', 'heading')
"""Types that refer to the base unless they name a frame."""

_AXES = (('x', 'm'), ('y', 'm'), ('z', 'm'), ('rx', 'rad'), ('ry', 'rad'), ('rz', 'rad'))
"""Coordinates of a frame."""

_ROTATED = 3
"""Number of its positions, which precede its rotations."""


class TaskRobot(NamedTuple):
    """Available frames and joints of outputs."""

    links: Collection[str]
    joints: Sequence[Coordinate]
    """Controlled joints, without wheels."""
    tip: str
    """Default link of outputs."""
    base: str
    """Link of outputs of the base."""
    goes_sideways: bool
    """True if the base can move sideways, or is fixed."""


class Task(NamedTuple):
    """All outputs."""

    frames: tuple[str, ...]
    """Links, each once."""
    places: tuple[int, ...]
    """Indices of the axes among the coordinates of `task.py`."""
    axes: tuple[Quantity, ...]
    points: tuple[Point, ...]
    """Groups of axes that reports evaluate together."""

    def positions_in(self, posture: Sequence[float]) -> tuple[float, ...]:
        """Return the joint position of each axis in a posture; 0 for axes of frames."""
        first = len(_AXES) * len(self.frames)
        return tuple(posture[at - first] if at >= first else 0.0 for at in self.places)


class _Output(NamedTuple):
    """Output; for joints the link is empty."""

    kind: str
    link: str
    axes: tuple[int, ...]
    """Indices among the coordinates of the frame, or among the joints."""


def task_of(texts: Sequence[str], task_robot: TaskRobot) -> Task:
    """Return the task of outputs, each a type and its target; may raise InputError."""
    outputs = [_output(text, task_robot) for text in texts]
    frames = tuple(dict.fromkeys(output.link for output in outputs if output.link))
    places: list[int] = []
    axes: list[Quantity] = []
    for text, output in zip(texts, outputs, strict=True):
        first = len(_AXES) * (frames.index(output.link) if output.link else len(frames))
        end = output.link if len(frames) > 1 else 'tip'
        for axis in output.axes:
            if first + axis in places:
                raise InputError(
                    f"robot.task: '{text}' has an axis that one before it has; expected each once"
                )
            places.append(first + axis)
            if output.link:
                name, unit = _AXES[axis]
                axes.append(Quantity(f'{name}_{end}', unit))
            else:
                joint = task_robot.joints[axis]
                axes.append(Quantity(joint.name, joint.unit))
    if not 0 < len(axes) <= MOST_COORDINATES:
        raise InputError(f'robot.task: {len(axes)} axes; expected 1 to {MOST_COORDINATES}')
    return Task(frames, tuple(places), tuple(axes), _points(outputs, axes))


def _output(text: str, task_robot: TaskRobot) -> _Output:
    kind, _, target = text.strip().partition(' ')
    target = target.strip()
    if kind == JOINTS:
        names = [joint.name for joint in task_robot.joints]
        unknown = [name for name in target.split() if name not in names]
        if unknown:
            raise InputError(
                f"robot.task: no joint '{unknown[0]}' is controlled; "
                f'{suggestion(unknown[0], tuple(names))}'
            )
        return _Output(kind, '', tuple(names.index(name) for name in target.split() or names))
    if kind not in OUTPUTS:
        kinds = (*OUTPUTS, JOINTS)
        raise InputError(f"robot.task: no output '{kind}'; {suggestion(kind, kinds)}")
    if kind == 'base' and not task_robot.goes_sideways:
        raise InputError(
            'robot.task = base: expected robot.base omnidirectional or fixed; of two wheels take '
            'heading, and planar of a frame ahead of their axle, as none of their motions is '
            'sideways'
        )
    link = target or (task_robot.base if kind in _OF_BASE else task_robot.tip)
    if link not in task_robot.links:
        known = suggestion(link, tuple(task_robot.links))
        raise InputError(f"robot.task: no link '{link}'; {known}")
    return _Output(kind, link, OUTPUTS[kind])


class _Part(NamedTuple):
    """Neighbouring axes of one unit."""

    name: str
    first: int
    size: int
    unit: str
    is_place: bool = False
    is_rotation: bool = False


def _points(outputs: Sequence[_Output], axes: Sequence[Quantity]) -> tuple[Point, ...]:
    """Return the points of reports: positions and rotations of frames, joints of one unit."""
    parts: list[_Part] = []
    at, is_alone = 0, len(outputs) == 1
    for output in outputs:
        end = at + len(output.axes)
        if output.link:
            parts += _of_frame(output, at, 'tip' if is_alone else output.link)
        else:
            parts += _of_joints(axes, at, end)
        at = end
    if is_alone and outputs[0].link:
        return tuple(_point('T' if part.is_place else 'R', part) for part in parts)
    if len(parts) == 1:
        return (_point('q', parts[0]),)
    return tuple(
        _point(f'{ascii_uppercase[i % 26]}{i // 26 or ""}', part) for i, part in enumerate(parts)
    )


def _of_frame(output: _Output, first: int, place: str) -> list[_Part]:
    """Return the position of a frame, called `place`, and its rotation, as far as it has them."""
    size = len([axis for axis in output.axes if axis < _ROTATED])
    parts = [_Part(place, first, size, 'm', is_place=True)] if size else []
    turned = len(output.axes) - size
    if turned:
        kind = 'heading' if turned == 1 else 'orientation'
        frame = output.link if output.kind in (*_OF_BASE, 'orientation') else place
        name = f'{kind} of {frame}'
        parts.append(_Part(name, first + size, turned, 'rad', is_rotation=True))
    return parts


def _of_joints(axes: Sequence[Quantity], first: int, end: int) -> list[_Part]:
    """Return neighbours of the same unit."""
    changes = [i for i in range(first + 1, end) if axes[i].unit != axes[i - 1].unit]
    numbers = []
    for start, stop in zip((first, *changes), (*changes, end), strict=True):
        name = f'{axes[start].name} to {axes[stop - 1].name}'
        name = axes[start].name if stop == start + 1 else name if changes else JOINTS
        numbers.append(_Part(name, start, stop - start, axes[start].unit))
    return numbers


def _point(symbol: str, part: _Part) -> Point:
    key = re.sub(r'\W+', '_', part.name)
    title = f'the {part.name}'.replace(' of tip', ' of the tip')
    return Point(
        symbol, key, part.name, title, part.first, part.size, part.unit, part.is_place,
        part.is_rotation,
    )  # fmt: skip
