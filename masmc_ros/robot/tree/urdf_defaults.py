# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Defaults for a robot whose URDF alone is known.

They are the choices that a roboticist would make: driving wheels, controlled joints, tip, task,
start, and a small path. Each choice has a reason and the name of the parameter that changes it;
values that the user states are kept, and the other choices follow them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
import math
import os
import re
from textwrap import wrap
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import MutableValues, Value, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.robot.declaration import listed
from masmc_ros.robot.tree.assembly import STEERED, tree_robot, TreeRobot
from masmc_ros.robot.tree.link_inertia import joint_pose
from masmc_ros.robot.tree.postures import (
    arm_limits,
    frame_of,
    gravity_torques,
    least_pivot,
    placed,
    reach,
    spread,
    task_jacobian,
)
from masmc_ros.robot.tree.spatial import add, product, rotate, ROTATION, Rotation, VECTOR, Vector
from masmc_ros.robot.tree.task.outputs import OUTPUTS, Task
from masmc_ros.robot.tree.task.rotation_vector import vector_of
from masmc_ros.robot.tree.tree_mechanism import described, mobility, task_in
from masmc_ros.robot.tree.tree_parameters import (
    BASE_FRAME,
    BASE_TYPE,
    HELD_JOINTS,
    HELD_POSITIONS,
    JOINTS,
    LEAST_PIVOT,
    LIMIT_MARGIN,
    PARAMETERS,
    POSTURE,
    ROLLER_ANGLES,
    TASK,
    TIP_FRAME,
    TRACK_FACTOR,
    WHEEL_RADIUS,
    WHEELS,
)
from masmc_ros.robot.urdf import Description, Joint
import numpy as np

_HOLDING = 'robot.held_joints', 'robot.held_positions'

START, DURATION = 'plant.initial_joints', 'duration'

_SWING = 0.05
"""Amplitude of the path in m or rad, and the largest one as a share of the reach."""

_DURATION = 10.0
"""Length of the run in s."""

_REGULAR = 0.01
"""Smallest pivot from which zero or the middle of the ranges is a good start."""

_SEARCHED = 96
"""Postures of the search for a start."""

_CENTRAL = 0.6
"""Part of each range in the search."""

_WIDEST = 1.5
"""Largest distance in rad from the middle of the range in the search."""

_EFFORT_SHARE = 0.8
"""Part of its effort that a joint should need against gravity at the start."""

_STEPS = 10
"""Steps in which the path is checked."""

_SYMMETRIC = 2.0e-3
"""Tolerance in m and rad for wheels of one axle."""

_PARALLEL = 0.999
"""Smallest part along y of axles that are parallel to it."""

_WHEEL = ('wheel',)
_CASTOR = ('caster', 'castor')
_SUSPENSION = ('suspension', 'rocker', 'bogie')
_ANY_WAY = ('mecanum', 'omni')
_HEAD = {'head', 'neck', 'camera', 'eye', 'eyes', 'lidar', 'laser', 'kinect', 'antenna'}
_FINGER = {
    'finger', 'fingers', 'thumb', 'jaw', 'knuckle', 'knuckles', 'pinky', 'claw',
}  # fmt: skip
_OF_HAND = {'index', 'middle', 'ring', 'little', 'thumb'}
_GRIPPER = {'gripper', 'grip', 'grasp', 'palm', 'suction'}
_WRIST = {'roll', 'yaw', 'pitch', 'rotate', 'rotation', 'wrist', 'arm'}

_TIPS = (
    r'(^|_)tcp($|_)|(^|_)tcp\d*$', r'(^|_)tool0$', r'grasping_(frame|link)|(^|_)grasp(_|$)',
    r'end_?effector|(^|_)eef?($|_)|gripper_frame', r'(^|_)tool(_link|_frame)?$',
    r'(_|^)(tip|foot|toe)$',
)  # fmt: skip
"""Names of links for the tip, the best ones first."""


class Choice(NamedTuple):
    """Value that the user has not stated."""

    parameter: str
    """Name as in `--set`."""
    value: Value
    reason: str


@dataclass(frozen=True)
class Defaults:
    """
    Choices for a robot.

    Attributes
    ----------
    choices
        Choices in the order of a parameter file.
    notes
        Parts of the robot that are not used, a sentence each.

    """

    choices: tuple[Choice, ...]
    notes: tuple[str, ...] = ()


@dataclass
class _Parts:
    """Movable joints of a description by their use."""

    driving: list[Joint] = field(default_factory=list)
    castors: list[Joint] = field(default_factory=list)
    steered: list[Joint] = field(default_factory=list)
    """Those of the castors that a joint with a range steers."""
    fingers: list[Joint] = field(default_factory=list)
    heads: list[Joint] = field(default_factory=list)
    arm: list[Joint] = field(default_factory=list)


