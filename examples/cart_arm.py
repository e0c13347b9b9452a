# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Cart on a rail with an arm of one link: the smallest robot with a base, an arm and a path.

A motor with a pulley (radius r) pulls the cart along x; a second motor turns the arm (length L),
which lies in the horizontal plane. Its velocities are those of cart and arm, (u, w), the forces
conjugate to them (f_u, f_w). M is the mass that moves along the rail, including the equivalent
mass of the motor's rotor. With p the arm's first moment, i its inertia about the joint, and
angle a,

    H = [[M, -p sin a], [-p sin a, i]],   V = [[0, -p w cos a], [0, 0]].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import formula
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import (
    BASE_FRAME,
    Coordinate,
    Group,
    Mechanism,
    ODOM_FRAME,
    Outline,
    Point,
    Quantity,
    Shape,
    Velocity,
)
from masmc_ros.robot.shared_formulas import (
    joint_accelerations,
    motion_error,
    preserves_consistency,
    reference_motion,
    task_error,
    task_inertia,
    theta_step,
    tracking,
)
import numpy as np
from numpy.typing import NDArray

__all__ = [
    'joint_accelerations',
    'motion_error',
    'preserves_consistency',
    'reference_motion',
    'task_error',
    'task_inertia',
    'theta_step',
    'tracking',
]

Array = NDArray[np.float64]
Pair = tuple[float, float]
Triple = tuple[float, float, float]

_SINGULAR = 0.02
_NAMES = 'pulley_radius', 'arm_length', 'cart_mass', 'motor_inertia', 'arm_mass', 'arm_inertia'
_DEFAULTS = 0.05, 0.6, 8.0, 0.001, 1.5, 0.06
_UNITS = 'm', 'm', 'kg', 'kg·m²', 'kg', 'kg·m²'

CART_ARM = Mechanism(
    name='cart_arm',
    base=(Coordinate('cart_joint', 'x', 'cart', 'm'),),
    joints=(
        Coordinate('pulley_joint', 'pulley', 'pulley'),
        Coordinate('arm_joint', 'arm', 'arm'),
    ),
    axes=(Quantity('x_T', 'm'), Quantity('y_T', 'm')),
    theta=(
        Quantity('mass', 'kg', 'M'),
        Quantity('moment', 'kg·m', 'p'),
        Quantity('inertia', 'kg·m²', 'i'),
    ),
    twist=(Velocity('cart speed', 'm/s', 0),),
    points=(Point('T', 'tip', 'tip', 'the tip', 0),),
    groups=(Group('cart', 0, 1), Group('arm', 1, 2)),
    frames=((ODOM_FRAME, BASE_FRAME), (BASE_FRAME, 'arm'), ('arm', 'tip')),
    parameters=tuple(
        Parameter(f'robot.{name}', value, name.replace('_', ' '), unit=unit, minimum=0.0)
        for name, value, unit in zip(_NAMES, _DEFAULTS, _UNITS, strict=True)
    ),
    lengths=('pulley_radius', 'arm_length'),
    module=__name__,
    defaults={
        'initial_joints': (0.0, 0.8),
        'disturbance.amplitude': (0.2, 0.5),
        'disturbance.frequency': (3.0, 1.5),
        'torque_limit': (5.0, 10.0),
        'line_sine.offset': (0.4, 0.35),
        'line_sine.slope': (0.05, 0.0),
        'line_sine.amplitude': (0.0, 0.1),
        'line_sine.frequency': (0.0, 1.0),
    },
    lost='the arm',
    singular='|cos a| < 0.02',
)


class Lengths(NamedTuple):
    """Constant lengths in m."""

    pulley: float
    arm: float


class Posture(NamedTuple):
    """Cosine and sine of the arm's angle."""

    c: float
    s: float


class Regressor(NamedTuple):
    """Entries of Y that are not zero."""

    a: float
    p_u: float
    p_w: float
    w: float


MODEL = Lengths


def constants(values: Mapping[str, Any]) -> tuple[Lengths, Triple]:
    """Return lengths and theta; InputError without a pulley or an arm."""
    r, length = values['pulley_radius'], values['arm_length']
    if r <= 0.0 or length <= 0.0:
        raise InputError(f'robot.pulley_radius = {r}, robot.arm_length = {length}: expected > 0')
    m = values['arm_mass']
    mass = values['cart_mass'] + m + values['motor_inertia'] / (r * r)
    half = 0.5 * length
    return Lengths(r, length), (mass, m * half, values['arm_inertia'] + m * half * half)


