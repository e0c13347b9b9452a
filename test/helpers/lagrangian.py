# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Robot equations derived from the Lagrangian with SymPy, independently of the package.

The seven coordinates q of (8) are x_C, y_C, phi, theta_R, theta_L, theta_1, theta_2. The
kinetic energy of the five bodies yields H(q), its Christoffel symbols yield C(q, qdot), and
the rolling of the wheels yields A(q). S(q) is the null space of A.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
import sympy as sp

Array = NDArray[np.float64]

PARAMETERS = (
    'wheel_radius',
    'half_track',
    'com_offset',
    'arm_offset',
    'link_1_length',
    'link_2_length',
    'link_1_com',
    'link_2_com',
    'platform_mass',
    'wheel_mass',
    'link_1_mass',
    'link_2_mass',
    'platform_inertia',
    'wheel_spin_inertia',
    'wheel_yaw_inertia',
    'link_1_inertia',
    'link_2_inertia',
)


@dataclass(frozen=True)
class Matrices:
    """The matrices of (6)-(9) at one state of one robot."""

    inertia: Array
    """H (7, 7)."""
    christoffel: Array
    """C(q, qdot) (7, 7)."""
    constraints: Array
    """A (4, 7): slip of the right and of the left wheel, each in x and y; of rank 3."""
    null_space: Array
    """S (7, 4)."""
    null_space_rate: Array
    """Sdot (7, 4)."""
    task_jacobian: Array
    """Of x = (x_E, y_E, x_F, y_F) with respect to q (4, 7)."""
    task_jacobian_rate: Array
    """Its time derivative (4, 7)."""
    task_position: Array
    """x itself (4)."""

    @property
    def jacobian(self) -> Array:
        """J of (4) (4, 4)."""
        return self.task_jacobian @ self.null_space

    @property
    def jacobian_rate(self) -> Array:
        """Jdot of (5) (4, 4)."""
        return (
            self.task_jacobian_rate @ self.null_space + self.task_jacobian @ self.null_space_rate
        )

    @property
    def reduced_inertia(self) -> Array:
        """S'HS."""
        return self.null_space.T @ self.inertia @ self.null_space

    @property
    def printed_coriolis(self) -> Array:
        """Return S'HSdot, which (10) prints as V."""
        return self.null_space.T @ self.inertia @ self.null_space_rate

    @property
    def reduced_coriolis(self) -> Array:
        """Return S'HSdot + S'CS."""
        return self.printed_coriolis + self.null_space.T @ self.christoffel @ self.null_space


def _unit(angle: Any) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


@cache
def _derive() -> Callable[..., Any]:
    """Return a function of q, v and the parameters; the derivation takes some seconds."""
    q = sp.Matrix(sp.symbols('x y phi theta_R theta_L theta_1 theta_2', real=True))
    q_dot = sp.Matrix(sp.symbols('xd yd phid theta_Rd theta_Ld theta_1d theta_2d', real=True))
    p = dict(zip(PARAMETERS, sp.symbols(PARAMETERS, positive=True), strict=True))
    r, b, d = p['wheel_radius'], p['half_track'], p['com_offset']
    x, y, phi, _, _, theta_1, theta_2 = q
    platform = sp.Matrix([x, y])
    axle = platform - d * _unit(phi)
    side = _unit(phi + sp.pi / 2)
    wheels = (axle - b * side, axle + b * side)
    base = platform + p['arm_offset'] * _unit(phi)
    elbow = base + p['link_1_length'] * _unit(phi + theta_1)
    tip = elbow + p['link_2_length'] * _unit(phi + theta_1 + theta_2)
    com_1 = base + p['link_1_com'] * _unit(phi + theta_1)
    com_2 = elbow + p['link_2_com'] * _unit(phi + theta_1 + theta_2)

    def energy(mass: Any, point: sp.Matrix, inertia: Any, rate: Any) -> Any:
        velocity = point.jacobian(q) * q_dot
        return (mass * velocity.dot(velocity) + inertia * rate**2) / 2

    _, _, yaw_rate, right, left, rate_1, rate_2 = q_dot
    kinetic = (
        energy(p['platform_mass'], platform, p['platform_inertia'], yaw_rate)
        + energy(p['link_1_mass'], com_1, p['link_1_inertia'], yaw_rate + rate_1)
        + energy(p['link_2_mass'], com_2, p['link_2_inertia'], yaw_rate + rate_1 + rate_2)
    )
    for wheel, spin in zip(wheels, (right, left), strict=True):
        kinetic += energy(p['wheel_mass'], wheel, p['wheel_yaw_inertia'], yaw_rate)
        kinetic += p['wheel_spin_inertia'] * spin**2 / 2
    inertia = sp.hessian(kinetic, q_dot)
    slopes = [inertia.diff(coordinate) for coordinate in q]
    christoffel = sp.Matrix(
        7,
        7,
        lambda i, j: sum(
            (slopes[k][i, j] + slopes[j][i, k] - slopes[i][j, k]) * q_dot[k] / 2 for k in range(7)
        ),
    )
    # No slip: a wheel's centre moves along the heading as fast as the tread turns.
    slips = [
        wheel.jacobian(q) * q_dot - r * spin * _unit(phi)
        for wheel, spin in zip(wheels, (right, left), strict=True)
    ]
    constraints = sp.Matrix.vstack(*slips).jacobian(q_dot)
    # Solved for the velocities of the platform, they give S.
    v = sp.Matrix(sp.symbols('v_R v_L v_1 v_2', real=True))
    free = {right: v[0], left: v[1], rate_1: v[2], rate_2: v[3]}
    rolling = sp.solve(
        [sp.expand(e) for slip in slips for e in slip.subs(free)], list(q_dot[:3]), dict=True
    )[0]
    motion = q_dot.subs({**rolling, **free})
    null_space = motion.jacobian(v).applyfunc(sp.trigsimp)
    turning = null_space.diff(phi) * motion[2]
    position = sp.Matrix.vstack(tip, base)
    task = position.jacobian(q)
    task_rate = sum((task.diff(q[k]) * q_dot[k] for k in range(7)), sp.zeros(4, 7))
    moving = dict(zip(q_dot, motion, strict=True))
    matrices = [
        inertia,
        christoffel.subs(moving),
        constraints,
        null_space,
        turning,
        task,
        task_rate.subs(moving),
        list(position),
    ]
    return sp.lambdify([list(q), list(v), list(p.values())], matrices, 'numpy', cse=True)


def matrices(parameters: dict[str, float], q: Array, v: Array) -> Matrices:
    """Return all matrices of a robot at coordinates q (7) and reduced velocities v (4)."""
    values = [parameters[name] for name in PARAMETERS]
    return Matrices(*(np.array(m, dtype=np.float64) for m in _derive()(q, v, values)))