class _Tree:
    """Description with the way from the root to each link."""

    def __init__(self, description: Description, held: Iterable[str] = ()) -> None:
        self.description, self.held = description, {*held}
        self.joints = description.joints
        self.above = {joint.child: joint for joint in self.joints.values()}
        self.below: dict[str, list[Joint]] = {}
        for joint in self.joints.values():
            self.below.setdefault(joint.parent, []).append(joint)
        self.poses: dict[str, tuple[Rotation, Vector]] = {
            description.root: (ROTATION, VECTOR)
        }
        for link in self._links():
            rotation, offset = self.poses[link]
            for joint in self.below.get(link, ()):
                own, place = joint_pose(joint, 0.0)
                self.poses[joint.child] = (
                    product(rotation, own), add(offset, rotate(rotation, place))
                )

    def _links(self) -> Iterator[str]:
        links = [self.description.root]
        for link in links:
            yield link
            links += [joint.child for joint in self.below.get(link, ())]

    def way(self, link: str) -> list[Joint]:
        """Return the movable joints from the root to a link."""
        joints = []
        while link in self.above:
            joints.append(self.above[link])
            link = joints[-1].parent
        return [joint for joint in joints[::-1] if joint.kind != 'fixed']

    def carried(self, joint: Joint) -> list[Joint]:
        """Return the movable joints that a joint carries."""
        links, joints = [joint.child], []
        for link in links:
            for other in self.below.get(link, ()):
                links.append(other.child)
                joints += [other] if other.kind != 'fixed' else []
        return joints

    def axis(self, joint: Joint) -> Vector:
        """Return the axis of a joint in the frame of the root, with all joints at zero."""
        x, y, z = joint.axis
        axis: Vector = rotate(self.poses[joint.child][0], (x, y, z))
        return axis

    def fixed_links(self, link: str) -> list[str]:
        """Return a link and those that are fixed to it below, nearest first."""
        links = [link]
        for name in links:
            links += [j.child for j in self.below.get(name, ()) if j.kind == 'fixed']
        return links


def urdf_defaults(urdf: str, stated: Values) -> Defaults:
    """
    Return the defaults of a robot.

    Parameters
    ----------
    urdf
        Value of `robot.urdf`.
    stated
        Values that the user states, by their names as in `--set`.

    Raises
    ------
    InputError
        If the URDF or a stated value is invalid, or if no joint can be controlled.

    """
    _, description, where = described(urdf)
    values: MutableValues = {
        p.name: p.check(stated[p.name], integers_for_doubles=True)
        for p in PARAMETERS
        if p.name in stated
    }
    tree = _Tree(description, HELD_JOINTS.or_default(values))
    parts = _parts(tree)
    choices, notes = _base(tree, where, parts, values)
    choices += _arm(tree, parts, values)
    robot = _robot(description, where, values)
    choices += _task_and_start(description, robot, values, stated.get(START))
    return Defaults(
        tuple(choice for choice in choices if choice.parameter not in stated), tuple(notes)
    )


def parameter_text(urdf: str, stated: Values, defaults: Defaults) -> str:
    """
    Return a parameter file with the defaults of a robot; comments state the reasons.

    Parameters
    ----------
    urdf
        Value of `robot.urdf` for this file.
    stated
        Values that the user states, by their names as in `--set`.
    defaults
        Those of the robot.

    """
    lines = [
        '# Parameter file of masmc_ros for a robot described by a URDF, written by masmc robot.',
        '# The values below are choices by the URDF alone. Check and change them.',
        *(line for note in defaults.notes for line in _comment(note, '')),
        '/**:',
        '  ros__parameters:',
        '    robot:',
        *_comment('Path: relative to this file, or package://NAME/PATH.', '      '),
        f'      urdf: {yaml_text(urdf)}',
    ]
    own = [Choice(name, value, 'Stated by the user.') for name, value in stated.items()]
    groups: dict[str, list[Choice]] = {'robot': [], '': []}
    for choice in (*own, *defaults.choices):
        group, dot, _ = choice.parameter.partition('.')
        groups.setdefault(group if dot else '', []).append(choice)
    for choice in groups['robot']:
        lines += _entry(choice, 'robot.', '      ')
    for choice in groups['']:
        lines += _entry(choice, '', '    ')
    for node in [name for name in groups if name not in ('robot', '')]:
        lines += [f'/**/{node}:', '  ros__parameters:']
        for choice in groups[node]:
            lines += _entry(choice, f'{node}.', '    ')
    return '\n'.join(lines) + '\n'