def start(
    values: Mapping[str, Any], pose: tuple[float, ...], angles: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the positions."""
    return (*pose, *angles)


def out_of_reach(lengths: Array, task: Array) -> tuple[int, str] | None:
    """Return the first y that is farther from the rail than the arm is long."""
    outside = np.abs(task[:, 1]) > lengths[1]
    if not outside.any():
        return None
    bad = int(np.argmax(outside))
    far = task[bad, 1]
    return bad, f'the tip is to be {far:.3f} m from the rail; expected up to {lengths[1]:g} m'


def base_motion(position: Array, velocity: Array) -> tuple[Array, Array]:
    """Return poses and twists of the cart."""
    pose, twist = np.zeros((len(position), 7)), np.zeros((len(position), 6))
    pose[:, 0], pose[:, 6], twist[:, 0] = position[:, 0], 1.0, velocity[:, 0]
    return pose, twist


def frame_origins(lengths: Array) -> Array:
    """Return the origins of the frames in m."""
    return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [lengths[1], 0.0, 0.0]])


def frame_transforms(origins: Array, position: Array) -> Array:
    """Return the transforms."""
    out = np.zeros((len(position), 3, 7))
    out[:, :, :3], out[:, :, 6] = origins, 1.0
    out[:, 0, 0] = position[:, 0]
    for k, angle in enumerate(position[:, 2].tolist()):
        out[k, 1, 5], out[k, 1, 6] = sin_cos(0.5 * angle)
    return out


def description(values: Mapping[str, Any], driven: Sequence[str], frame_prefix: str) -> str:
    """Return a URDF of bare links."""
    links = ''.join(f'<link name="{frame_prefix}{name}"/>' for name in (BASE_FRAME, 'arm', 'tip'))
    joint = (
        '<joint name="{}" type="{}"><parent link="{}{}"/><child link="{}{}"/>'
        '<origin xyz="{} 0 {}"/>{}</joint>'
    )
    arm = joint.format(
        driven[1], 'continuous', frame_prefix, BASE_FRAME, frame_prefix, 'arm', 0, 0.1,
        '<axis xyz="0 0 1"/>',
    )
    length = values['robot.arm_length']
    tip = joint.format(
        'tip_joint', 'fixed', frame_prefix, 'arm', frame_prefix, 'tip', length, 0, ''
    )
    return f'<?xml version="1.0"?>\n<robot name="cart_arm">{links}{arm}{tip}</robot>\n'


def outline(lengths: Array, position: Array) -> Outline:
    """Return cart and arm from above."""
    x, _, angle = position.tolist()
    tip = x + lengths[1] * math.cos(angle), lengths[1] * math.sin(angle)
    cart = np.array([(x + dx, dy) for dx, dy in ((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05))])
    shapes = Shape('body', cart), Shape('links', np.array([(x, 0.0), tip]))
    return Outline((x, 0.0), shapes, below=0.1, text=0.05)


@formula
def model_of(record: Any) -> Lengths:
    """Return the lengths stored in a record."""
    lengths = record.geometry
    return Lengths(lengths[0], lengths[1])


@formula
def posture(model: Lengths, position: Triple) -> Posture:
    """Return cosine and sine of the arm's angle."""
    s, c = sin_cos(position[2])
    return Posture(c, s)


@formula
def posture_of_joints(model: Lengths, angles: Pair) -> Posture:
    """Return cosine and sine of the arm's angle from the angles of the joints."""
    s, c = sin_cos(angles[1])
    return Posture(c, s)


@formula
def motion(model: Lengths, rates: Pair) -> Pair:
    """Return (u, w)."""
    return model.pulley * rates[0], rates[1]


@formula
def joint_rates(model: Lengths, motion: Pair) -> Pair:
    """Return the rates of pulley and arm."""
    return motion[0] / model.pulley, motion[1]


@formula
def joint_torques(model: Lengths, forces: Pair) -> Pair:
    """Return the torques of pulley and arm."""
    return model.pulley * forces[0], forces[1]


@formula
def forces(model: Lengths, torques: Pair) -> Pair:
    """Return (f_u, f_w)."""
    return torques[0] / model.pulley, torques[1]


@formula
def position_rates(model: Lengths, posture: Posture, rates: Pair) -> Triple:
    """Return the derivative of the positions."""
    return model.pulley * rates[0], rates[0], rates[1]


@formula
def task_position(model: Lengths, posture: Posture, position: Triple) -> Pair:
    """Return (x_T, y_T)."""
    return position[0] + model.arm * posture.c, model.arm * posture.s


@formula
def task_velocity(model: Lengths, posture: Posture, motion: Pair) -> Pair:
    """Return J v."""
    return motion[0] - model.arm * posture.s * motion[1], model.arm * posture.c * motion[1]


@formula
def task_drift(model: Lengths, posture: Posture, motion: Pair, reference: Pair) -> Pair:
    """Return Jdot v_r."""
    turn = model.arm * motion[1] * reference[1]
    return -turn * posture.c, -turn * posture.s


@formula
def _inverse_cosine(posture: Posture) -> float:
    """Return 1 / c, damped where c is small."""
    small = abs(posture.c) < _SINGULAR
    return posture.c / (_SINGULAR * _SINGULAR) if small else 1.0 / posture.c


@formula
def motion_from_task(model: Lengths, posture: Posture, rates: Pair, template: Pair) -> Pair:
    """Return J^-1 xdot."""
    turn = rates[1] * _inverse_cosine(posture) / model.arm
    return rates[0] + model.arm * posture.s * turn, turn


@formula
def forces_from_task(model: Lengths, posture: Posture, force: Pair, template: Pair) -> Pair:
    """Return J' F."""
    return force[0], model.arm * (posture.c * force[1] - posture.s * force[0])


@formula
def task_from_forces(model: Lengths, posture: Posture, forces: Pair) -> Pair:
    """Return J^-T f."""
    across = forces[1] / model.arm + posture.s * forces[0]
    return forces[0], across * _inverse_cosine(posture)


@formula
def is_singular(model: Lengths, posture: Posture) -> bool:
    """Return True if the arm is perpendicular to the rail."""
    return abs(posture.c) < _SINGULAR


@formula
def regressor(
    model: Lengths, posture: Posture, motion: Pair, reference: Pair, acceleration: Pair
) -> Regressor:
    """Return Y."""
    bend = -posture.s * acceleration[1] - posture.c * motion[1] * reference[1]
    return Regressor(acceleration[0], bend, -posture.s * acceleration[0], acceleration[1])


@formula
def regressor_times(model: Lengths, y: Regressor, theta: Triple) -> Pair:
    """Return Y theta."""
    return y.a * theta[0] + y.p_u * theta[1], y.p_w * theta[1] + y.w * theta[2]


@formula
def regressor_transpose_times(
    model: Lengths, y: Regressor, motion: Pair, template: Triple
) -> Triple:
    """Return Y' v."""
    return y.a * motion[0], y.p_u * motion[0] + y.p_w * motion[1], y.w * motion[1]


@formula
def inertia(model: Lengths, posture: Posture, theta: Triple) -> Triple:
    """Return H: its entries uu, uw, ww."""
    return theta[0], -theta[1] * posture.s, theta[2]


@formula
def inertia_times(model: Lengths, inertia: Triple, acceleration: Pair) -> Pair:
    """Return H vdot."""
    return (
        inertia[0] * acceleration[0] + inertia[1] * acceleration[1],
        inertia[1] * acceleration[0] + inertia[2] * acceleration[1],
    )


@formula
def inertia_solve(model: Lengths, inertia: Triple, forces: Pair) -> Pair:
    """Return H^-1 f."""
    det = inertia[0] * inertia[2] - inertia[1] * inertia[1]
    return (
        (inertia[2] * forces[0] - inertia[1] * forces[1]) / det,
        (inertia[0] * forces[1] - inertia[1] * forces[0]) / det,
    )


@formula
def coriolis(model: Lengths, posture: Posture, theta: Triple, motion: Pair) -> Pair:
    """Return V v."""
    return -theta[1] * posture.c * motion[1] * motion[1], 0.0


@formula
def weakest_motion(model: Lengths, theta: Triple) -> tuple[float, Pair]:
    """Return the first pivot of [[M, p], [p, i]] that is not positive, or the last, and its x."""
    if theta[0] <= 0.0:
        return theta[0], (1.0, 0.0)
    part = theta[1] / theta[0]
    return theta[2] - part * theta[1], (-part, 1.0)


@formula
def consistency_normal(model: Lengths, x: Pair, template: Triple) -> Triple:
    """Return n with n' theta = x' [[M, p], [p, i]] x."""
    return x[0] * x[0], 2.0 * x[0] * x[1], x[1] * x[1]


@formula
def rate_command(model: Lengths, motion: Pair) -> Pair:
    """Return the cart's speed and the arm's rate."""
    return motion


@formula
def commanded_joint_rates(model: Lengths, command: Pair) -> Pair:
    """Return the rates of pulley and arm."""
    return command[0] / model.pulley, command[1]


@formula
def dead_reckoned(model: Lengths, pose: tuple[float], turned: Pair) -> tuple[float]:
    """Return the cart's position after a rotation of the pulley."""
    return (pose[0] + model.pulley * turned[0],)


@formula
def counts_turns(model: Lengths, resolution: Pair) -> bool:
    """Return True if the pulley's encoder has a finite resolution."""
    return resolution[0] > 0.0


if __name__ == '__main__':
    from pathlib import Path

    # Compiled code refers to the module by its name, so it is imported under it.
    from cart_arm import CART_ARM
    import masmc_ros as masmc
    from masmc_ros.params.plug_ins import add_plug_in
    from masmc_ros.robot.mechanisms import ENTRY_POINTS

    # A package adds it by the entry point `cart_arm = cart_arm:CART_ARM` of this group.
    add_plug_in(ENTRY_POINTS, 'cart_arm', CART_ARM)
    print(masmc.simulate(Path(__file__).with_suffix('.yaml')))
