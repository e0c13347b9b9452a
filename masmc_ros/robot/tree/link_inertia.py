# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Frames and inertial parameters of links, and their sums for bodies, with checks of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from masmc_ros.errors import InputError
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.robot.tree.spatial import (
    add,
    inner,
    MOMENTS,
    Moments,
    moments_in_parent,
    product,
    rotate,
    ROTATION,
    Rotation,
    scale,
    subtract,
    transpose,
    turn,
    VECTOR,
    Vector,
)
from masmc_ros.robot.urdf import Description, Joint, Link, Pose
import numpy as np
from numpy.typing import NDArray

_ROUNDED = 1.0e-9
"""Tolerance for a negative smallest second moment, relative to the second moments."""

_UNSEEN = 1.0e-6
"""
Size of an impossible inertia of a link without effect, relative to the second moments of its body.

Published descriptions contain such links on fixed and held joints; larger ones are notes.
"""


@dataclass(frozen=True)
class Frame:
    """
    Frame of a link on its body.

    Attributes
    ----------
    body
        Number of the body, 0 for the base.
    rotation, offset
        of the frame in the body's; offset in m.

    """

    body: int
    rotation: Rotation = ROTATION
    offset: Vector = VECTOR


@dataclass
class LinkedBody:
    """Sums of a body while links are merged into it."""

    link: str
    inertial_parameters: Moments = MOMENTS


def seen_from(frame: Frame, rotation: Rotation, offset: Vector) -> tuple[Rotation, Vector]:
    """Return a place on the body of a frame, in this frame."""
    back = transpose(frame.rotation)
    return product(back, rotation), rotate(back, subtract(offset, frame.offset))


def joint_pose(joint: Joint, at: float) -> tuple[Rotation, Vector]:
    """Return the pose of a joint's child in its parent's frame, at a position in rad or m."""
    rotation, offset = rotation_of(joint.origin), vector(joint.origin.offset)
    if joint.kind == 'prismatic':
        return rotation, add(offset, rotate(rotation, scale(vector(joint.axis), at)))
    if joint.kind != 'fixed':
        rotation = product(rotation, turn(vector(joint.axis), *sin_cos(at)))
    return rotation, offset


def vector(values: tuple[float, ...]) -> Vector:
    """Return three numbers of a description as a vector."""
    x, y, z = values
    return x, y, z


def rotation_of(pose: Pose) -> Rotation:
    """Return Rz(yaw) Ry(pitch) Rx(roll), or the rotation of the quaternion."""
    if pose.quaternion:
        x, y, z, w = pose.quaternion
        return (
            1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w),
            2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w),
            2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y),
        )  # fmt: skip
    roll, pitch, yaw = pose.angles
    about_z = turn((0.0, 0.0, 1.0), *sin_cos(yaw))
    about_y = turn((0.0, 1.0, 0.0), *sin_cos(pitch))
    about_x = turn((1.0, 0.0, 0.0), *sin_cos(roll))
    rotation: Rotation = product(product(about_z, about_y), about_x)
    return rotation


def link_moments(link: Link) -> Moments:
    """Return the inertial parameters of a link about the origin of its frame."""
    xx, xy, xz, yy, yz, zz = link.inertia
    half = (xx + yy + zz) / 2.0
    own = (link.mass, 0.0, 0.0, 0.0, half - xx, half - yy, half - zz, -xy, -yz, -xz)
    inertial_parameters: Moments = moments_in_parent(
        rotation_of(link.centre), vector(link.centre.offset), own
    )
    return inertial_parameters


def pseudo_inertia(inertial_parameters: Sequence[float]) -> NDArray[np.float64]:
    """Return the pseudo-inertia P (4 x 4) of inertial parameters (10)."""
    mass, x, y, z, xx, yy, zz, xy, yz, zx = inertial_parameters
    return np.array([[xx, xy, zx, x], [xy, yy, yz, y], [zx, yz, zz, z], [x, y, z, mass]])