def _entry(choice: Choice, prefix: str, indent: str) -> list[str]:
    name = choice.parameter.removeprefix(prefix)
    return [*_comment(choice.reason, indent), f'{indent}{name}: {yaml_text(choice.value)}']


def _comment(text: str, indent: str) -> list[str]:
    text = text[:1].upper() + text[1:].rstrip('.') + '.'
    lines = wrap(text, 97 - len(indent), break_long_words=False, break_on_hyphens=False)
    return [f'{indent}# {line}' for line in lines]


def urdf_value(path: str, folder: str) -> str:
    """Return the value of `robot.urdf` in a parameter file of a folder, for a path or URI."""
    if '://' in path:
        return path
    path, folder = os.path.abspath(path), os.path.abspath(folder or '.')
    is_below = os.path.commonpath([path, folder]) == folder
    return os.path.relpath(path, folder) if is_below else path


def _words(name: str) -> set[str]:
    """Return the words of a name of a joint or link."""
    parted = re.sub(r'(?<=[a-z])(?=[A-Z])', '_', name)
    return set(re.findall('[a-z]+', parted.lower()))


def _is_named(tree: _Tree, joint: Joint, words: Iterable[str]) -> bool:
    """Return True if the name of a joint or of its link contains one of these words."""
    name = f'{joint.name} {joint.child}'.lower()
    return any(word in name for word in words)


def _parts(tree: _Tree) -> _Parts:
    """Return the movable joints by their use; those that mimic others are of no use."""
    parts = _Parts()
    independent = [j for j in tree.joints.values() if j.kind != 'fixed' and not j.mimics]
    wheels = [joint for joint in independent if _is_wheel(tree, joint)]
    for joint in wheels:
        way = tree.way(joint.child)
        is_castor = len(_swivels(tree, joint)) > 0 or any(
            _is_named(tree, j, _CASTOR) for j in way if j.name not in tree.held
        )
        (parts.castors if is_castor else parts.driving).append(joint)
        if any(_is_steering(tree, other) for other in _swivels(tree, joint)):
            parts.steered.append(joint)
        parts.castors += [other for other in way[:-1] if other not in parts.castors]
    for joint in independent:
        rollers = any(j in tree.carried(wheel) for wheel in wheels for j in [joint])
        if (_is_named(tree, joint, _CASTOR) or rollers) and joint not in wheels:
            parts.castors += [joint] if joint not in parts.castors else []
    used = {joint.name for joint in (*parts.driving, *parts.castors)}
    others = [joint for joint in independent if joint.name not in used]
    mimicked = {joint.mimics for joint in tree.joints.values() if joint.mimics}
    fingers: set[str] = set()
    # Leaves first: a joint is one of a hand only if it carries nothing else.
    for joint in sorted(others, key=lambda joint: -len(tree.way(joint.child))):
        followers = [j for j in tree.joints.values() if joint.name in _sources(tree, j)]
        carried = [
            other.name
            for carrier in (joint, *followers)
            for other in tree.carried(carrier)
            if not other.mimics and other is not joint
        ]
        if not fingers.issuperset(carried):
            continue
        own = _words(joint.name)
        is_finger = (
            bool(own & _FINGER or _words(joint.child) & _FINGER)
            or bool(own & _GRIPPER and not own & _WRIST)
            or bool(own & _OF_HAND and own & {'hand'})
            or joint.name in mimicked
            or _is_one_of_two_jaws(tree, joint, others)
        )
        if is_finger:
            fingers.add(joint.name)
    carriers = {tree.joints[name].parent for name in fingers}
    for joint in others:
        own = {other.name for other in tree.carried(joint) if not other.mimics}
        if 'hand' in _words(joint.name) and joint.parent in carriers and own <= fingers:
            fingers.add(joint.name)
    heads: set[str] = set()
    for joint in sorted(others, key=lambda joint: -len(tree.way(joint.child))):
        carried = [other.name for other in tree.carried(joint) if not other.mimics]
        words = _words(joint.name) | _words(joint.child)
        if words & _HEAD and (heads | fingers).issuperset(carried):
            heads.add(joint.name)
    for joint in others:
        (
            parts.fingers if joint.name in fingers
            else parts.heads if joint.name in heads
            else parts.arm
        ).append(joint)  # fmt: skip
    if not parts.arm:
        # A hand or a head alone is the robot.
        parts.arm = [*parts.heads, *parts.fingers]
        parts.heads, parts.fingers = [], []
    return parts


def _sources(tree: _Tree, joint: Joint) -> list[str]:
    """Return the names of the joints that a joint mimics, directly or not."""
    names: list[str] = []
    while joint.mimics and joint.mimics not in names:
        names.append(joint.mimics)
        joint = tree.joints[joint.mimics]
    return names


