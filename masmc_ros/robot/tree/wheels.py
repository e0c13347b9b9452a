# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Wheels that drive a base: linear map between wheel rates and base velocities.

At the ground a wheel's rim moves against the base's frame by -r rate f, with f the rolling
direction. The contact does not slip along a. For a plain wheel, and for rollers perpendicular to
the axle, a is f; for a mecanum wheel it is the axis of the roller on the ground. The rate is
v . a / (r f . a), with the velocity v of the wheel's centre (Muir and Neuman 1987; Campion,
Bastin and d'Andrea-Novel 1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.numerics.elimination import factor, solve
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.tree.spatial import Vector
from masmc_ros.robot.tree.tree_model import (
    base_of,
    base_rates_begin,
    DIFFERENTIAL,
    FIXED,
    TreeModel,
    wheel_rates_begin,
)
from masmc_ros.robot.urdf import Joint
import numpy as np
from numpy.typing import NDArray

_TOLERANCE = 1.0e-3
"""Tolerance of wheels: sine of an angle, or distance in m."""

_PROJECTIONS, _EXCESS = 200, 1.0e-9
"""Largest number of projections for torques inside of limits, and their tolerance in N·m."""

_WAYS = ('ahead', 'sideways', 'around')


class Mount(NamedTuple):
    """Mounting of a wheel in the frame of the base."""

    joint: Joint
    """Joint of the wheel."""
    centre: Vector
    """In m."""
    axle: Vector
    """Unit vector of positive rotation."""
    spin: float
    """Moment of inertia about the axle, in kg·m²."""


