# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Assembly of a robot from a URDF: moving bodies, controlled joints, and the base.

Links without relative motion are one body. This merges fixed joints, and joints that are not
controlled, which are held at a constant position. It also merges wheels; their spin remains as
armature on the base velocities. A joint that mimics a controlled one moves a body with it; its
offset is part of the constant placement of this body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
import heapq
import math
from typing import NamedTuple

from masmc_ros.errors import InputError, suggestion
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.tree.link_inertia import (
    about,
    check_links,
    check_moments,
    Frame,
    joint_pose,
    link_moments,
    LinkedBody,
    rotation_of,
    seen_from,
    vector,
    with_link,
)
from masmc_ros.robot.tree.spatial import (
    add,
    Moments,
    product,
    rotate,
    ROTATION,
    Rotation,
    scale,
    turn,
    VECTOR,
    Vector,
)
from masmc_ros.robot.tree.tree_model import (
    DIFFERENTIAL,
    FIXED,
    OMNIDIRECTIONAL,
    PRISMATIC,
    REVOLUTE,
    Tree,
)
from masmc_ros.robot.tree.wheels import driving_wheels, middle_of, Mount, Wheels
from masmc_ros.robot.urdf import Description, Joint, Link, Pose
import numpy as np
from numpy.typing import NDArray

BASES = {
    'fixed': FIXED,
    'differential': DIFFERENTIAL,
    'omnidirectional': OMNIDIRECTIONAL,
}
"""Kinds of bases by name."""

STEERED = (
    'the directions in which such a base moves follow its steering angles, which are no'
    ' coordinates of the model; robot.base omnidirectional without robot.wheels drives it by two'
    ' forces and a torque, for which a driver steers the wheels'
)
"""Reason and remedy for steered wheels."""

AXLE = 'base_axle'
"""Link that is added for the base frame if that of the description is not on the axle."""

TRACK_FACTOR = 1.5
"""Default effective track of a skid-steer base relative to its track: that of Jackal's driver."""

_UPRIGHT = 0.98
"""Smallest vertical part of the axis of a joint that steers a wheel."""

_ROUNDED = 1.0e-9
"""Tolerance of limits that mimic joints narrow, relative to their size."""

_ENDLESS = (-math.inf, math.inf)
"""Range of a joint without limits."""


class Limits(NamedTuple):
    """Limits of the joints, an entry for each; infinite without a limit."""

    lower: NDArray[np.float64]
    """In rad or m."""
    upper: NDArray[np.float64]
    """In rad or m."""
    speed: NDArray[np.float64]
    """In rad/s or m/s, either way."""
    effort: NDArray[np.float64]
    """In N·m or N, either way."""


class Mimic(NamedTuple):
    """Position of a mimic joint: `multiplier` times that of a controlled joint, plus `offset`."""

    source: str
    multiplier: float
    offset: float
    """In rad or m."""


@dataclass(frozen=True)
class TreeRobot:
    """
    A robot that is a tree of bodies.

    Attributes
    ----------
    tree
        Bodies and joints.
    inertial_parameters
        Inertial parameters (B, 10) of its bodies, see `spatial`.
    joints
        Controlled joints, with the narrower limits and the friction that their mimic joints add.
    moving
        Joint of each body after the base: the controlled ones and their mimic joints.
    mimics
        Mimic joints of controlled joints, by name.
    frames
        Frames of its links by name.
    wheels
        Wheels that drive the base; None if its velocities are actuated directly.
    held
        Positions of the joints that are not controlled, in rad or m, by name; those without an
        entry are at 0.
    notes
        Parts of the description that the model does not follow, a sentence each.
    base_frame
        Link with the base frame.
    axle
        Fixed joint of the link AXLE, which is added to the description; None without it.

    """

    tree: Tree
    inertial_parameters: NDArray[np.float64]
    joints: tuple[Joint, ...]
    moving: tuple[Joint, ...]
    mimics: Mapping[str, Mimic]
    frames: Mapping[str, Frame]
    wheels: Wheels | None = None
    held: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    base_frame: str = ''
    axle: Joint | None = None

    @property
    def limits(self) -> Limits:
        """
        Limits of the wheels or sides in their order, then of the controlled joints.

        If the wheels push the base, they are those of its rates and forces.
        """
        wheels = self.wheels
        moving = (*(wheels.drives if wheels else ()), *self.joints)
        limits = Limits(
            *(np.array([getattr(joint, name) for joint in moving]) for name in Limits._fields)
        )
        if wheels is None or not wheels.push_base:
            return limits
        speeds, forces = wheels.base_limits
        ends = np.full(len(speeds), math.inf)
        own = -ends, ends, speeds, forces
        return Limits(*map(np.concatenate, zip(own, limits, strict=True)))