def _is_wheel(tree: _Tree, joint: Joint) -> bool:
    """Return True for a turning joint with a level axis on the base, or on a vertical swivel."""
    if joint.kind not in ('continuous', 'revolute') or abs(tree.axis(joint)[2]) > 0.02:
        return False
    swivels = _swivels(tree, joint)
    if len(swivels) > 1 or any(abs(tree.axis(j)[2]) < 0.98 for j in swivels):
        return False
    if any(not _is_named(tree, other, ('roller',)) for other in tree.carried(joint)):
        return False
    return _is_named(tree, joint, (*_WHEEL, *_CASTOR)) or (
        joint.kind == 'continuous' and not swivels and _has_twin(tree, joint)
    )


def _swivels(tree: _Tree, wheel: Joint) -> list[Joint]:
    """Return the joints between base and wheel that turn it; a user may hold one."""
    way = [joint for joint in tree.way(wheel.child)[:-1] if joint.name not in tree.held]
    return [joint for joint in way if not _is_named(tree, joint, _SUSPENSION)]


def _is_steering(tree: _Tree, swivel: Joint) -> bool:
    """Return True if a drive turns the swivel of a wheel, by its name or its range."""
    return _is_named(tree, swivel, ('steer',)) or (
        swivel.kind == 'revolute' and not _is_named(tree, swivel, _CASTOR)
    )


def _has_twin(tree: _Tree, joint: Joint) -> bool:
    """Return True if one other joint is the mirror image of a joint, as that of an axle."""
    x, y, z = tree.poses[joint.child][1]
    twins = [
        other
        for other in tree.joints.values()
        if other.kind == 'continuous'
        and not tree.carried(other)
        and len(tree.way(other.child)) == 1
        and abs(tree.axis(other)[1]) > 0.999
        and abs(tree.axis(joint)[1]) > 0.999
        and math.dist(tree.poses[other.child][1], (x, -y, z)) < _SYMMETRIC
        and abs(y) > _SYMMETRIC
    ]
    return len(twins) == 1


def _is_one_of_two_jaws(tree: _Tree, joint: Joint, joints: Sequence[Joint]) -> bool:
    """Return True if a prismatic joint has a neighbour that slides as far."""
    return joint.kind == 'prismatic' and any(
        other is not joint
        and other.kind == 'prismatic'
        and other.parent == joint.parent
        and math.isclose(other.upper - other.lower, joint.upper - joint.lower, rel_tol=1e-3)
        for other in joints
    )


