# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Declaration of a mechanism: everything except its formulas, for code without a compiler.

The whole interface is in `mechanism.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
import hashlib
from importlib import import_module
from importlib.util import find_spec
import math
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Literal, NamedTuple

from masmc_ros.aliases import Array, Flags, Numbers
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import MutableValues, Parameter
import numpy as np

ODOM_FRAME = 'odom'
"""World frame of the odometry."""
BASE_FRAME = 'base_link'
"""Frame of the base; `base_motion` of the mechanism's module has its motion."""


URDF = 'robot.urdf'
"""Parameter of every node that needs the robot; a URDF replaces the built-in types."""

SPEED_LIMITS = Parameter(
    'robot.speed_limits',
    (),
    'Speed limits of joints in rad/s or m/s, each as a name and a number, such as '
    '[arm_joint_1 2.0]; they replace those of the URDF; 0: no limit',
)
"""Parameter of every node that needs the robot, for all types of robots."""


class Coordinate(NamedTuple):
    """Position of a joint, with the name of the joint in a joint state."""

    name: str
    short: str
    """In descriptions of parameters."""
    label: str
    """In legends."""
    unit: str = 'rad'
    """m or rad."""

    @property
    def effort_unit(self) -> str:
        """Return the unit of its force or torque."""
        return 'N' if self.unit == 'm' else 'N·m'


class Quantity(NamedTuple):
    """Name and unit of a task axis, a base inertial parameter or a commanded velocity."""

    name: str
    """Such as x_E or yaw_inertia; words are joined by underscores."""
    unit: str
    symbol: str = ''
    """Symbol in legends, with a subscript after _; empty for the name."""

    @property
    def html(self) -> str:
        """Return the symbol with its subscript, as pages show it."""
        base, _, index = (self.symbol or self.name).partition('_')
        return f'{base}<sub>{index}</sub>' if index else base


class Velocity(NamedTuple):
    """Velocity of the base in commands on cmd_vel."""

    name: str
    unit: str
    place: int
    """Among the six numbers of a twist: linear x, y, z, then angular."""


class Point(NamedTuple):
    """
    Group of neighbouring task axes of one unit, for reports.

    Usually it is a point that follows a path: its axes are x and y, and z in space. The points of
    a mechanism contain every task axis once.
    """

    symbol: str
    key: str
    """In names of files, figures and metrics."""
    name: str
    title: str
    """As titles call it."""
    first: int
    """Index of the task axis of its x, or of the first of its axes."""
    size: int = 2
    """Number of its axes."""
    unit: str = 'm'
    """m or rad."""
    is_place: bool = True
    """True if they are x and y, or x, y and z, which give a path to draw."""
    is_rotation: bool = False
    """True if they are the rotation of a frame, whose errors are sines of angles."""

    @property
    def axes(self) -> slice:
        """Return the slice of its axes in a vector of task axes."""
        return slice(self.first, self.first + self.size)

    @property
    def plane(self) -> slice:
        """Return the slice of x and y of a place in a vector of task axes."""
        return slice(self.first, self.first + 2)

    @property
    def small_unit(self) -> str:
        """Return the unit of errors in tables: mm for m, mrad for rad."""
        return f'm{self.unit}'


def symbols_of(points: Iterable[Point]) -> str:
    """Return the symbols of points as a text lists them."""
    return listed([point.symbol for point in points])


def units_of(points: Iterable[Point]) -> tuple[str, ...]:
    """Return the units of points, each once."""
    return tuple(dict.fromkeys(point.unit for point in points))


def listed(names: Sequence[str]) -> str:
    """Return names as a text lists them: A, B and C."""
    first, last = names[:-1], ''.join(names[-1:])
    return f'{", ".join(first)} and {last}' if first else last


class Group(NamedTuple):
    """Group of neighbouring joints, for reports."""

    name: str
    first: int
    end: int

    @property
    def joints(self) -> slice:
        """Return the slice of its joints in a vector of joints."""
        return slice(self.first, self.end)


def limited_speeds(
    speeds: Array, joints: Sequence[Coordinate], settings: Sequence[str]
) -> Array:
    """
    Return the speed limits of the joints, with those that settings replace.

    Parameters
    ----------
    speeds
        Limits (joints) in rad/s or m/s, infinite without a limit; they are not modified.
    joints
        Joints, in the order of `speeds`.
    settings
        Values of SPEED_LIMITS, each a name and a number, such as `arm_joint_1 2.0`; 0 removes the
        limit of a joint.

    Raises
    ------
    InputError
        if a setting is not the name of a joint and a speed >= 0, or if it repeats a joint.

    """
    names = [joint.name for joint in joints]
    speed_limits, named = speeds.copy(), set()
    # A ROS parameter file writes an empty list as one empty string.
    for setting in filter(str.strip, settings):
        name, _, text = setting.strip().partition(' ')
        if name not in names:
            raise InputError(
                f"{SPEED_LIMITS.name}: no joint '{name}'; expected a name and a speed, such as "
                f"'{names[-1]} 2.0', the name one of {', '.join(names)}"
            )
        try:
            speed = float(text)
        except ValueError:
            speed = math.nan
        if not 0.0 <= speed < math.inf or name in named:
            again = ' again' if name in named else ''
            raise InputError(
                f"{SPEED_LIMITS.name}: '{setting}'{again}: expected each joint once, as its name "
                f"and a speed >= 0, such as '{name} 2.0'; 0 is no limit"
            )
        named.add(name)
        speed_limits[names.index(name)] = speed or math.inf
    return speed_limits


class Shape(NamedTuple):
    """Part of a drawing in top view."""

    kind: Literal['body', 'part', 'links']
    """Pale area, dark area, or lines from joint to joint."""
    points: Array
    """Corners or joints (n, 2) in the world, m."""


class Outline(NamedTuple):
    """Drawing of a robot in top view, to scale."""

    origin: tuple[float, float]
    """Of `base_link`, m."""
    shapes: tuple[Shape, ...]
    below: float
    """Lowest drawn height below the origin in m."""
    text: float
    """Height to leave for a text there, m."""


@dataclass(frozen=True, eq=False)
class Mechanism:
    """
    Type of robot.

    Attributes
    ----------
    name
        Value of `robot.mechanism`.
    base
        Coordinates of the base pose; x, y and yaw if `is_planar`.
    joints
        Actuated joints. With commanded rates, `twist` commands the first ones, and the others
        have separate rates.
    axes
        Task axes.
    theta
        Base inertial parameters.
    twist
        Velocities of the base with commanded rates.
    points
        Points of reports, which contain every task axis once; places have a drawn path.
    groups
        Groups of joints in figures.
    frames
        Parent and child of every transform, parents first: from ODOM_FRAME to BASE_FRAME, and
        last the frame of the first point, unless `point_frame` names it.
    parameters : sequence
        Parameters of the robot, with the prefix `robot.`.
    law_parameters : sequence
        Additional parameters of the controller for every law.
    point_frame
        Child frame of the first point; empty for that of the last transform.
    lengths
        Names of its constant lengths, the fields of `MODEL`.
    module
        Full name of the module with the formulas.
    defaults
        Nonzero defaults of parameters by name: `initial_pose`, `torque_limit`, ...
    start_names
        Names of the entries of `initial_pose`; empty for those of the base.
    fixed_joints
        Names of fixed joints, which no other joint may have.
    origin
        Description of `base_link` in texts.
    lost
        Part of the robot that can be singular, in texts.
    singular
        Condition of the singularity, in texts.
    is_planar
        True if odometry can replace the base positions.
    speed_settings
        Checked values of SPEED_LIMITS.
    carrier
        Point of the base that carries the arm, if it is in the task and can move in any direction
        at once. A path may leave it out (`reference/following_base.py`); the module then has
        `comfortable_reach`.
    notes
        Parts of the description of the robot that the model does not follow, a sentence each.

    """

    name: str
    base: tuple[Coordinate, ...]
    joints: tuple[Coordinate, ...]
    axes: tuple[Quantity, ...]
    theta: tuple[Quantity, ...]
    twist: tuple[Velocity, ...]
    points: tuple[Point, ...]
    groups: tuple[Group, ...]
    frames: tuple[tuple[str, str], ...]
    parameters: tuple[Parameter, ...]
    lengths: tuple[str, ...]
    module: str
    law_parameters: tuple[Parameter, ...] = ()
    point_frame: str = ''
    defaults: Mapping[str, Numbers] = field(default_factory=dict)
    start_names: tuple[str, ...] = ()
    fixed_joints: tuple[str, ...] = ()
    origin: str = 'base'
    lost: str = 'the robot'
    singular: str = 'its task cannot be inverted'
    is_planar: bool = False
    speed_settings: tuple[str, ...] = ()
    carrier: Point | None = None
    notes: tuple[str, ...] = ()

    @property
    def choice(self) -> MutableValues:
        """Return the parameter values that select this type of robot, also in another process."""
        chosen: MutableValues = {'robot.mechanism': self.name}
        if self.speed_settings:
            chosen[SPEED_LIMITS.name] = self.speed_settings
        return chosen

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Return the numbers of components by the size names of records, such as `joints`."""
        return {
            'axes': len(self.axes),
            'joints': len(self.joints),
            'base': len(self.base),
            'positions': len(self.base) + len(self.joints),
            'parameters': len(self.theta),
            'lengths': len(self.lengths),
            'desired': 3 * len(self.axes),
        }

    @property
    def positions(self) -> tuple[Coordinate, ...]:
        """Return the coordinates in the order of a joint state."""
        return self.base + self.joints

    @property
    def own_rates(self) -> tuple[Coordinate, ...]:
        """Return the joints with separate velocity commands, all that `twist` does not command."""
        return self.joints[len(self.twist):]

    @property
    def entries(self) -> dict[str, str]:
        """Return texts on the entries of array parameters by size name, for descriptions."""
        return {
            'axes': f'per task axis {", ".join(axis.name for axis in self.axes)}',
            'joints': f'on {self.joint_list}',
            'parameters': 'per base inertial parameter',
        }

    @property
    def joint_list(self) -> str:
        """Return the names of the joints for descriptions of parameters."""
        return ', '.join(joint.short for joint in self.joints)

    @property
    def places(self) -> tuple[Point, ...]:
        """Return the points with a path to draw."""
        return tuple(point for point in self.points if point.is_place)

    @property
    def group_of_joints(self) -> tuple[int, ...]:
        """Return the group number of each joint; joints without a group have the next number."""
        groups = [len(self.groups)] * len(self.joints)
        for number, group in enumerate(self.groups):
            groups[group.joints] = [number] * (group.end - group.first)
        return tuple(groups)

    @property
    def joint_limits(self) -> Mapping[str, Array]:
        """
        Return the limits of the joints, (joints) each: `lower`, `upper` and `speed`, SI units.

        Limits that no joint has are missing; others are infinite for joints without a limit.
        """
        if not self.speed_settings:
            return {}
        speeds = np.full(len(self.joints), math.inf)
        return {'speed': limited_speeds(speeds, self.joints, self.speed_settings)}

    @cached_property
    def speed_limits(self) -> Numbers:
        """Return the largest speed of each joint in rad/s or m/s; infinite without a limit."""
        return self._limit('speed', math.inf)

    @cached_property
    def position_limits(self) -> tuple[tuple[float, float], ...]:
        """Return the ends of each joint's range in rad or m; infinite without a limit."""
        lower, upper = self._limit('lower', -math.inf), self._limit('upper', math.inf)
        return tuple(zip(lower, upper, strict=True))

    @property
    def sharing_drives(self) -> tuple[str, ...]:
        """Return the drives that share the torques of the base; none if the joints drive it."""
        return ()

    def shared_torques(self, torques: Array) -> Array:
        """Return the torques (n, drives) of `sharing_drives` for those (n, joints)."""
        return torques[:, :0]

    def at_range_ends(self, position: Array) -> Flags:
        """
        Return True for the joints that stop at the ends of their ranges.

        Parameters
        ----------
        position
            Positions (n, joints) in rad or m.

        Returns
        -------
            (n, joints); always False for types of robots whose motion ignores the ranges.

        """
        return np.zeros(position.shape, dtype=np.bool_)

    def range_ends_text(self, at_end: Flags) -> str:
        """Return a text on the joints (joints) at the ends of their ranges."""
        names = [joint.name for joint, is_at_end in zip(self.joints, at_end, strict=True)
                 if is_at_end]  # fmt: skip
        place = 'ends of their ranges' if len(names) > 1 else 'end of its range'
        return f'{listed(names)} at the {place}'

    def details(self, start: Array) -> Mapping[str, Any]:
        """Return further facts about the robot at a start (joints), by keys of `masmc robot`."""
        return {}

    def start_warnings(self, start: Array, torque_limits: Sequence[float]) -> list[str]:
        """
        Return a text for each reason why a run from a start fails or is inaccurate.

        Parameters
        ----------
        start
            Positions of the joints (joints) in rad or m.
        torque_limits
            Limits of the joints in N·m or N; 0: no limit.

        """
        outside = [
            joint.name
            for joint, at, (lower, upper) in zip(
                self.joints, start, self.position_limits, strict=True
            )
            if not lower <= at <= upper
        ]
        return [f'outside of its limits at the start: {", ".join(outside)}'] if outside else []

    def _limit(self, name: str, otherwise: float) -> Numbers:
        """Return a limit of every joint; `otherwise` for all if no joint has one."""
        limit = self.joint_limits.get(name)
        return (otherwise,) * len(self.joints) if limit is None else tuple(limit.tolist())

    @cached_property
    def tag(self) -> str:
        """Return the tag of the compiled code: the name, and a digest of a plug-in."""
        spec = find_spec(self.module)
        if spec is None or spec.origin is None:
            raise ImportError(f'{self.module}: no such module')
        path = Path(spec.origin)
        if path.is_relative_to(Path(__file__).parent):
            return self.name
        sources = sorted(path.parent.glob('*.py')) if spec.parent else [path]
        digest = hashlib.sha256(b''.join(source.read_bytes() for source in sources))
        return f'{self.name} {digest.hexdigest()[:12]}'

    @cached_property
    def formulas(self) -> ModuleType | SimpleNamespace:
        """Return the module with the formulas, imported on demand."""
        return import_module(self.module)

    def default(self, parameter: str, size: str, otherwise: float = 0.0) -> Numbers:
        """
        Return the default of an array parameter, one number per entry.

        Parameters
        ----------
        parameter
            Name of the parameter.
        size
            Size name of its entries, a key of `sizes`.
        otherwise
            Value of every entry if the mechanism does not declare a default.

        """
        return self.defaults.get(parameter, (otherwise,) * self.sizes[size])


_KNOWN: dict[str, Mechanism] = {}
"""Mechanisms by tag."""


def check_points(mechanism: Mechanism) -> None:
    """Raise InputError unless the points contain every task axis once, each in its unit."""
    points, start = mechanism.points, f'robot.mechanism = {mechanism.name}'
    for number, axis in enumerate(mechanism.axes):
        owners = [point for point in points if point.axes.start <= number < point.axes.stop]
        if len(owners) != 1:
            raise InputError(
                f'{start}: {len(owners)} of its points contain the task axis {axis.name}; '
                'expected one, so reports evaluate each axis once'
            )
        if owners[0].unit != axis.unit:
            raise InputError(
                f'{start}: its point {owners[0].name} in {owners[0].unit} contains the task axis '
                f'{axis.name} in {axis.unit}; expected a point for each unit'
            )
    for point in points:
        if point.is_place and point.size not in (2, 3):
            raise InputError(
                f'{start}: its point {point.name} is a place with {point.size} axes; expected x '
                'and y, or x, y and z'
            )


def register(mechanism: Mechanism) -> Mechanism:
    """
    Register a mechanism by its tag, and return it.

    Compiled code then finds its formulas by the tag of a record or the class of its lengths. A
    mechanism with the same tag is replaced.
    """
    _KNOWN[mechanism.tag] = mechanism
    return mechanism


def formulas_of_tag(tag: str) -> ModuleType | SimpleNamespace:
    """Return the module with the formulas of a registered mechanism; KeyError if there is none."""
    return _KNOWN[tag].formulas


def formulas_of_model(model: type) -> ModuleType | SimpleNamespace:
    """Return the module with the formulas whose `MODEL` is the class of a tuple of lengths."""
    return next(
        mechanism.formulas for mechanism in _KNOWN.values() if mechanism.formulas.MODEL is model
    )


MOST_ESTIMATES = 12
"""Largest number of estimates in one plot; of more, the masses are shown."""

MASS = '_mass'
"""End of the names of the masses of bodies."""


def shown_parameters(theta: Sequence[Quantity]) -> list[int]:
    """Return the indices of the parameters to plot: all, or the masses of many bodies."""
    return [
        i
        for i, parameter in enumerate(theta)
        if len(theta) <= MOST_ESTIMATES or parameter.name.endswith(MASS)
    ]