def tree_robot(
    description: Description,
    where: str,
    *,
    base: str = 'fixed',
    base_frame: str = '',
    wheels: Sequence[str] = (),
    wheel_radius: float = 0.0,
    roller_angles: Sequence[float] = (),
    joints: Sequence[str] = (),
    held: Mapping[str, float] | None = None,
    armature: float = 0.0,
    track_factor: float = TRACK_FACTOR,
) -> TreeRobot:
    """
    Return the robot of a description.

    Parameters
    ----------
    description
        Links and joints.
    where
        Source of the description, for messages.
    base
        Type of base, one of BASES.
    base_frame
        Name of the link with the base frame, x forwards and z up; empty for the root.
    wheels
        Names of the joints of right and left wheel of a differential base, of four or more wheels
        of a skid-steer one, or of at least three wheels of an omnidirectional one. Without wheels
        the base velocities are actuated directly. If the base frame of a differential base is not
        in the middle of its wheels, the model's base frame is a link AXLE that is added there.
    wheel_radius
        Radius in m; 0 selects the height of the axles above the base frame.
    roller_angles
        Angles of mecanum rollers in rad, see `driving_wheels`.
    joints
        Names of the controlled joints in their order, parents first; empty for all movable
        joints in the order of the file. Mimic joints of controlled joints move with them.
    held
        Positions of joints that are not controlled, in rad or m, by name; default 0.
    armature
        Rotor inertia of every joint, at the joint, in kg·m² or kg; mimic joints have no rotor.
    track_factor
        Effective track of a skid-steer base relative to the distance of its wheels.

    Raises
    ------
    InputError
        If a name is unknown, or the robot is invalid.

    """
    if base not in BASES:
        raise InputError(f"robot.base '{base}'; {suggestion(base, BASES)}")
    is_right, expected = {
        'fixed': (not wheels, 'none'),
        'differential': (
            len(wheels) > 1 and len(wheels) % 2 == 0,
            'the joints of right and left wheel, or of all wheels of a skid-steer base, as many'
            ' on both sides,',
        ),
        'omnidirectional': (not wheels or len(wheels) > 2, 'three or more joints or none'),
    }[base]
    if not is_right or len(set(wheels)) != len(wheels):
        raise InputError(
            f'robot.wheels {list(wheels)}: expected {expected} for robot.base = {base}'
        )
    _check_names(description, [*wheels, *joints, *(held or {})])
    controlled = _controlled(description, where, wheels, joints, held or {})
    stated_positions = held
    mimics, held, mimic_notes = _mimics(description, where, controlled, wheels, held or {})
    places = controlled, mimics, held
    ranks = {name: number for number, name in enumerate(description.joints)}
    bodies, moving, frames, tree = _merged(description, *places, base_frame, ranks)
    order = [joint for joint in moving if joint.name in controlled]
    if joints and [joint.name for joint in order] != list(joints):
        ranks = {**dict.fromkeys(description.joints, -1), **{n: i for i, n in enumerate(joints)}}
        bodies, moving, frames, tree = _merged(description, *places, base_frame, ranks)
        order = [joint for joint in moving if joint.name in controlled]
        _check_order(joints, order)
    # A fixed base does not move, so its inertia has no effect.
    first = int(base == 'fixed')
    link_notes = check_links(first, bodies, frames, description, where)
    check_moments(bodies[first:], description, where)
    kind, driving = BASES[base], None
    parents, rotations, offsets = tree
    rotor = np.zeros((kind + len(order), kind + len(order)))
    rotor[range(kind, len(rotor)), range(kind, len(rotor))] = armature
    if wheels:
        fixed = stated_positions or {}
        mounts = [_mount(description, where, frames, name, fixed) for name in wheels]
        middle = middle_of(mounts, where) if kind == DIFFERENTIAL else (0.0, 0.0)
        if any(middle) and base_frame == AXLE:
            raise InputError(
                f'{where}: wheels at {[mount.centre for mount in mounts]}; expected the base'
                f" frame '{AXLE}' in the middle between them"
            )
        if any(middle):
            axle = description.joints.get(f'{AXLE}_joint') or Joint(
                f'{AXLE}_joint', 0, 'fixed', base_frame or description.root, AXLE,
                Pose((*middle, 0.0)), (1.0, 0.0, 0.0),
            )  # fmt: skip
            moved = tree_robot(
                with_axle(description, axle), where, base=base, base_frame=AXLE, wheels=wheels,
                wheel_radius=wheel_radius, roller_angles=roller_angles, joints=joints,
                held=stated_positions, armature=armature, track_factor=track_factor,
            )  # fmt: skip
            x, y, _ = axle.origin.offset
            note = (
                f"the middle of the wheels is at x {x:g} m, y {y:g} m of '{axle.parent}': a link"
                f" '{AXLE}' is added there, and pose, odometry and tasks of the base are those of"
                ' this link'
            )
            return replace(moved, axle=axle, notes=(note, *moved.notes))
        driving = driving_wheels(
            kind, mounts, where, wheel_radius, roller_angles, track_factor
        )
        rotor[:kind, :kind] = driving.inertia(armature)
    axes = [VECTOR, *(joint.axis for joint in moving)]
    kinds = [PRISMATIC if joint.kind == 'prismatic' else REVOLUTE for joint in moving]
    numbers = {joint.name: number for number, joint in enumerate(order)}
    ways = [mimics.get(joint.name, Mimic(joint.name, 1.0, 0.0)) for joint in moving]
    driven = [_with_mimics(joint, moving, mimics) for joint in order]
    return TreeRobot(
        Tree(
            kind,
            np.array(parents),
            np.array([REVOLUTE, *kinds]),
            np.array(axes),
            np.array(rotations),
            np.array(offsets),
            rotor,
            np.array([0, *(numbers[way.source] for way in ways)]),
            np.array([1.0, *(way.multiplier for way in ways)]),
        ),
        np.array([body.inertial_parameters for body in bodies]),
        tuple(joint for joint, _ in driven),
        tuple(moving),
        mimics,
        frames,
        driving,
        held,
        (*mimic_notes, *(note for _, notes in driven for note in notes), *link_notes),
        base_frame or description.root,
    )