def _base(
    tree: _Tree, where: str, parts: _Parts, values: MutableValues
) -> tuple[list[Choice], list[str]]:
    """Choose base, wheels and base frame; complete the values, and return choices and notes."""
    wheels, notes = parts.driving, []
    if 'robot.wheels' in values or values.get('robot.base') == 'fixed':
        return [], []
    if parts.steered and 'robot.base' not in values:
        steered = listed([joint.name for joint in parts.steered])
        return [], [
            f'the base is fixed, because its wheels are steered (swerve or Ackermann), which is'
            f' not supported: {steered}; {STEERED}'
        ]
    if not wheels:
        castors = [joint.name for joint in parts.castors]
        if castors and 'robot.base' not in values:
            notes = [
                f'no driving wheels: {listed(castors)} turn about vertical axes or are castors;'
                ' the base is fixed. robot.base omnidirectional drives it directly; if the'
                ' vertical axes are fixed on the robot, name their joints in robot.held_joints'
            ]
        return [], notes
    names, links = [joint.name for joint in wheels], tree.description.links
    base = values.get('robot.base')
    kind, reason, of_wheels, error = '', '', '', ''
    more: MutableValues = {}
    if 'robot.roller_angles' in values:
        more['robot.roller_angles'] = ROLLER_ANGLES.of(values)
    are_parallel = all(abs(tree.axis(joint)[1]) > _PARALLEL for joint in wheels)
    is_named = any(
        _is_named(tree, joint, _ANY_WAY)
        or any(word in mesh for word in _ANY_WAY for mesh in links[joint.child].meshes)
        for joint in wheels
    )
    rolls_any_way = is_named or not are_parallel
    if len(wheels) == 2 and base in (None, 'differential'):
        kind, reason = 'differential', 'two wheels on one axle, the right one first'
    elif len(wheels) == 3 and base in (None, 'omnidirectional'):
        kind = 'omnidirectional'
        reason = 'three wheels; their rollers are assumed perpendicular (robot.roller_angles)'
    elif len(wheels) > 3 and (base == 'omnidirectional' or (base is None and rolls_any_way)):
        kind, reason = 'omnidirectional', f'{len(wheels)} wheels for every direction'
        if are_parallel and len(wheels) == 4:
            more.setdefault('robot.roller_angles', _mecanum_angles(tree, wheels))
        elif not more:
            reason += '; their rollers are assumed perpendicular (robot.roller_angles)'
        of_wheels = (
            'the wheels push the base: forward, sideways and turn have a force or torque each,'
            ' which is distributed to the wheels'
        )
    elif len(wheels) > 3 and base in (None, 'differential') and not rolls_any_way:
        kind = 'differential'
        more['robot.track_factor'] = TRACK_FACTOR.or_default(values)
        reason = (
            f'{len(wheels)} wheels in two rows, a skid-steer base. For mecanum wheels state'
            ' robot.base omnidirectional'
        )
        of_wheels = (
            'those of the right side first; the first one of a side has the torque and the limit'
            ' of the side'
        )
    options: list[MutableValues] = []
    for frame in _frames_of_base(tree, values) if kind else ():
        order = names
        if kind == 'differential':
            across = {joint.name: _seen(tree, frame, joint)[1] for joint in wheels}
            middle = 0.5 * (min(across.values()) + max(across.values()))
            order = sorted(names, key=lambda name: across[name] > middle)
        for radius in _radii(tree, values, tree.joints[order[0]]):
            options.append({
                'robot.base': kind, 'robot.base_frame': frame, 'robot.wheels': tuple(order),
                'robot.wheel_radius': radius, **more,
            })  # fmt: skip
    usable: tuple[MutableValues, TreeRobot] | None = None
    for option in options:
        try:
            # One joint is enough; the others, of a suspension for example, are held.
            first = tuple(joint.name for joint in parts.arm[:1])
            held = {name: values[name] for name in _HOLDING if name in values}
            own = {**option, **held, 'robot.joints': first}
            robot = _robot(tree.description, where, own)
        except InputError as problem:
            error = error or str(problem)
            continue
        usable = usable or (option, robot)
        if robot.axle is None:
            usable = option, robot
            break
    if usable is not None:
        option, robot = usable
        texts = {
            'robot.base': reason,
            'robot.base_frame': f'{listed(names)} are symmetric to this frame',
            'robot.wheels': of_wheels or reason,
            'robot.wheel_radius': "the radius of the wheel's shape",
            'robot.track_factor': 'effective track relative to the distance of the sides',
            'robot.roller_angles': (
                'assumed, because no URDF has them: the upper rollers form an X, seen from above'
            ),
        }
        usual = {
            'robot.base_frame': '', 'robot.wheel_radius': 0.0, 'robot.roller_angles': (0.0,),
        }  # fmt: skip
        choices = [
            Choice(name, value, texts[name])
            for name, value in option.items()
            if value != usual.get(name)
        ]
        for choice in choices:
            values.setdefault(choice.parameter, choice.value)
        return choices, notes
    if len(wheels) > 3 and base is None and is_named:
        values['robot.base'] = 'omnidirectional'
        reason = (
            f'{len(wheels)} wheels whose names say that they drive it in every direction; it is'
            ' driven directly, because the angles of the rollers are in no URDF (robot.wheels and'
            ' robot.roller_angles)'
        )
        return [Choice('robot.base', 'omnidirectional', reason)], notes
    if base is None:
        why = error.removeprefix(f'{where}: ') or f'{len(wheels)} wheel'
        notes = [
            f'the base is fixed, because its wheels {listed(names)} are not used: {why}.'
            ' robot.base omnidirectional drives the base directly'
        ]
    return [], notes


def _mecanum_angles(tree: _Tree, wheels: Sequence[Joint]) -> tuple[float, ...]:
    """Return the usual roller angles of four mecanum wheels at the corners."""
    centres = np.array([tree.poses[joint.child][1] for joint in wheels])
    ahead, left = (centres - centres.mean(axis=0))[:, :2].T
    angles: list[float] = (-0.25 * math.pi * np.sign(ahead * left)).tolist()
    return tuple(angles)


def _frames_of_base(tree: _Tree, values: Values) -> list[str]:
    """Return the links whose frames may be the base frame; an empty name is the root."""
    if 'robot.base_frame' in values:
        return [BASE_FRAME.of(values)]
    links = tree.fixed_links(tree.description.root)[1:]
    return ['', *sorted(links, key=lambda link: 'base' not in link and 'footprint' not in link)]


def _radii(tree: _Tree, values: Values, wheel: Joint) -> list[float]:
    """Return the possible radii of the wheels: their height, or that of their shape."""
    if 'robot.wheel_radius' in values:
        return [WHEEL_RADIUS.of(values)]
    radius = tree.description.links[wheel.child].radius
    return [0.0, radius] if radius else [0.0]


