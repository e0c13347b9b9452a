# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanism of a robot described by a URDF: parameters, names, frames and drawing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import copyreg
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import count
from types import SimpleNamespace
from typing import Any
import xml.etree.ElementTree as ElementTree

from masmc_ros.aliases import Array, Flags
from masmc_ros.errors import InputError, suggestion
from masmc_ros.jit.record import AT_RUN_TIME
from masmc_ros.params.declaration import MutableValues, Parameter, Value, Values
from masmc_ros.robot.declaration import (
    Coordinate,
    Group,
    limited_speeds,
    Mechanism,
    ODOM_FRAME,
    Outline,
    Quantity,
    register,
    Shape,
    SPEED_LIMITS,
    URDF,
    Velocity,
)
from masmc_ros.robot.packages import resource_path
from masmc_ros.robot.tree import formulas as kernels
from masmc_ros.robot.tree.assembly import BASES, tree_robot, TreeRobot, with_axle
from masmc_ros.robot.tree.following import comfortable_reach, Followed, followed_base, Trail
from masmc_ros.robot.tree.frames import (
    BASE,
    Frames,
    pose,
    SLIDES,
    STANDS,
    transforms,
    TURNS,
    world_of,
)
from masmc_ros.robot.tree.link_inertia import joint_pose, pseudo_inertia
from masmc_ros.robot.tree.postures import (
    gravity_torques,
    largest_gravity_torques,
    least_pivot,
    placed,
    reach,
    task_jacobian,
)
from masmc_ros.robot.tree.spatial import PER_BODY, rotate, transpose
from masmc_ros.robot.tree.task.outputs import Task, task_of, TaskRobot
from masmc_ros.robot.tree.task.task import POSE
from masmc_ros.robot.tree.tree_model import MOST_COORDINATES, packed
from masmc_ros.robot.tree.tree_parameters import (
    ARMATURE,
    BASE_FRAME,
    BASE_MOBILITY,
    BASE_TYPE,
    DAMPING,
    DRIFT_RATE,
    FRICTION,
    FRICTIONLESS,
    HELD_JOINTS,
    HELD_POSITIONS,
    JOINTS,
    LEAST_PIVOT,
    LIMIT_MARGIN,
    PARAMETERS,
    POSTURE,
    POSTURE_GAIN,
    ROLLER_ANGLES,
    TASK,
    TIP_FRAME,
    TRACK_FACTOR,
    WHEEL_RADIUS,
    WHEELS,
)
from masmc_ros.robot.urdf import Description, Joint, read_urdf, read_urdf_file, urdf_text
import numpy as np

NAME = 'tree'
"""Name of the mechanism."""

SPEED_SHARE = 0.9
"""Share of a joint's speed limit available to v_r; the rest is for the difference v - v_r."""

_DESCRIBING: tuple[Parameter, ...] = (*PARAMETERS, SPEED_LIMITS)

_LAW_PARAMETERS = (
    Parameter(
        'adaptation',
        'natural',
        'Adaptation of the inertial parameters: physically consistent bodies, or independent '
        'numbers',
        choices=kernels.ADAPTATIONS,
        read_only=False,
    ),
)

_POSE = (
    Coordinate('base_x_joint', 'x', 'x', 'm'),
    Coordinate('base_y_joint', 'y', 'y', 'm'),
    Coordinate('base_yaw_joint', 'yaw', 'yaw'),
)

_AHEAD = Velocity('forward speed', 'm/s', 0)
_ASIDE = Velocity('sideways speed', 'm/s', 1)
_AROUND = Velocity('yaw rate', 'rad/s', 5)
_TWISTS = {'fixed': (), 'differential': (_AHEAD, _AROUND),
           'omnidirectional': (_AHEAD, _ASIDE, _AROUND)}  # fmt: skip

_DRIVES = {
    'fixed': (),
    'differential': (),
    'omnidirectional': (
        Coordinate('base_forward_joint', 'forward', 'forward', 'm'),
        Coordinate('base_sideways_joint', 'sideways', 'sideways', 'm'),
        Coordinate('base_turn_joint', 'turn', 'turn'),
    ),
}
"""Coordinates with forces on a base without wheels."""