def check_links(
    first: int,
    bodies: Sequence[LinkedBody],
    frames: Mapping[str, Frame],
    description: Description,
    where: str,
) -> list[str]:
    """
    Raise InputError for links whose inertia no body has; return notes of possible bodies.

    A link that is merged with others may violate the inequality of the moments of inertia, which
    is a note, but has no negative moment. Links of bodies before `first` are ignored.
    """
    notes = []
    merged = {frame.body for name, frame in frames.items() if name != bodies[frame.body].link}
    for name, frame in frames.items():
        link, body = description.links[name], bodies[frame.body]
        if frame.body < first or not (link.mass or any(link.inertia)):
            continue
        excess, what, expected = _excess(link)
        xx, yy, zz = body.inertial_parameters[4:7]
        total = xx + yy + zz
        # Flat bodies are valid, and decimals are rounded.
        if excess <= _ROUNDED * total:
            continue
        if frame.body not in merged or min(*link.inertia[::3], link.inertia[5]) < 0.0:
            raise InputError(f"{where}, line {link.line}: link '{name}' has {what}; {expected}")
        if not excess <= _UNSEEN * total:
            share = f'{100.0 * excess / total:.2g} % of those of its body'
            notes.append(f"link '{name}' has {what}, {share} '{body.link}'")
    return notes


def _excess(link: Link) -> tuple[float, str, str]:
    """Return the size in kg·m² of an inertia that no body has, its description and the remedy."""
    if not link.mass:
        largest = max(map(abs, link.inertia))
        return largest, 'mass 0 with a moment of inertia', 'expected a mass > 0, or no inertia'
    least = _least(link_moments(link))
    return (
        -least,
        f'an inertia that no body has: the least second moment of its mass is {least:.3g} kg·m²',
        'expected >= 0 (no moment of inertia exceeds the sum of the other two)',
    )


def check_moments(bodies: Sequence[LinkedBody], description: Description, where: str) -> None:
    """Raise InputError for bodies that cannot exist, with the name of the link."""
    for body in bodies:
        if not any(body.inertial_parameters):
            continue
        least = _least(body.inertial_parameters)
        xx, yy, zz = body.inertial_parameters[4:7]
        if not least >= -_ROUNDED * (xx + yy + zz):
            link = description.links[body.link]
            raise InputError(
                f"{where}, line {link.line}: link '{link.name}', with what is fixed to it, has an"
                f' inertia that no body has: the least second moment of its mass is {least:.3g}'
                ' kg·m², expected >= 0 (no moment of inertia exceeds the sum of the other two)'
            )


def _least(inertial_parameters: Moments) -> float:
    """Return the smallest eigenvalue of the second moments about the centre of mass, in kg·m²."""
    mass = inertial_parameters[0]
    if mass <= 0.0:
        return -np.inf
    p = pseudo_inertia(inertial_parameters)
    central = p[:3, :3] - np.outer(p[:3, 3], p[:3, 3]) / mass
    return float(np.linalg.eigvalsh(central)[0])


def with_link(total: Moments, link: Link, rotation: Rotation, offset: Vector) -> Moments:
    """Return inertial parameters with those of a link at a place."""
    moved = moments_in_parent(rotation, offset, link_moments(link))
    return cast(Moments, tuple(a + b for a, b in zip(total, moved, strict=True)))


def about(axis: Vector, inertial_parameters: Moments) -> float:
    """Return the moment of inertia about an axis through a link's origin, in kg·m²."""
    xx, yy, zz, xy, yz, zx = inertial_parameters[4:]
    along = (
        xx * axis[0] + xy * axis[1] + zx * axis[2],
        xy * axis[0] + yy * axis[1] + yz * axis[2],
        zx * axis[0] + yz * axis[1] + zz * axis[2],
    )
    return float(xx + yy + zz - inner(axis, along))