def with_axle(description: Description, axle: Joint) -> Description:
    """Return a description with the link AXLE on its fixed joint, if it has no such link."""
    if AXLE in description.links:
        return description
    return replace(
        description,
        links={**description.links, AXLE: Link(AXLE, 0)},
        joints={**description.joints, axle.name: axle},
    )


def _check_names(description: Description, names: Sequence[str]) -> None:
    for name in names:
        if name not in description.joints:
            raise InputError(f"no joint '{name}'; {suggestion(name, tuple(description.joints))}")


def _check_order(joints: Sequence[str], order: Sequence[Joint]) -> None:
    """Raise InputError unless the joints are different and have the order of the tree."""
    names = [joint.name for joint in order]
    if names != list(joints):
        raise InputError(
            f'robot.joints [{", ".join(joints)}]: expected each joint once, and after the joints'
            f' that carry it: [{", ".join(names)}]'
        )


def _mimics(
    description: Description,
    where: str,
    controlled: set[str],
    wheels: Sequence[str],
    held: Mapping[str, float],
) -> tuple[dict[str, Mimic], dict[str, float], list[str]]:
    """
    Return the mimic joints of controlled ones, the positions of held joints, and notes.

    A mimic joint of a joint that is not controlled is held at the position for it.
    """
    mimics, positions, notes = {}, dict(held), []
    for joint in description.joints.values():
        if not joint.mimics or joint.kind == 'fixed' or joint.name in held:
            continue
        source, multiplier, offset = joint, 1.0, 0.0
        while source.mimics and source.kind != 'fixed' and source.name not in held:
            offset += multiplier * source.mimic_offset
            multiplier *= source.multiplier
            source = description.joints[source.mimics]
        if not math.isfinite(multiplier + offset):
            raise InputError(
                f"{where}, line {joint.line}: joint '{joint.name}' mimics '{source.name}' with"
                f' multiplier {multiplier:g} and offset {offset:g}, expected finite numbers'
            )
        if source.name in controlled and multiplier:
            mimics[joint.name] = Mimic(source.name, multiplier, offset)
            continue
        at = offset + multiplier * held.get(source.name, 0.0)
        if at:
            positions[joint.name] = at
        if source.name in wheels and multiplier:
            notes.append(
                f"'{joint.name}' mimics the wheel '{source.name}', which is not supported: it is"
                f' kept at {at:g} {_unit(joint)}'
            )
    return mimics, positions, notes


def _unit(joint: Joint) -> str:
    return 'm' if joint.kind == 'prismatic' else 'rad'