_MOMENTS = (
    ('mass', 'kg'), ('mx', 'kg·m'), ('my', 'kg·m'), ('mz', 'kg·m'), ('mxx', 'kg·m²'),
    ('myy', 'kg·m²'), ('mzz', 'kg·m²'), ('mxy', 'kg·m²'), ('myz', 'kg·m²'), ('mzx', 'kg·m²'),
)  # fmt: skip
"""Moments of a body, in the order of `spatial`."""


_FRICTION = (('viscous', 'N·m·s', 'N·s/m'), ('coulomb', 'N·m', 'N'))
"""Types of friction, and their units for revolute and prismatic joints."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TreeMechanism(Mechanism):
    """Mechanism of a URDF."""

    robot: TreeRobot
    model: Array
    """Numbers for the formulas: see `tree_model.py`."""
    description: Description
    text: str
    """The URDF."""
    friction: Array
    """Coefficients of all joints, viscous ones first; none without friction."""
    task: Task
    followed: Followed | None
    """Base that follows the end effector, if it has axes in the task."""
    tips: tuple[str, ...]
    """Links of the task; the tip of the robot for tasks of joints."""
    held: Mapping[str, float]
    """Positions of the held joints by name."""
    made_of: Values
    """Values of the parameters that describe it."""

    @property
    def choice(self) -> MutableValues:
        """Return the parameter values that select it, also in another process."""
        return dict(self.made_of)

    @property
    def joint_limits(self) -> Mapping[str, Array]:
        """
        Return the limits of the joints: those of the URDF, speeds also by `robot.speed_limits`.

        They are infinite without a limit. A speed of 0 in a URDF is an unknown limit.
        """
        limits = self.robot.limits
        # The coordinates of a base without wheels are actuated and are no joints of the URDF.
        free = len(self.joints) - len(limits.lower)
        return {
            'lower': np.concatenate([np.full(free, -np.inf), limits.lower]),
            'upper': np.concatenate([np.full(free, np.inf), limits.upper]),
            'speed': _speed_limits(self.robot, self.joints, self.speed_settings),
        }

    @property
    def sharing_drives(self) -> tuple[str, ...]:
        """Return the drives that share the torques of the base; none if the joints drive it."""
        wheels = self.robot.wheels
        if wheels is None or len(wheels.joints) <= self.robot.tree.base:
            return ()
        return tuple(joint.name for joint in wheels.joints)

    def shared_torques(self, torques: Array) -> Array:
        """Return the torques (n, drives) of `sharing_drives` for those (n, joints)."""
        base, wheels = self.robot.tree.base, self.robot.wheels
        return torques[:, :0] if wheels is None else wheels.wheel_torques(torques[:, :base])

    def at_range_ends(self, position: Array) -> Flags:
        """Return True (n, joints) for joints whose mobility is below `robot.least_pivot`."""
        limits, values = self.joint_limits, self.made_of
        d, has_margin = _inside(limits, values, position)
        share = np.minimum(1.0, limits['speed']**2) * (d * d * (3.0 - 2.0 * d))
        stops: Flags = has_margin & (d < 1.0) & (share <= LEAST_PIVOT.of(values))
        return stops

    def least_pivots(self, position: Array) -> Array:
        """Return the measure of singularity (n) of the task at positions (n, joints)."""
        arm = position[:, -len(self.robot.joints):]
        speeds = self.joint_limits['speed'][-len(self.robot.joints):]
        frames = [self.robot.frames[link] for link in self.task.frames]
        columns = task_jacobian(
            self.robot, placed(self.robot, arm), frames, self.task.places
        )
        return least_pivot(columns, mobility(self.robot, self.made_of, arm, speeds))

    def details(self, start: Array) -> Mapping[str, Any]:
        """Return tip, joints that are not controlled, friction, mass, reach and gravity."""
        robot, arm = self.robot, start[-len(self.robot.joints):]
        controlled = {joint.name for joint in self.joints}
        followers = {} if robot.wheels is None else robot.wheels.followers
        wheels = set() if robot.wheels is None else {joint.name for joint in robot.wheels.joints}
        others = [
            joint
            for joint in self.description.joints.values()
            if joint.kind != 'fixed' and joint.name not in controlled | wheels
        ]
        held = [
            {
                'name': joint.name,
                'unit': 'm' if joint.kind == 'prismatic' else 'rad',
                'position': self.held.get(joint.name, 0.0),
                # On the robot such joints, of castors for example, turn freely.
                'is_free': joint.kind == 'continuous' and not 0.0 < joint.effort < np.inf,
            }
            for joint in others
            if not joint.mimics
        ]
        gravity = gravity_torques(robot, placed(robot, arm[None]))[0]
        largest = np.maximum(np.abs(gravity), largest_gravity_torques(robot, arm))
        no_drives = [None] * (len(self.joints) - len(arm))
        return {
            'tip': self.tips[0],
            'held': held,
            'mimic': [
                {'name': joint.name, 'mimics': joint.mimics, 'multiplier': joint.multiplier,
                 'offset': joint.mimic_offset}
                for joint in others if joint.mimics
            ] + [
                {'name': name, 'mimics': drive, 'multiplier': multiplier, 'offset': offset}
                for name, (drive, multiplier, offset) in followers.items()
            ],
            'friction': FRICTION.of(self.made_of),
            'total_mass': float(robot.inertial_parameters[:, 0].sum()),
            'reach': reach(robot, self.tips[0], arm),
            'gravity': [*no_drives, *gravity.tolist()],
            'largest_gravity': [*no_drives, *largest.tolist()],
        }  # fmt: skip

    def start_warnings(self, start: Array, torque_limits: Sequence[float]) -> list[str]:
        """Return warnings of ranges, of a singular task, and of limits below gravity."""
        texts = super().start_warnings(start, torque_limits)
        count = len(self.robot.joints)
        torques = gravity_torques(self.robot, placed(self.robot, start[None, -count:]))[0]
        weak = [
            f'{joint.name} needs {abs(torque):.3g} {joint.effort_unit}, limit {limit:g}'
            f' {joint.effort_unit}'
            for joint, torque, limit in zip(
                self.joints[-count:], torques, torque_limits[-count:], strict=True
            )
            if 0.0 < limit < abs(torque)
        ]
        if weak:
            texts.append(f'limit below gravity at the start: {"; ".join(weak)}')
        is_at_end = self.at_range_ends(start[None])[0]
        if self.task.frames and not texts and not is_at_end.any():
            pivot = float(self.least_pivots(start[None])[0])
            if not pivot > LEAST_PIVOT.of(self.made_of):
                texts.append(
                    f'the start is singular for the task: its smallest pivot is {pivot:.2g},'
                    f' expected more than robot.least_pivot = '
                    f'{LEAST_PIVOT.of(self.made_of):g}; choose another plant.initial_joints'
                    ' or robot.task'
                )
        return texts

    @cached_property
    def tag(self) -> str:
        """Return the tag of the compiled code, which is that of all trees."""
        return self.name

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Return the numbers of components, which compiled code reads at run time."""
        return {**super().sizes, AT_RUN_TIME: 1}

    @cached_property
    def formulas(self) -> SimpleNamespace:
        """Return the formulas of all trees, and the functions for names and URDF of this one."""
        own = {
            name: getattr(self, f'_{name}')
            for name in (
                'constants', 'start', 'out_of_reach', 'base_motion', 'frame_origins',
                'frame_transforms', 'description', 'outline', 'payload_factors', 'tip_on_link',
                *(('comfortable_reach', 'base_axes') if self.followed else ()),
            )
        }  # fmt: skip
        return SimpleNamespace(**{**vars(kernels), **own})

    def _constants(self, values: Values) -> tuple[Array, Array]:
        """Return the model as one vector, and theta: inertial parameters, then friction."""
        return self.model, np.concatenate([self.robot.inertial_parameters.ravel(), self.friction])

    def _payload_factors(self, lengths: Array) -> Array:
        """Return the changes (p, 10) of theta by the moments of a payload on the tip's body."""
        body = self.robot.frames[self.tips[0]].body
        factors = np.zeros((len(self.theta), PER_BODY))
        factors[PER_BODY * body:PER_BODY * (body + 1)] = np.eye(PER_BODY)
        return factors

    def _tip_on_link(self, lengths: Array) -> tuple[Array, Array]:
        """Return rotation (3, 3) and origin (3) in m of the tip's frame in that of its body."""
        frame = self.robot.frames[self.tips[0]]
        return np.reshape(frame.rotation, (3, 3)), np.array(frame.offset)

    def _start(
        self, values: Values, pose: tuple[float, ...], angles: tuple[float, ...]
    ) -> tuple[float, ...]:
        return (*pose, *angles)

    def _out_of_reach(self, lengths: Array, task: Array) -> None:
        """Return None: an unreachable position is followed as far as the arm reaches."""

    def _base_motion(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Return poses and twists of the base."""
        pose, twist = np.zeros((len(position), 7)), np.zeros((len(position), 6))
        yaw = position[:, 2]
        pose[:, :2] = position[:, :2]
        pose[:, 5], pose[:, 6] = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
        s, c = np.sin(yaw), np.cos(yaw)
        twist[:, 0] = velocity[:, 0] * c + velocity[:, 1] * s
        if self.robot.tree.base == BASES['omnidirectional']:
            twist[:, 1] = velocity[:, 1] * c - velocity[:, 0] * s
        twist[:, 5] = velocity[:, 2]
        return pose, twist

    @cached_property
    def _reach(self) -> tuple[float, float]:
        assert self.followed is not None
        speeds = self.joint_limits['speed'][-len(self.robot.joints):]
        rows = [place for place in self.task.places if place < POSE]
        return comfortable_reach(
            self.robot,
            self.followed,
            self.robot.frames[self.task.frames[0]],
            tuple(rows),
            _rest(self.robot, self.made_of),
            lambda arm: mobility(self.robot, self.made_of, arm, speeds),
        )

    def _comfortable_reach(self, lengths: Array) -> tuple[float, float]:
        """Return the least and largest comfortable distance in m from the carrier."""
        return self._reach

    def _base_axes(self, path: Array, before: Array | None, trail: Trail) -> Array:
        """Return the axes (n, size) of the base for a path (n, axes)."""
        assert self.followed is not None
        return self.followed.axes(path, before, trail, self._reach)

    @cached_property
    def frame_motion(self) -> Frames:
        """Poses of the frames, and the positions that move them."""
        places = {joint.name: len(self.base) + i for i, joint in enumerate(self.joints)}
        wheels = self.robot.wheels
        if wheels is not None and wheels.push_base:
            names = [joint.name for joint in wheels.joints]
            places |= dict(zip(names, count(len(self.base) + len(self.joints)), strict=False))
        mimics = {**self.robot.mimics, **(wheels.followers if wheels else {})}
        below = {joint.child: joint for joint in self.description.joints.values()}
        origin = np.zeros((len(self.frames), 7))
        origin[:, 6] = 1.0
        axis = np.zeros((len(self.frames), 3))
        motion = np.full(len(self.frames), STANDS)
        place = np.zeros(len(self.frames), np.int64)
        multiplier = np.ones(len(self.frames))
        motion[0] = BASE
        for i, (parent, child) in enumerate(self.frames[1:], 1):
            joint = below.get(child)
            if joint is None or joint.parent != parent:
                # The base is the child of the links above it in the file.
                joint = below[parent]
                rotation, offset = joint_pose(joint, self.held.get(joint.name, 0.0))
                back = transpose(rotation)
                origin[i] = pose(back, tuple(-value for value in rotate(back, offset)))
                continue
            source, multiplier[i], at = mimics.get(
                joint.name, (joint.name, 1.0, self.held.get(joint.name, 0.0))
            )
            origin[i] = pose(*joint_pose(joint, at))
            if source in places:
                axis[i], place[i] = joint.axis, places[source]
                motion[i] = SLIDES if joint.kind == 'prismatic' else TURNS
        return Frames(origin, axis, motion, place, multiplier)

    def _frame_origins(self, lengths: Array) -> Array:
        """Return the positions of the frames in their parents with all joints at zero."""
        return self.frame_motion.origin[:, :3]

    def _frame_transforms(self, origins: Array, position: Array) -> Array:
        wheels = self.robot.wheels
        if wheels is not None and wheels.push_base:
            first, size = len(self.base), self.robot.tree.base
            turned = wheels.rates_of(position[:, first:first + size])
            position = np.hstack([position, turned])
        frame_poses: Array = transforms(self.frame_motion, position)
        return frame_poses

    def _description(
        self, values: Values, driven: Sequence[str], frame_prefix: str
    ) -> str:
        """Return the URDF, with renamed joints and frames if requested."""
        own = [joint.name for joint in self.joints]
        names = {old: new for old, new in zip(own, driven, strict=True) if old != new}
        if not frame_prefix and not names:
            return self.text
        root = ElementTree.fromstring(self.text)
        for link in root.iter('link'):
            link.set('name', frame_prefix + link.get('name', ''))
        for joint in root.iter('joint'):
            name = joint.get('name', '')
            joint.set('name', names.get(name, name))
            for leader in joint.iter('mimic'):
                leader.set('joint', names.get(leader.get('joint', ''), leader.get('joint', '')))
            for end in (*joint.iter('parent'), *joint.iter('child')):
                end.set('link', frame_prefix + end.get('link', ''))
        return ElementTree.tostring(root, encoding='unicode', xml_declaration=True)

    def _outline(self, lengths: Array, position: Array) -> Outline:
        """Return the base and the bodies on the way to each tip, seen from above."""
        poses = self._frame_transforms(self.frame_motion.origin, position[None])[0]
        children = (child for _, child in self.frames)
        places = dict(zip(children, world_of(self.frames, poses), strict=True))
        r, origin = places[self.frames[0][1]]
        above = {child: parent for parent, child in self.frames}
        moving = {self.frames[i][1] for i in np.flatnonzero(self.frame_motion.motion)}
        ways = []
        for link in self.tips:
            way = [places[link][1][:2]]
            while link != self.frames[0][0]:
                if link in moving:
                    way.append(places[link][1][:2])
                link = above[link]
            ways.append(Shape('links', np.array(way[::-1])))
        corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * 0.2
        body = origin[:2] + corners @ r[:2, :2].T
        shapes = (Shape('body', body), *ways)
        return Outline((float(origin[0]), float(origin[1])), shapes, below=0.4, text=0.1)


def _pickled(
    mechanism: TreeMechanism,
) -> tuple[Callable[..., TreeMechanism], tuple[Values]]:
    return tree_mechanism, (mechanism.choice,)


copyreg.pickle(TreeMechanism, _pickled)


def _inside(limits: Mapping[str, Array], values: Values, position: Array) -> tuple[Array, Flags]:
    """Return distances of positions to the ends as shares of the margins, 0 to 1, and margins."""
    lower, upper = limits['lower'], limits['upper']
    with np.errstate(invalid='ignore'):
        margin = LIMIT_MARGIN.of(values) * (upper - lower)
    margin = np.where(np.isfinite(margin), margin, 0.0)
    inside = np.minimum(position - lower, upper - position) / np.where(margin, margin, 1.0)
    return np.where(margin > 0.0, np.clip(inside, 0.0, 1.0), 1.0), margin > 0.0


def mobility(
    robot: TreeRobot, values: Values, position: Array, speeds: Array | None = None
) -> Array:
    """
    Return W^-1 (m, velocities) at positions of the controlled joints, as laws use it.

    Parameters
    ----------
    robot
        Robot with its limits.
    values
        Values of PARAMETERS.
    position
        (m, joints) in rad or m.
    speeds
        Speed limits (joints) in rad/s or m/s; None for those of the URDF.

    """
    base, count = robot.tree.base, len(robot.joints)
    own = robot.limits.speed[-count:]
    speeds = np.where(own > 0.0, own, np.inf) if speeds is None else speeds
    ends = {'lower': robot.limits.lower[-count:], 'upper': robot.limits.upper[-count:]}
    d, _ = _inside(ends, values, position)
    shares = np.empty((len(position), base + count))
    shares[:, :base] = BASE_MOBILITY.of(values)
    shares[:, base:] = np.minimum(1.0, speeds**2) * (d * d * (3.0 - 2.0 * d))
    return shares


def _as_many(values: Sequence[float], count: int, name: str) -> Array:
    """Return one value per joint, from as many values or from one for all."""
    if len(values) not in (1, count):
        raise InputError(f'{name}: {len(values)} numbers; expected 1 or {count}, one a joint')
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (count,))


def described(urdf: str) -> tuple[str, Description, str]:
    """Return text, description and name of a URDF, from a path or a text."""
    if urdf.lstrip().startswith('<'):
        return urdf, read_urdf(urdf, 'robot_description'), 'robot_description'
    path = resource_path(urdf)
    description = read_urdf_file(path)
    return urdf_text(path), description, str(path)


def tree_mechanism(values: Values) -> TreeMechanism:
    """
    Return the mechanism of values of URDF and PARAMETERS, checked or not.

    Raises InputError if they do not describe a robot.
    """
    own = tuple(p.check(p.or_default(values)) for p in _DESCRIBING)
    return _made(values[URDF], own, _version_of(values[URDF]))


def _version_of(urdf: str) -> tuple[int, ...]:
    """Return numbers of the file of a URDF that change with the file or its content."""
    if urdf.lstrip().startswith('<'):
        return ()
    try:
        status = resource_path(urdf).stat()
    except OSError:
        return ()
    return status.st_dev, status.st_ino, status.st_mtime_ns, status.st_size


@lru_cache(maxsize=16)
def _made(urdf: str, own: tuple[Value, ...], version: tuple[int, ...]) -> TreeMechanism:
    values: MutableValues = {p.name: value for p, value in zip(_DESCRIBING, own, strict=True)}
    text, description, where = described(urdf)
    names, wheels = HELD_JOINTS.of(values), WHEELS.of(values)
    angles = _as_many(HELD_POSITIONS.of(values), len(names), 'robot.held_positions')
    held = dict(zip(names, angles.tolist(), strict=True))
    if len(held) < len(names):
        raise InputError(f'robot.held_joints {list(names)}: expected different names')
    rollers = _as_many(ROLLER_ANGLES.of(values), len(wheels), 'robot.roller_angles')
    robot = tree_robot(
        description,
        where,
        base=BASE_TYPE.of(values),
        base_frame=BASE_FRAME.of(values),
        wheels=wheels,
        wheel_radius=WHEEL_RADIUS.of(values),
        roller_angles=rollers.tolist() if rollers.any() else (),
        joints=JOINTS.of(values),
        held=held,
        armature=ARMATURE.of(values),
        track_factor=TRACK_FACTOR.of(values),
    )
    if robot.axle is not None and robot.base_frame not in description.links:
        description, text = with_axle(description, robot.axle), _with_axle(text, robot.axle)
    if not robot.joints:
        raise InputError(f'{where}: no joint that can be controlled; expected one at least')
    _check_masses(robot, where)
    if not ARMATURE.of(values):
        _check_inertia(robot, where)
    _check_reserved(description, where)
    base, root = BASE_TYPE.of(values), robot.base_frame
    tip = _tip(robot, values)
    driven = () if robot.wheels is None else robot.wheels.drives
    drives = tuple(Coordinate(j.name, j.name, j.name) for j in driven) or _DRIVES[base]
    arm = _coordinates(robot)
    task = task_in(robot, values, TASK.of(values))
    bodies = [root, *(j.child for j in robot.moving)]
    limited = _speed_limits(robot, (*drives, *arm), SPEED_LIMITS.of(values))
    model = _model(robot, task, values, limited)
    followed = followed_base(robot, task, _rest(robot, values))
    joints = len(drives) + len(arm)
    if len(_POSE) + joints > MOST_COORDINATES:
        raise InputError(
            f'{where}: {joints} joints; expected up to {MOST_COORDINATES - len(_POSE)}: name those'
            ' to be controlled in robot.joints'
        )
    tips = task.frames or (tip,)
    efforts = robot.limits.effort
    limits = np.zeros(joints)
    limits[joints - len(efforts):] = np.where(np.isfinite(efforts), efforts, 0.0)
    friction = _friction(robot, values, joints)
    coefficients = tuple(
        Quantity(f'{joint.name}_{name}', along if joint.unit == 'm' else around)
        for name, around, along in (_FRICTION if len(friction) else ())
        for joint in (*drives, *arm)
    )
    mechanism = TreeMechanism(
        name=NAME,
        base=_POSE,
        joints=(*drives, *arm),
        axes=task.axes,
        theta=tuple(
            Quantity(f'{body}_{name}', unit) for body in bodies for name, unit in _MOMENTS
        )
        + coefficients,
        twist=_TWISTS[base],
        points=task.points,
        groups=(
            *((Group('base', 0, len(drives)),) if drives else ()),
            Group('arm', len(drives), joints),
        ),
        frames=_pairs(description, root),
        point_frame=tips[0],
        parameters=PARAMETERS,
        law_parameters=_LAW_PARAMETERS,
        lengths=tuple(map(str, range(len(model)))),
        model=model,
        module=kernels.__name__,
        defaults={
            'torque_limit': tuple(limits.tolist()),
            'initial_pose': (0.0, 0.0, 0.0),
            'line_sine.offset': task.positions_in(_rest(robot, values).tolist()),
        },
        origin='origin of the base',
        singular='its least pivot is below robot.least_pivot',
        is_planar=base != 'fixed',
        speed_settings=SPEED_LIMITS.of(values),
        robot=robot,
        description=description,
        text=text,
        friction=friction,
        task=task,
        followed=followed,
        carrier=None if followed is None else followed.carrier,
        tips=tips,
        held=robot.held,
        notes=robot.notes,
        made_of={URDF: urdf, **values},
    )
    register(mechanism)
    return mechanism


def _with_axle(text: str, axle: Joint) -> str:
    """Return a URDF with a fixed joint and its child, a link without inertia."""
    root = ElementTree.fromstring(text)
    ElementTree.SubElement(root, 'link', name=axle.child)
    joint = ElementTree.SubElement(root, 'joint', name=axle.name, type='fixed')
    ElementTree.SubElement(joint, 'parent', link=axle.parent)
    ElementTree.SubElement(joint, 'child', link=axle.child)
    place = ' '.join(map(repr, axle.origin.offset))
    ElementTree.SubElement(joint, 'origin', xyz=place, rpy='0 0 0')
    return ElementTree.tostring(root, encoding='unicode', xml_declaration=True)


def _tip(robot: TreeRobot, values: Values) -> str:
    """Return the link of the tip; InputError for an unknown name."""
    tip = TIP_FRAME.of(values) or robot.joints[-1].child
    if tip not in robot.frames:
        raise InputError(
            f"robot.tip_frame: no link '{tip}'; {suggestion(tip, tuple(robot.frames))}"
        )
    return tip


def _coordinates(robot: TreeRobot) -> tuple[Coordinate, ...]:
    """Return the controlled joints, without wheels."""
    return tuple(
        Coordinate(j.name, j.name, j.name, 'm' if j.kind == 'prismatic' else 'rad')
        for j in robot.joints
    )


def task_in(robot: TreeRobot, values: Values, texts: Sequence[str]) -> Task:
    """Return the task of outputs `texts` for values of PARAMETERS; may raise InputError."""
    goes_sideways = BASE_TYPE.of(values) != 'differential'
    arm, tip = _coordinates(robot), _tip(robot, values)
    links = tuple(robot.frames)
    return task_of(texts, TaskRobot(links, arm, tip, robot.base_frame, goes_sideways))


def _check_masses(robot: TreeRobot, where: str) -> None:
    """Raise InputError if no moving body has a mass."""
    moving = robot.inertial_parameters[robot.tree.base == BASES['fixed']:]
    if not moving[:, 0].any():
        raise InputError(
            f'{where}: no link that moves has a mass; expected an <inertial> in the links of'
            f" joint '{robot.joints[0].name}' and of those after it"
        )


def _check_reserved(description: Description, where: str) -> None:
    """Raise InputError for movable joints with the names of the coordinates of a base."""
    reserved = {joint.name for joint in (*_POSE, *_DRIVES['omnidirectional'])}
    for joint in description.joints.values():
        if joint.name in reserved and joint.kind != 'fixed':
            raise InputError(
                f"{where}, line {joint.line}: joint '{joint.name}': this name is reserved for"
                ' the base; rename the joint in the URDF'
            )


def _check_inertia(robot: TreeRobot, where: str) -> None:
    """Raise InputError if a joint that moves only ends of branches moves no inertia."""
    moves_inertia = set()
    for number, joint in enumerate(robot.moving, 1):
        p, axis = pseudo_inertia(robot.inertial_parameters[number]), np.array(joint.axis)
        around = np.trace(p[:3, :3]) - axis @ p[:3, :3] @ axis
        own = p[3, 3] if joint.kind == 'prismatic' else around
        if own > 0.0 or number in robot.tree.parent:
            moves_inertia.add(robot.tree.driver[number])
    for number, joint in enumerate(robot.joints):
        if number not in moves_inertia:
            raise InputError(
                f"{where}, line {joint.line}: joint '{joint.name}': the links that it moves have"
                ' no inertia, expected an <inertial> or robot.armature > 0'
            )


def _rest(robot: TreeRobot, values: Values) -> Array:
    """Return the posture of the joints."""
    return _as_many(POSTURE.of(values), len(robot.joints), 'robot.posture')


def _speed_limits(
    robot: TreeRobot, joints: Sequence[Coordinate], settings: Sequence[str]
) -> Array:
    """Return the speed limits of the joints: of the parameter, otherwise of the URDF."""
    own = robot.limits.speed
    speeds = np.full(len(joints), np.inf)
    speeds[len(joints) - len(own):] = np.where(own > 0.0, own, np.inf)
    return limited_speeds(speeds, joints, settings)


def _model(
    robot: TreeRobot, task: Task, values: Values, speed_limits: Array
) -> Array:
    """Return the model as one vector."""
    base = robot.tree.base
    # Joints with a low speed limit, such as a lift, contribute less to the task.
    mobility = np.minimum(1.0, speed_limits**2)
    mobility[:base] = BASE_MOBILITY.of(values)
    frames = [robot.frames[link] for link in task.frames]
    return packed(
        robot.tree,
        np.eye(base) if robot.wheels is None else robot.wheels.drive_matrix,
        [(frame.body, frame.rotation, frame.offset) for frame in frames],
        task.places,
        mobility,
        np.concatenate([np.zeros(base), _rest(robot, values)]),
        _limits(robot, LIMIT_MARGIN.of(values)),
        POSTURE_GAIN.of(values),
        DAMPING.of(values),
        LEAST_PIVOT.of(values),
        SPEED_SHARE * speed_limits,
        DRIFT_RATE.of(values),
    )


def _friction(robot: TreeRobot, values: Values, joints: int) -> Array:
    """Return the coefficients of friction of all joints, viscous ones first, or none."""
    kind = FRICTION.of(values)
    if kind == FRICTIONLESS:
        return np.zeros(0)
    coefficients = np.zeros((2, joints))
    if kind == 'urdf':
        own = (*(robot.wheels.drives if robot.wheels else ()), *robot.joints)
        if robot.wheels is not None and robot.wheels.push_base:
            coefficients[:, :robot.tree.base] = robot.wheels.base_friction
        coefficients[0, joints - len(own):] = [joint.damping for joint in own]
        coefficients[1, joints - len(own):] = [joint.friction for joint in own]
    else:
        for row, (name, _, _) in zip(coefficients, _FRICTION, strict=True):
            row[:] = _as_many(values[f'robot.{name}_friction'], joints, f'robot.{name}_friction')
    return coefficients.ravel()


def _limits(robot: TreeRobot, margin: float) -> tuple[Array, Array, Array]:
    """Return lower and upper ends of all velocities' positions, and the margins before them."""
    base, joints = robot.tree.base, len(robot.joints)
    limits = np.zeros((3, base + joints))
    ends = [end[-joints:] for end in (robot.limits.lower, robot.limits.upper)]
    limits[:2, base:] = np.where(np.isfinite(ends).all(axis=0), ends, 0.0)
    limits[2] = margin * (limits[1] - limits[0])
    return limits[0], limits[1], limits[2]


def _pairs(description: Description, base: str) -> tuple[tuple[str, str], ...]:
    """Return parent and child of every transform, parents first."""
    pairs = [(joint.parent, joint.child) for joint in description.joints.values()]
    # Links above the base are its children, because the base moves in the world.
    above = {child: parent for parent, child in pairs}
    link, turned = base, set()
    while link in above:
        turned.add((above[link], link))
        link = above[link]
    pairs = [(c, p) if (p, c) in turned else (p, c) for p, c in pairs]
    ordered, known = [(ODOM_FRAME, base)], {base}
    while pairs:
        ready = [pair for pair in pairs if pair[0] in known]
        ordered += ready
        known |= {child for _, child in ready}
        pairs = [pair for pair in pairs if pair not in ready]
    return tuple(ordered)