def _seen(tree: _Tree, frame: str, joint: Joint) -> Vector:
    """Return the place of a joint in the frame of a link on the base, with joints at zero."""
    rotation, offset = tree.poses[frame or tree.description.root]
    place = np.subtract(tree.poses[joint.child][1], offset)
    x, y, z = (np.reshape(rotation, (3, 3)).T @ place).tolist()
    return x, y, z


def _arm(tree: _Tree, parts: _Parts, values: MutableValues) -> list[Choice]:
    """Choose controlled joints, tip and held positions; complete the values."""
    choices: list[Choice] = []
    wheels = {*WHEELS.or_default(values)}
    arm = [joint for joint in parts.arm if joint.name not in wheels]
    tip = TIP_FRAME.or_default(values)
    if 'robot.joints' in values:
        names = set(JOINTS.of(values))
        chain = [joint for joint in tree.joints.values() if joint.name in names]
    else:
        chain, reason = _chain(tree, arm, tip)
        if not chain:
            return []
        others = {
            'fingers': parts.fingers, 'heads': parts.heads,
            'castors and suspensions': parts.castors,
            'wheels': [joint for joint in parts.driving if joint.name not in wheels],
            'other branches': [joint for joint in arm if joint not in chain],
        }  # fmt: skip
        held = [
            f'{kind} {listed([joint.name for joint in joints])}'
            for kind, joints in others.items()
            if joints
        ]
        if held:
            reason += f'; held: {"; ".join(held)}'
        joints = tuple(joint.name for joint in chain)
        values['robot.joints'] = joints
        choices.append(Choice('robot.joints', joints, reason))
    if not tip and chain:
        tip, reason = _tip(tree, parts, chain[-1])
        values['robot.tip_frame'] = tip
        choices.append(Choice('robot.tip_frame', tip, reason))
    if 'robot.held_joints' not in values:
        away = _held_away_from_zero(tree, {*JOINTS.of(values), *wheels})
        if away:
            values['robot.held_joints'] = tuple(away)
            values['robot.held_positions'] = tuple(away.values())
            reason = 'zero is outside of their ranges'
            choices.append(Choice('robot.held_joints', tuple(away), reason))
            reason = 'the ends of the ranges next to zero'
            choices.append(Choice('robot.held_positions', tuple(away.values()), reason))
    return choices


def _chain(tree: _Tree, arm: Sequence[Joint], tip: str) -> tuple[list[Joint], str]:
    """Return the controlled joints, and the reason for them."""
    known = {joint.name for joint in arm}
    if tip in tree.poses:
        way = [joint for joint in tree.way(tip) if not joint.mimics]
        own = [joint for joint in way if joint.name in known] or way
        return own, f'the joints from the base to {tip}'
    chains = [[j for j in tree.way(joint.child) if j.name in known] for joint in arm]
    longest = max(map(len, chains), default=0)
    best = [chain for chain in chains if len(chain) == longest]
    if not best:
        return [], ''
    reason = 'the longest chain of joints'
    if len(best) > 1:
        ends = listed([chain[-1].name for chain in best[1:]])
        reason += f'; as long: that to {ends} (robot.tip_frame selects it)'
    return best[0], reason


def _tip(tree: _Tree, parts: _Parts, last: Joint) -> tuple[str, str]:
    """Return the link of the tip on the body of the last joint, and the reason for it."""
    links = [
        link for link in tree.fixed_links(last.child) if not _words(link) & _HEAD
    ] or [last.child]
    for pattern in _TIPS:
        for link in links:
            if re.search(pattern, link.lower()):
                return link, f'its name is that of a tool; it is fixed to the link of {last.name}'
    for finger in parts.fingers:
        if finger.parent in links:
            return finger.parent, f'it carries the finger {finger.name}'
    return last.child, f'the link of {last.name}, the last controlled joint'


def _held_away_from_zero(tree: _Tree, moving: set[str]) -> dict[str, float]:
    """Return the positions of held joints for which zero is out of range."""
    return {
        joint.name: joint.lower if joint.lower > 0.0 else joint.upper
        for joint in tree.joints.values()
        if joint.kind != 'fixed'
        and not joint.mimics
        and joint.name not in moving
        and not joint.lower <= 0.0 <= joint.upper
    }