def _with_mimics(
    joint: Joint, moving: Sequence[Joint], mimics: Mapping[str, Mimic]
) -> tuple[Joint, list[str]]:
    """
    Return a controlled joint with limits and friction of its mimic joints, and notes.

    Its range is that in which all of them are in theirs, and its speed the largest with which
    none exceeds its own. The drive of the joint alone has an effort limit.
    """
    notes, damping, friction = [], joint.damping, joint.friction
    lower, upper = (joint.lower, joint.upper) if joint.lower < joint.upper else _ENDLESS
    speed = joint.speed or math.inf
    unit = _unit(joint)
    for other in moving:
        source, multiplier, offset = mimics.get(other.name, ('', 1.0, 0.0))
        if source != joint.name:
            continue
        size = abs(multiplier)
        damping += multiplier * multiplier * other.damping
        friction += size * other.friction
        about = f"mimic joint '{other.name}' limits '{joint.name}'"
        low, high = sorted((end - offset) / multiplier for end in (other.lower, other.upper))
        within = max(lower, low), min(upper, high)
        rounding = _ROUNDED * (high - low)
        if not low < high or math.isinf(high):
            pass  # without a range
        elif not within[0] + rounding < within[1]:
            notes.append(
                f"the range of mimic joint '{other.name}', {other.lower:g} to {other.upper:g}"
                f" {_unit(other)}, leaves none to '{joint.name}' and is ignored"
            )
        elif low > lower + rounding or high < upper - rounding:
            lower, upper = within
            notes.append(f'{about} to {lower:g} to {upper:g} {unit}')
        if other.speed and other.speed / size < speed * (1.0 - _ROUNDED):
            speed = other.speed / size
            notes.append(f'{about} to {speed:g} {unit}/s')
        effort = size * other.effort
        if effort and effort < (joint.effort or math.inf):
            notes.append(
                f"the effort limit of mimic joint '{other.name}', which the drive of"
                f" '{joint.name}' moves, is ignored"
            )
    if (lower, upper) == _ENDLESS:
        lower, upper = joint.lower, joint.upper
    if math.isinf(speed):
        speed = joint.speed
    return replace(
        joint, lower=lower, upper=upper, speed=speed, damping=damping, friction=friction
    ), notes


def _controlled(
    description: Description,
    where: str,
    wheels: Sequence[str],
    joints: Sequence[str],
    held: Mapping[str, float],
) -> set[str]:
    """Return the names of the controlled joints; raise InputError for an invalid choice."""
    for name in (*joints, *held):
        joint, is_held = description.joints[name], name in held
        position, lower, upper = held.get(name, 0.0), joint.lower, joint.upper
        for is_wrong, what in (
            (joint.kind == 'fixed', 'does not move'),
            (joint.mimics and not is_held, f"moves with '{joint.mimics}' (<mimic>)"),
            (name in wheels, 'is a wheel'),
            (name in joints and is_held, 'is held'),
            (
                is_held and lower < upper and not lower <= position <= upper,
                f'is held at {position}, expected {lower} to {upper}',
            ),
        ):
            if is_wrong:
                raise InputError(f"{where}, line {joint.line}: joint '{name}' {what}")
    return set(joints) or {
        name
        for name, joint in description.joints.items()
        if joint.kind != 'fixed' and not joint.mimics and name not in {*wheels, *held}
    }


def _merged(
    description: Description,
    controlled: set[str],
    mimics: Mapping[str, Mimic],
    held: Mapping[str, float],
    base_frame: str,
    ranks: Mapping[str, int],
) -> tuple[
    list[LinkedBody],
    list[Joint],
    dict[str, Frame],
    tuple[list[int], list[Rotation], list[Vector]],
]:
    """
    Return bodies, their joints, frames of links, and placements.

    `ranks` orders the joints, but a joint always follows its parents.
    """
    below: dict[str, list[tuple[int, int, Joint]]] = {}
    for number, joint in enumerate(description.joints.values()):
        below.setdefault(joint.parent, []).append((ranks[joint.name], number, joint))
    root = description.root
    frames = {root: Frame(0)}
    bodies = [LinkedBody(root)]
    order: list[Joint] = []
    parents, rotations, offsets = [-1], [ROTATION], [VECTOR]
    waiting = list(below.get(root, ()))
    heapq.heapify(waiting)
    while waiting:
        *_, joint = heapq.heappop(waiting)
        above = frames[joint.parent]
        rotation = product(above.rotation, rotation_of(joint.origin))
        offset = add(above.offset, rotate(above.rotation, vector(joint.origin.offset)))
        if joint.name not in controlled and joint.kind != 'fixed':
            mimic = mimics.get(joint.name)
            angle = mimic.offset if mimic else held.get(joint.name, 0.0)
            if joint.kind == 'prismatic':
                offset = add(offset, rotate(rotation, scale(vector(joint.axis), angle)))
            else:
                rotation = product(rotation, turn(vector(joint.axis), *sin_cos(angle)))
        if joint.name in controlled or joint.name in mimics:
            frames[joint.child] = Frame(len(bodies))
            bodies.append(LinkedBody(joint.child))
            order.append(joint)
            parents.append(above.body)
            rotations.append(rotation)
            offsets.append(offset)
        else:
            frames[joint.child] = Frame(above.body, rotation, offset)
        for fixed_joint in below.get(joint.child, ()):
            heapq.heappush(waiting, fixed_joint)
    if base_frame:
        _rebase(description, base_frame, frames, (parents, rotations, offsets))
    for name, frame in frames.items():
        body, link = bodies[frame.body], description.links[name]
        body.inertial_parameters = with_link(
            body.inertial_parameters, link, frame.rotation, frame.offset
        )
    return bodies, order, frames, (parents, rotations, offsets)


