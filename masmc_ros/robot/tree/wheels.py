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
from dataclasses import dataclass
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
    Wheels that drive a base: two of a differential one, three or more of an omnidirectional one.

    With nu the base's rates, u and omega or u, v and omega, in m/s and rad/s: rates of the
    wheels = `matrix` nu, nu = `inverse` rates; forces on nu = `matrix`' torques, and `inverse`'
    forces are the torques of minimum norm for them.

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

    """

    joints: tuple[Joint, ...]
    radius: float
    matrix: NDArray[np.float64]
    inverse: NDArray[np.float64]
    spin: NDArray[np.float64]

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


def driving_wheels(
    base: int,
    mounts: Sequence[Mount],
    where: str,
    radius: float = 0.0,
    roller_angles: Sequence[float] = (),
) -> Wheels:
    """
    Return the wheels of these mountings.

    Parameters
    ----------
    base
        DIFFERENTIAL, which needs a right and a left wheel, or OMNIDIRECTIONAL.
    mounts
        Mountings of the wheels.
    where
        Source of the description, for messages.
    radius
        in m; 0 for the height of the axles above the base's frame.
    roller_angles
        of each wheel, in rad: from the rolling direction to the axis of the roller on the
        ground, counter-clockwise as seen from above; empty for 0 of all.

    Raises
    ------
    InputError
        If the wheels cannot drive such a base.

    """
    names = [mount.joint.name for mount in mounts]
    if roller_angles and (base == DIFFERENTIAL or len(roller_angles) != len(mounts)):
        raise InputError(
            f'robot.roller_angles {list(roller_angles)}: expected one for each of robot.wheels'
            f' {names} of an omnidirectional base, or none'
        )
    for mount in mounts:
        x, y, z = mount.axle
        if abs(z) > _TOLERANCE or (base == DIFFERENTIAL and abs(x) > _TOLERANCE):
            expected = "the base's y" if base == DIFFERENTIAL else 'the ground'
            raise InputError(
                f"{where}, line {mount.joint.line}: joint '{mount.joint.name}' is no wheel of"
                f' such a base: its axle is along {tuple(round(part, 3) for part in mount.axle)},'
                f' expected parallel to {expected}'
            )
        if abs(mount.centre[2] - mounts[0].centre[2]) > _TOLERANCE:
            raise InputError(
                f"{where}, line {mount.joint.line}: joint '{mount.joint.name}': wheels at heights"
                f' {[wheel.centre[2] for wheel in mounts]} m, expected equal ones'
            )
    if base == DIFFERENTIAL:
        (x, y, _), (x_left, y_left, _) = right, left = [mount.centre for mount in mounts]
        if abs(x) + abs(x_left) + abs(y + y_left) > _TOLERANCE or y >= 0.0:
            raise InputError(
                f'{where}: wheels at {right} and {left}; expected the base frame in the middle'
                ' between them, the right one at negative y; if it is elsewhere, add a link there'
                ' by a fixed joint, and name it in robot.base_frame'
            )
    height = mounts[0].centre[2]
    missing = ''
    if radius <= 0.0 and height <= 0.0:
        missing = (
            f'robot.wheel_radius: the axles are {height} m above the base frame, which is not on'
            ' the ground; expected the radius in m'
        )
    radius = radius if radius > 0.0 else height or 1.0
    matrix = np.array(
        [
            _row(mount, _slope(angle), radius)
            for mount, angle in zip(mounts, roller_angles or [0.0] * len(mounts), strict=True)
        ]
    )
    if base == DIFFERENTIAL:
        matrix = np.ascontiguousarray(matrix[:, ::2])
    try:
        inverse = _inverse(matrix, f'robot.wheels {names}')
    except InputError as error:
        place = where if missing else f'{where}, line {mounts[0].joint.line}'
        missing = '; '.join(filter(None, (missing, str(error))))
        raise InputError(f'{place}: {missing}') from None
    if missing:
        raise InputError(f'{where}: {missing}')
    return Wheels(
        tuple(mount.joint for mount in mounts),
        radius,
        matrix,
        inverse,
        np.array([mount.spin for mount in mounts]),
    )


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
    _map(model, values, transposed, not transposed)


@formula
def into_wheels(model: TreeModel, values: Array, transposed: bool) -> None:
    """Map the base's part of a vector to the wheels' rates, or to torques by the inverse's."""
    _map(model, values, transposed, transposed)


@kernel
def _map(model: TreeModel, values: Array, transposed: bool, by_base_rates: bool) -> None:
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