def _robot(description: Description, where: str, values: Values) -> TreeRobot:
    """Return the robot of the values."""
    names = HELD_JOINTS.or_default(values)
    positions = np.broadcast_to(HELD_POSITIONS.or_default(values), len(names))
    rollers = ROLLER_ANGLES.or_default(values)
    robot = tree_robot(
        description,
        where,
        base=BASE_TYPE.or_default(values),
        base_frame=BASE_FRAME.or_default(values),
        wheels=WHEELS.or_default(values),
        wheel_radius=WHEEL_RADIUS.or_default(values),
        roller_angles=rollers if any(rollers) and len(rollers) > 1 else (),
        track_factor=TRACK_FACTOR.or_default(values),
        joints=JOINTS.or_default(values),
        held=dict(zip(names, positions.tolist(), strict=True)),
    )
    if not robot.joints:
        raise InputError(f'{where}: no joint that can be controlled; expected one at least')
    return robot


def _task_and_start(
    description: Description, robot: TreeRobot, values: MutableValues, start_of_user: object
) -> list[Choice]:
    """Choose task, start, posture and path; they follow a start of the user."""
    every = {p.name: p.or_default(values) for p in PARAMETERS}
    postures, kinds = _postures(robot)
    stated = TASK.of(every) if 'robot.task' in values else None
    velocities = robot.tree.base + len(robot.joints)
    best: tuple[Task, Array] | None = None
    for kind in ('pose', 'position', 'planar', 'joints'):
        texts = tuple(stated or (kind,))
        if not stated and len(OUTPUTS.get(kind, ())) > velocities:
            continue
        task = task_in(robot, every, texts)
        pivots = _pivots(robot, task, every, postures)
        if stated or kind == 'joints' or pivots.max() > 2.0 * LEAST_PIVOT.of(every):
            best = task, pivots
            break
    assert best is not None
    task, pivots = best
    choices = []
    if not stated:
        reasons = {
            'pose': 'position and rotation of the tip',
            'position': 'position of the tip; the joints do not move its rotation independently',
            'planar': 'x and y of the tip; the joints move no further axis of it independently',
            'joints': 'the joints move no position of the tip independently',
        }
        choices.append(Choice('robot.task', texts, reasons[texts[0]]))
    if 'robot.posture' in values:
        start = np.broadcast_to(np.array(POSTURE.of(values)), len(robot.joints))
        why = 'robot.posture'
    else:
        start, why = _start(robot, postures, kinds, pivots)
        if isinstance(start_of_user, list) and len(start_of_user) >= len(start):
            start = np.array(start_of_user[-len(start):], dtype=np.float64)
        posture = tuple(start.tolist())
        choices.append(Choice('robot.posture', posture, 'the start'))
    choices.append(Choice(DURATION, _DURATION, 'length of the run in s'))
    drives = robot.tree.base
    choices.append(Choice(START, (*(0.0,) * drives, *start.tolist()), why))
    return choices + _path(robot, task, every, start)


def _postures(robot: TreeRobot) -> tuple[Array, tuple[str, str]]:
    """Return candidates for the start: zero, the middle, then others."""
    lower, upper = arm_limits(robot)
    is_bounded = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(is_bounded, lower, -math.pi), np.where(is_bounded, upper, math.pi)
    middle = 0.5 * (low + high)
    half = 0.5 * _CENTRAL * (high - low)
    turns = np.array([joint.kind != 'prismatic' for joint in robot.joints])
    half = np.where(turns, np.minimum(half, _WIDEST), half)
    others = middle + half * (2.0 * spread(_SEARCHED, len(middle)) - 1.0)
    middle = np.where(is_bounded, middle, 0.0)
    postures: Array = np.vstack([np.zeros(len(middle)), middle, others]).round(3)
    return postures, ('zero is inside of all ranges and not singular', 'the middle of the ranges')


def _inside(robot: TreeRobot, every: Values, postures: Array) -> Array:
    """Return True (m) for postures inside of all ranges and of the margins before their ends."""
    lower, upper = arm_limits(robot)
    with np.errstate(invalid='ignore'):
        margin = np.nan_to_num(LIMIT_MARGIN.of(every) * (upper - lower), posinf=0.0)
    is_inside = (postures >= lower + margin) & (postures <= upper - margin)
    inside: Array = np.all(is_inside, axis=1)
    return inside


def _pivots(robot: TreeRobot, task: Task, every: Values, postures: Array) -> Array:
    """Return the smallest pivot (m) of postures; -1 for those outside of ranges."""
    bodies = placed(robot, postures)
    frames = [robot.frames[link] for link in task.frames]
    columns = task_jacobian(robot, bodies, frames, task.places)
    pivots = least_pivot(columns, mobility(robot, every, postures))
    return np.where(_inside(robot, every, postures), pivots, -1.0)