def _rebase(
    description: Description,
    base_frame: str,
    frames: dict[str, Frame],
    tree: tuple[list[int], list[Rotation], list[Vector]],
) -> None:
    """Express the base body in the frame of one of its links."""
    if base_frame not in description.links:
        known = suggestion(base_frame, tuple(description.links))
        raise InputError(f"robot.base_frame: no link '{base_frame}'; {known}")
    chosen = frames[base_frame]
    if chosen.body != 0:
        raise InputError(f"robot.base_frame '{base_frame}' moves against '{description.root}'")
    parents, rotations, offsets = tree
    for number, parent in enumerate(parents):
        if parent == 0:
            placed = seen_from(chosen, rotations[number], offsets[number])
            rotations[number], offsets[number] = placed
    for name, frame in frames.items():
        if frame.body == 0:
            frames[name] = Frame(0, *seen_from(chosen, frame.rotation, frame.offset))


def _mount(
    description: Description,
    where: str,
    frames: Mapping[str, Frame],
    name: str,
    fixed: Mapping[str, float],
) -> Mount:
    """Return the mounting of a wheel on the base; joints in `fixed` steer no wheel."""
    joint = description.joints[name]
    frame, axis = frames[joint.child], vector(joint.axis)
    for is_wrong, what in (
        (joint.kind not in ('continuous', 'revolute'), f'is {joint.kind}: it is no wheel'),
        (bool(joint.mimics), f"moves with '{joint.mimics}': it is no wheel"),
        (
            bool(steering := _steering(description, joint, fixed)),
            f"is a wheel that joint '{steering}' steers (swerve or Ackermann), which is not"
            f' supported: {STEERED}; if the joint is fixed on the robot, robot.held_joints names'
            ' it',
        ),
        (frame.body != 0, 'moves against the base: it is no wheel'),
    ):
        if is_wrong:
            raise InputError(f"{where}, line {joint.line}: joint '{name}' {what}")
    inertia = about(axis, _wheel_moments(description, frames, joint.child))
    return Mount(joint, frame.offset, rotate(frame.rotation, axis), inertia)


def _steering(description: Description, wheel: Joint, fixed: Mapping[str, float]) -> str:
    """Return the name of a turning joint with a vertical axis that carries a wheel, or ''."""
    above = {joint.child: joint for joint in description.joints.values()}
    way, link = [], wheel.parent
    while link in above:
        way.append(above[link])
        link = way[-1].parent
    rotation = ROTATION
    for joint in reversed(way):
        rotation = product(rotation, joint_pose(joint, 0.0)[0])
        axis = rotate(rotation, vector(joint.axis))
        turns = joint.kind in ('continuous', 'revolute') and joint.name not in fixed
        if turns and abs(axis[2]) > _UPRIGHT:
            return joint.name
    return ''


def _wheel_moments(
    description: Description, frames: Mapping[str, Frame], wheel: str
) -> Moments:
    """Return the inertial parameters of a wheel with all links on it, in its frame."""
    total, own, links = link_moments(description.links[wheel]), frames[wheel], [wheel]
    for parent in links:
        for joint in description.joints.values():
            frame = frames[joint.child]
            # A controlled joint on a wheel moves another body, which counts as its own.
            if joint.parent == parent and frame.body == own.body:
                links.append(joint.child)
                placed = seen_from(own, frame.rotation, frame.offset)
                total = with_link(total, description.links[joint.child], *placed)
    return total