@dataclass(frozen=True)
class Wheels:
    """
    Wheels that drive a base.

    A differential base has two, or four or more if it is skid-steer; an omnidirectional one has
    three or more. With nu the base's rates, u and omega or u, v and omega, in m/s and rad/s:
    rates of the wheels = `matrix` nu, nu = `inverse` rates; forces on nu = `matrix`' torques, and
    `inverse`' forces are the torques of minimum norm for them.

    Attributes
    ----------
    joints
        Joints of the wheels: right and left, or in the order of their names.
    radius
        in m.
    matrix
        (N, rates) in rad/m and 1.
    inverse
        (rates, N), by least squares if there are more wheels than rates.
    spin
        (N) moments of inertia about the axles, in kg·m².
    sides
        Of a skid-steer base, the numbers of the wheels on the right and on the left; they turn
        like the first one of their side.

    """

    joints: tuple[Joint, ...]
    radius: float
    matrix: NDArray[np.float64]
    inverse: NDArray[np.float64]
    spin: NDArray[np.float64]
    sides: tuple[tuple[int, ...], ...] = ()

    @property
    def push_base(self) -> bool:
        """True for an omnidirectional base with more wheels than rates: its rates are driven."""
        return not self.sides and len(self.joints) > self.matrix.shape[1]

    @property
    def drives(self) -> tuple[Joint, ...]:
        """
        Joints of the wheels as drives: each one, or the first of each side for all of its side.

        The limits of effort and the friction of a side are sums, its speed is the smallest. There
        are none if the wheels `push_base`.
        """
        if self.push_base:
            return ()
        return tuple(self._side(side) for side in self.sides) or self.joints

    @property
    def drive_matrix(self) -> NDArray[np.float64]:
        """Rates of the drives per base rate, in rad/m and 1."""
        if self.push_base:
            return np.eye(self.matrix.shape[1])
        return self.matrix[[side[0] for side in self.sides]] if self.sides else self.matrix

    @property
    def base_limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """
        Largest speeds and forces (rates) of the base whose combinations all wheels allow.

        Each is the share 1 / rates of the one that the wheels allow alone.
        """
        rates = self.matrix.shape[1]
        speeds, efforts = (
            np.array([value or math.inf for value in (getattr(j, name) for j in self.joints)])
            for name in ('speed', 'effort')
        )
        speed, force = (
            (limits[:, None] / (rates * np.maximum(np.abs(parts), _TOLERANCE**3))).min(axis=0)
            for limits, parts in ((speeds, self.matrix), (efforts, self._weighted))
        )
        return speed, force

    @property
    def base_friction(self) -> NDArray[np.float64]:
        """Viscous and Coulomb friction (2, rates) of the wheels in each rate of the base alone."""
        damping = np.array([joint.damping for joint in self.joints])
        friction = np.array([joint.friction for joint in self.joints])
        size = np.abs(self.matrix)
        return np.array([(size**2 * damping[:, None]).sum(0), (size * friction[:, None]).sum(0)])

    @cached_property
    def _weighted(self) -> NDArray[np.float64]:
        """
        Torques (N, rates) per force on the base, W G (G' W G)^-1 with W = limits^2.

        They have the smallest sum of squares of torques relative to the limits.
        """
        efforts = np.array([joint.effort for joint in self.joints])
        if not self._has_limits(range(len(efforts))):
            efforts = np.ones(len(efforts))
        weighted = efforts[:, None] * self.matrix
        return efforts[:, None] * _inverse(weighted, 'robot.wheels').T

    @cached_property
    def _limits(self) -> NDArray[np.float64]:
        """Limits (N) of the torques in N·m, infinite without one."""
        return np.array([joint.effort or math.inf for joint in self.joints])

    def rates_of(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates (n, N) of all wheels for rates (n, rates) of the base."""
        return _products(self.matrix, motion)

    def wheel_torques(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Return the torques of all wheels for those of the drives, or for forces on the base.

        Those of an omnidirectional base have the smallest sum of squares relative to the limits.
        If one of them exceeds its limit, the torques without a force on the base shift them: of
        four wheels to the nearest torques inside of the limits. With more wheels, projections
        onto the limits and onto the torques with these forces alternate (in that norm), which
        converges if torques inside of the limits have these forces. The result never exceeds the
        limits.

        Parameters
        ----------
        forces
            (n, drives) in N·m, or (n, rates) in N and N·m.

        Returns
        -------
            (n, N) in N·m.

        """
        if not self.push_base:
            return _products(self._shares, forces)
        limits = self._limits
        torques = _products(self._weighted, forces)
        if len(limits) == self.matrix.shape[1] + 1:
            idle = self._idle
            moving = idle != 0.0
            ends = (limits * [[-1.0], [1.0]] - torques[:, None])[..., moving] / idle[moving]
            lower, upper = ends.min(axis=1).max(axis=1), ends.max(axis=1).min(axis=1)
            # Without torques inside of the limits, the middle has the smallest excess.
            shift = np.where(lower <= upper, np.clip(0.0, lower, upper), 0.5 * (lower + upper))
            torques = torques + np.nan_to_num(shift)[:, None] * idle
            return np.clip(torques, -limits, limits)
        inside = np.clip(torques, -limits, limits)
        for _ in range(_PROJECTIONS):
            beyond = np.flatnonzero((np.abs(torques - inside) > _EXCESS).any(axis=1))
            if not len(beyond):
                break
            missing = forces[beyond] - _products(self.matrix.T, inside[beyond])
            torques[beyond] = inside[beyond] + _products(self._weighted, missing)
            inside[beyond] = np.clip(torques[beyond], -limits, limits)
        return inside

    @cached_property
    def _idle(self) -> NDArray[np.float64]:
        """Torques of one wheel more than rates, three, that have no force: G' idle = 0."""
        minors = [np.delete(self.matrix, wheel, axis=0) for wheel in range(len(self.joints))]
        signs = np.array([1.0, -1.0, 1.0, -1.0])
        idle = signs * [a @ np.cross(b, c) for a, b, c in minors]
        largest: float = np.abs(idle).max()
        return np.where(np.abs(idle) > _TOLERANCE**2 * largest, idle / largest, 0.0)

    @property
    def followers(self) -> dict[str, tuple[str, float, float]]:
        """Drive, rate per rate of the drive, and offset 0 of each other wheel, by name."""
        return {
            self.joints[wheel].name: (self.joints[first].name, self._direction(wheel, first), 0.0)
            for first, *others in self.sides
            for wheel in others
        }

    @cached_property
    def _shares(self) -> NDArray[np.float64]:
        """
        Torques (N, drives) of the wheels per torque of the drives.

        The wheels of a side have shares in proportion to their limits of effort, or equal shares
        if one of them has no limit.
        """
        if not self.sides:
            return np.eye(len(self.joints))
        torques = np.zeros((len(self.joints), len(self.sides)))
        for drive, side in enumerate(self.sides):
            efforts = np.array([self.joints[wheel].effort for wheel in side])
            if not self._has_limits(side):
                efforts = np.ones(len(side))
            directions = np.array([self._direction(wheel, side[0]) for wheel in side])
            torques[list(side), drive] = directions * efforts / efforts.sum()
        return torques

    def _direction(self, wheel: int, first: int) -> float:
        return math.copysign(1.0, self.matrix[wheel, 0] * self.matrix[first, 0])

    def _has_limits(self, side: Sequence[int]) -> bool:
        return all(0.0 < self.joints[wheel].effort < math.inf for wheel in side)

    def _side(self, side: Sequence[int]) -> Joint:
        joints = [self.joints[wheel] for wheel in side]
        effort, damping, friction = np.array([
            (joint.effort, joint.damping, joint.friction) for joint in joints
        ]).sum(axis=0).tolist()  # fmt: skip
        return replace(
            joints[0],
            effort=effort if self._has_limits(side) else math.inf,
            speed=min((joint.speed for joint in joints if joint.speed), default=math.inf),
            damping=damping,
            friction=friction,
        )

    def inertia(self, armature: float) -> NDArray[np.float64]:
        """
        Return the inertia of the spinning wheels in the base's rates.

        Parameters
        ----------
        armature
            inertia of each wheel's rotor, seen from the wheel, in kg·m².

        Returns
        -------
            (rates, rates) in kg, kg·m and kg·m².

        """
        return _squares(self.matrix, self.spin + armature)


def middle_of(mounts: Sequence[Mount], where: str) -> tuple[float, float]:
    """
    Return x and y in m between the wheels of a differential base; 0 within a tolerance.

    Parameters
    ----------
    mounts
        Mountings of right and left wheel, or of all wheels of a skid-steer base.
    where
        Source of the description, for messages.

    Raises
    ------
    InputError
        If the wheels are on no axle, or if there are not as many on both sides.

    """
    centres = np.array([mount.centre for mount in mounts])
    x, y = float(centres[:, 0].mean()), float(0.5 * (centres[:, 1].min() + centres[:, 1].max()))
    ends = centres[:, 1] - y
    half = np.abs(ends).max()
    if len(mounts) == 2 and (ends[0] >= 0.0 or abs(np.diff(centres[:, 0])[0]) > _TOLERANCE):
        right, left = (mount.centre for mount in mounts)
        raise InputError(
            f'{where}: wheels at {right} and {left}; expected both on one axle, the right one'
            ' first, at the smaller y'
        )
    if (
        (ends < 0.0).sum() * 2 != len(mounts)
        or (half - np.abs(ends) > _TOLERANCE).any()
        or half <= _TOLERANCE
    ):
        raise InputError(
            f'{where}: wheels at {[mount.centre for mount in mounts]}; expected as many on the'
            ' right as on the left, all at the same distance from the middle'
        )
    spread = abs(x) + (abs(2.0 * y) if len(mounts) > 2 else 0.0)
    if len(mounts) == 2:
        (x_right, y_right, _), (x_left, y_left, _) = (mount.centre for mount in mounts)
        spread = abs(x_right) + abs(x_left) + abs(y_right + y_left)
    return (x, y) if spread > _TOLERANCE else (0.0, 0.0)


def driving_wheels(
    base: int,
    mounts: Sequence[Mount],
    where: str,
    radius: float = 0.0,
    roller_angles: Sequence[float] = (),
    track_factor: float = 1.0,
) -> Wheels:
    """
    Return the wheels of these mountings.

    Parameters
    ----------
    base
        DIFFERENTIAL, which needs a right and a left wheel or all wheels of a skid-steer base
        around the frame of the base, or OMNIDIRECTIONAL.
    mounts
        Mountings of the wheels.
    where
        Source of the description, for messages.
    radius
        in m; 0 for the height of the axles above the base's frame.
    roller_angles
        of each wheel, in rad: from the rolling direction to the axis of the roller on the
        ground, counter-clockwise as seen from above; empty for 0 of all.
    track_factor
        Effective track of a skid-steer base, relative to the distance of its wheels.

    Raises
    ------
    InputError
        If the wheels cannot drive such a base. One message has all reasons.

    """
    names = [mount.joint.name for mount in mounts]
    if roller_angles and (base == DIFFERENTIAL or len(roller_angles) != len(mounts)):
        raise InputError(
            f'robot.roller_angles {list(roller_angles)}: expected one for each of robot.wheels'
            f' {names} of an omnidirectional base, or none'
        )
    problems = _of_mounting(base, mounts)
    height = mounts[0].centre[2]
    if radius <= 0.0 and height <= 0.0:
        problems.append((
            0,
            f'robot.wheel_radius: the axles are {height} m above the base frame, which is not on'
            ' the ground; expected the radius in m',
        ))
    radius = radius if radius > 0.0 else height or 1.0
    matrix = np.array(
        [
            _row(mount, _slope(angle), radius)
            for mount, angle in zip(mounts, roller_angles or [0.0] * len(mounts), strict=True)
        ]
    )
    sides: tuple[tuple[int, ...], ...] = ()
    if base == DIFFERENTIAL:
        matrix = np.ascontiguousarray(matrix[:, ::2])
        if len(mounts) > 2:
            right = [mount.centre[1] < 0.0 for mount in mounts]
            sides = tuple(
                tuple(i for i, is_right in enumerate(right) if is_right is side)
                for side in (True, False)
            )
            matrix[:, 1] *= track_factor
            for first, *others in sides:
                for wheel in others:
                    # Wheels of one side turn together.
                    same = math.copysign(1.0, matrix[wheel, 0] * matrix[first, 0])
                    matrix[wheel] = same * matrix[first]
    try:
        inverse = _inverse(matrix, f'robot.wheels {names}')
    except InputError as error:
        problems.append((0 if problems else mounts[0].joint.line, str(error)))
    if problems:
        line = problems[0][0]
        place = f'{where}, line {line}' if line else where
        raise InputError(f'{place}: {"; ".join(text for _, text in problems)}')
    return Wheels(
        tuple(mount.joint for mount in mounts),
        radius,
        matrix,
        inverse,
        np.array([mount.spin for mount in mounts]),
        sides,
    )


def _of_mounting(base: int, mounts: Sequence[Mount]) -> list[tuple[int, str]]:
    """Return line and description of each wheel with an impossible axle or height."""
    problems = []
    for mount in mounts:
        x, _, z = mount.axle
        line, joint = mount.joint.line, f"joint '{mount.joint.name}'"
        if abs(z) > _TOLERANCE or (base == DIFFERENTIAL and abs(x) > _TOLERANCE):
            expected = "the base's y" if base == DIFFERENTIAL else 'the ground'
            problems.append((
                line,
                f'{joint} is no wheel of such a base: its axle is along'
                f' {tuple(round(part, 3) for part in mount.axle)}, expected parallel to'
                f' {expected}',
            ))
        if abs(mount.centre[2] - mounts[0].centre[2]) > _TOLERANCE:
            heights = [wheel.centre[2] for wheel in mounts]
            problems.append((
                line, f'{joint}: wheels at heights {heights} m, expected equal ones'
            ))  # fmt: skip
    return problems


def _slope(roller_angle: float) -> float:
    """Return the tangent of a roller's angle."""
    if not abs(roller_angle) < math.pi / 2.0 - _TOLERANCE:
        raise InputError(
            f'robot.roller_angles: {roller_angle}, expected less than pi / 2 = 1.5708 rad'
        )
    sine, cosine = sin_cos(roller_angle)
    return float(sine / cosine)


def _row(mount: Mount, slope: float, radius: float) -> tuple[float, float, float]:
    """Return the rate of a wheel per u, v and omega."""
    x, y, _ = mount.centre
    along_x, along_y, _ = mount.axle
    # The direction that does not slip: f + tan(angle) axle, with f = axle x up.
    ahead, left = along_y + slope * along_x, slope * along_y - along_x
    return ahead / radius, left / radius, (x * left - y * ahead) / radius


def _products(matrix: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrix (m, k) times each row (n, k), bitwise identical for one row and for many."""
    return np.asarray((matrix * rows[:, None, :]).sum(axis=2))


def _squares(matrix: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return G' diag(weights) G, exactly symmetric and bitwise identical on every machine."""
    products = matrix[:, :, None] * matrix[:, None, :]
    return np.asarray((products * weights[:, None, None]).sum(axis=0))


def _inverse(matrix: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Return (G'G)^-1 G'."""
    wheels, rates = matrix.shape
    squares = _squares(matrix, np.ones(wheels))
    factored = squares.copy()
    factor(factored)
    largest = squares.diagonal().max()
    for rate in range(rates):
        # Relative part of its column that is independent of the others; wheels in one place
        # cannot turn a base.
        own = squares[rate, rate]
        if not (factored[rate, rate] > _TOLERANCE**2 * own > _TOLERANCE**4 * largest):
            raise InputError(
                f'{what} cannot drive the base {_WAYS[rate]} by itself; expected axles, places or'
                ' robot.roller_angles that differ more'
            )
    inverse = np.empty((rates, wheels))
    for wheel in range(wheels):
        row = matrix[wheel].copy()
        solve(factored, row)
        inverse[:, wheel] = row
    return inverse


@formula
def into_base(model: TreeModel, values: Array, transposed: bool) -> None:
    """Map the base's part of a vector from the wheels' rates, or from torques by the inverse's."""
    _map(model, values, bool(transposed), not transposed)


@formula
def into_wheels(model: TreeModel, values: Array, transposed: bool) -> None:
    """Map the base's part of a vector to the wheels' rates, or to torques by the inverse's."""
    _map(model, values, bool(transposed), bool(transposed))


@kernel
def _map(model: TreeModel, values: Array, transposed: bool, by_base_rates: bool) -> None:
    # Callers convert constants by `bool`: the function would be compiled for each combination.
    base = base_of(model)
    if base == FIXED:
        return
    first = base_rates_begin(model) if by_base_rates else wheel_rates_begin(model)
    before = values[0], values[1], values[base - 1]
    along, across = (1, base) if transposed else (base, 1)
    for i in range(base):
        at = first + i * along
        total = model.numbers[at] * before[0]
        total += model.numbers[at + across] * before[1]
        if base > 2:
            total += model.numbers[at + 2 * across] * before[2]
        values[i] = total