def _start(
    robot: TreeRobot, postures: Array, kinds: Sequence[str], pivots: Array
) -> tuple[Array, str]:
    """Return the start (n) and the reason for it."""
    torques = np.abs(gravity_torques(robot, placed(robot, postures)))
    efforts = robot.limits.effort[-len(robot.joints):]
    limits = np.where(efforts > 0.0, _EFFORT_SHARE * efforts, np.inf)
    holds = np.asarray((torques <= limits).all(axis=1))
    for number, reason in enumerate(kinds):
        if pivots[number] >= _REGULAR and holds[number]:
            return postures[number], reason
    among = np.flatnonzero(holds & (pivots > 0.0)) if (holds & (pivots > 0.0)).any() else (
        np.arange(len(pivots))
    )  # fmt: skip
    number = int(among[np.argmax(pivots[among])])
    why = f'of {len(postures)} postures inside of the ranges the farthest from singularities'
    return postures[number], why


def _path(robot: TreeRobot, task: Task, every: Values, start: Array) -> list[Choice]:
    """Return a small path that starts at rest at the start, and that the robot can follow."""
    offset = _task_position(robot, task, start)
    amplitude, reason = _swing(robot, task, every, start)
    moved = np.abs(amplitude) > 0.0
    quarter = np.where(moved, -0.5 * math.pi, 0.0)
    texts = {
        'offset': (offset + amplitude, 'position of the start plus the amplitude'),
        'amplitude': (amplitude, reason),
        'frequency': (moved.astype(np.float64), 'in rad/s'),
        'phase': (quarter, 'the sine starts at its end, at rest'),
    }
    return [
        Choice(f'trajectory.line_sine.{name}', tuple(np.round(value, 9).tolist()), why)
        for name, (value, why) in texts.items()
    ]


def _task_position(robot: TreeRobot, task: Task, start: Array) -> Array:
    """Return the position (axes) of the task at the start."""
    bodies = placed(robot, start[None])
    coordinates: list[float] = []
    for link in task.frames:
        rotation, origin = frame_of(bodies, robot.frames[link])
        coordinates += [*origin[0].tolist(), *vector_of(tuple(rotation[0].ravel().tolist()))]
    every = np.array([*coordinates, *start.tolist()])
    position: Array = every[list(task.places)]
    return position


def _swing(
    robot: TreeRobot, task: Task, every: Values, start: Array
) -> tuple[Array, str]:
    """Return the amplitudes (axes) of the path, and a text about them."""
    first = 6 * len(task.frames)
    amplitude = np.zeros(len(task.places))
    if not task.frames:
        lower, upper = arm_limits(robot)
        with np.errstate(invalid='ignore'):
            middle = np.where(np.isfinite(upper - lower), 0.5 * (lower + upper), start)
            size = np.minimum(_SWING, 0.05 * np.nan_to_num(upper - lower, posinf=2.0 * math.pi))
        for axis, place in enumerate(task.places):
            k = place - first
            amplitude[axis] = size[k] if middle[k] >= start[k] else -size[k]
        return amplitude, (
            'each joint moves by twice this amplitude towards the middle of its range'
        )
    swing = min(_SWING, _SWING * reach(robot, task.frames[0], start))
    options = []
    for axis in [i for i, place in enumerate(task.places) if place < first and place % 6 < 3]:
        for sign in (1.0, -1.0):
            step = np.zeros(len(task.places))
            step[axis] = sign * 2.0 * swing / _STEPS
            options.append((_followed(robot, task, every, start, step), axis, sign))
    best = max((pivot for pivot, _, _ in options), default=0.0)
    if not best > LEAST_PIVOT.of(every):
        return amplitude, 'the tip stays: no direction was found in which it can move'
    _, axis, sign = next(option for option in options if option[0] >= best * (1.0 - 1e-6))
    amplitude[axis] = sign * round(swing, 3)
    return amplitude, 'the tip moves by twice this amplitude, which the joints can follow'


def _followed(
    robot: TreeRobot, task: Task, every: Values, start: Array, step: Array
) -> float:
    """Return the smallest pivot along a straight motion; -1 if a joint reaches an end."""
    at, least = start.copy(), math.inf
    frames = [robot.frames[link] for link in task.frames]
    for _ in range(_STEPS):
        weights = mobility(robot, every, at[None])
        columns = task_jacobian(robot, placed(robot, at[None]), frames, task.places)
        pivot = float(_pivots(robot, task, every, at[None])[0])
        if not pivot > 0.0:
            return -1.0
        least = min(least, pivot)
        j, w = columns[0], weights[0]
        motion = w * (j.T @ np.linalg.solve((j * w) @ j.T, step))
        # The base moves too; its pose turns the Jacobian only slightly.
        at = at + motion[robot.tree.base:]
    return min(least, float(_pivots(robot, task, every, at[None])[0]))
