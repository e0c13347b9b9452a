# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Physically consistent inertial parameters, as linear matrix inequalities.

Parameters are consistent if the pseudo-inertia of each body, or the consistency matrix of the
mechanism, is positive definite (Traversaro, Brossette, Escande and Nori 2016; Wensing, Kim and
Slotine 2018). Both are linear in the parameters. Here they are scaled by the Cholesky factor C of
the nominal matrix: C^-1 P C^-T = I + ... The distance between two scaled robots does not depend on
units and frames (Lee, Wensing and Park 2020).
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array, Records
from masmc_ros.identification.regressor import FRICTIONS, record_of
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.robot import mechanism
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray

_LEAST = 1.0e-4
"""Smallest eigenvalue of a scaled matrix."""

_GYRATION = 0.01
"""Smallest radius of gyration in m in the scale of a body."""

_MASSLESS = 0.01
"""Mass in kg in the scale of a body without mass."""

_PER_BODY = 10


class Inequality(NamedTuple):
    """
    Condition that the symmetric matrix constant + sum of y_i factors_i is positive definite.

    `constant` (m, m) is that of the nominal robot, `factors` (p, m, m) belong to the p scaled
    parameters y.
    """

    constant: Array
    factors: Array

    def matrix(self, y: Array) -> Array:
        """Return the matrix (m, m) of scaled parameters y (p)."""
        return np.asarray(self.constant + np.einsum('p,pij->ij', y, self.factors))


class Scale(NamedTuple):
    """
    Scaled coordinates y of all p parameters: x = nominal + `scale` y.

    Attributes
    ----------
    nominal
        (p) Nominal parameters: inertial ones, then viscous and Coulomb friction.
    scale
        (p, p) Matrix that maps y to changes of the parameters.
    inequalities
        Conditions on the inertial parameters.
    first_friction
        Number of inertial parameters; those after them, the friction, must not be negative.

    """

    nominal: Array
    scale: Array
    inequalities: tuple[Inequality, ...]
    first_friction: int

    def parameters(self, y: Array) -> Array:
        """Return the parameters (p), in SI units, of scaled ones y (p)."""
        return np.asarray(self.nominal + self.scale @ y)

    def prior(self) -> Array:
        """Return the matrix (p, p) of the squared distance from the nominal robot, y' prior y."""
        count = len(self.nominal)
        squares = np.zeros((count, count))
        for inequality in self.inequalities:
            flat = inequality.factors.reshape(count, -1)
            squares += flat @ flat.T
        friction = range(self.first_friction, count)
        squares[friction, friction] = 1.0
        return squares


def scaled(robot: Robot, theta: Array, friction: Array, friction_scale: Array) -> Scale:
    """
    Return the scaled parameters of a nominal robot with n joints.

    Parameters
    ----------
    robot
        Robot without friction.
    theta
        (q) Nominal inertial parameters.
    friction
        (2 n) Nominal coefficients of viscous friction in N·m·s/rad, then those of Coulomb
        friction in N·m.
    friction_scale
        (2 n) Expected size of these coefficients, which is their prior deviation.

    """
    first = len(theta)
    count = first + len(friction)
    assert len(friction) % len(FRICTIONS) == 0
    scale = np.zeros((count, count))
    scale[range(first, count), range(first, count)] = friction_scale
    make = _of_bodies if robot.mechanism.name == 'tree' else _of_mechanism
    own, inequalities = make(robot, theta)
    scale[:first, :first] = own
    padded = tuple(
        Inequality(entry.constant, np.pad(entry.factors, ((0, len(friction)), (0, 0), (0, 0))))
        for entry in inequalities
    )
    return Scale(np.concatenate([theta, friction]), scale, padded, first)


def _of_bodies(robot: Robot, theta: Array) -> tuple[Array, list[Inequality]]:
    """Return scale and inequalities of a tree: each body has its pseudo-inertia."""
    from masmc_ros.robot.tree.link_inertia import pseudo_inertia

    units = np.array([pseudo_inertia(unit) for unit in np.eye(_PER_BODY).tolist()])
    flat = units.reshape(_PER_BODY, -1)
    basis = _symmetric_basis(4)
    scale = np.zeros((len(theta), len(theta)))
    inequalities = []
    for first in range(0, len(theta), _PER_BODY):
        own = slice(first, first + _PER_BODY)
        nominal = pseudo_inertia(theta[own].tolist())
        root = np.linalg.cholesky(_thick(nominal))
        turned = np.array([root @ matrix @ root.T for matrix in basis]).reshape(_PER_BODY, -1)
        scale[own, own] = np.linalg.lstsq(flat.T, turned.T, rcond=None)[0]
        factors = np.zeros((len(theta), 4, 4))
        factors[own] = basis
        inequalities.append(Inequality(_congruent(root, nominal), factors))
    return scale, inequalities


def _of_mechanism(robot: Robot, theta: Array) -> tuple[Array, list[Inequality]]:
    """Return scale and inequality of a mechanism with one consistency matrix Q(theta)."""
    body = record_of(robot, theta)
    size = _order(body)
    units = np.eye(size)
    # Entries of Q from values of its quadratic form, by polarisation.
    own = [_quadratic(body, unit) for unit in units]
    factors = np.zeros((len(theta), size, size))
    for i in range(size):
        factors[:, i, i] = own[i]
        for j in range(i):
            both = _quadratic(body, units[i] + units[j])
            factors[:, i, j] = factors[:, j, i] = (both - own[i] - own[j]) / 2.0
    scale = np.abs(theta) + 1.0e-3 * np.abs(theta).max()
    factors *= scale[:, None, None]
    nominal = np.einsum('p,pij->ij', theta / scale, factors)
    root = np.asarray(np.linalg.cholesky(nominal), np.float64)
    congruent = np.array([_congruent(root, factor) for factor in factors])
    return np.diag(scale), [Inequality(np.eye(size), congruent)]


@kernel
def _order(body: Records) -> int:
    """Return the number of rows of the consistency matrix of a mechanism."""
    record = lane_of(body[0], 0)
    model = mechanism.model_of(record)
    _, x = mechanism.weakest_motion(model, record.theta)
    check_workspace(record)
    return len(x)


@kernel
def _quadratic(body: Records, x: Array) -> Array:
    """Return the derivatives (p) of x' Q(theta) x by the parameters, for x (m)."""
    record = lane_of(body[0], 0)
    model, theta = mechanism.model_of(record), record.theta
    _, template = mechanism.weakest_motion(model, theta)
    normal = mechanism.consistency_normal(model, to_vector(x, template), theta)
    out = np.empty(len(normal))
    for i in range(len(normal)):
        out[i] = normal[i]
    check_workspace(record)
    return out


def _thick(nominal: Array) -> Array:
    """Return a pseudo-inertia (4, 4) that is positive definite also without mass or thickness."""
    if nominal[3, 3] <= 0.0:
        return np.diag([(5.0 * _GYRATION) ** 2] * 3 + [1.0]) * _MASSLESS
    return np.asarray(nominal + np.diag([_GYRATION**2 * nominal[3, 3]] * 3 + [0.0]))


def _congruent(root: NDArray[np.floating], matrix: Array) -> Array:
    """Return C^-1 M C^-T for a lower triangular C."""
    left = np.linalg.solve(root, matrix)
    return np.asarray(np.linalg.solve(root, left.T).T)


def _symmetric_basis(size: int) -> Array:
    """Return the orthonormal basis (n, size, size) of symmetric matrices."""
    rows, columns = np.tril_indices(size)
    basis = np.zeros((len(rows), size, size))
    for k, (i, j) in enumerate(zip(rows, columns, strict=True)):
        basis[k, i, j] = basis[k, j, i] = 1.0 if i == j else np.sqrt(0.5)
    return basis


def is_consistent(scale: Scale, y: Array) -> bool:
    """Return True if scaled parameters y (p) satisfy all inequalities, and friction is >= 0."""
    matrices = [inequality.matrix(y) for inequality in scale.inequalities]
    least = min(np.linalg.eigvalsh(matrix)[0] for matrix in matrices)
    friction = scale.parameters(y)[scale.first_friction:]
    return bool(least >= _LEAST and (friction >= 0.0).all())


def nearest_consistent(scale: Scale, target: Array, metric: Array) -> Array:
    """
    Return the consistent y (p) with the smallest (y - target)' metric (y - target).

    Clarabel, an interior-point solver (Goulart and Chen 2024), solves this semidefinite program. A
    consistent target is returned unmodified.

    Parameters
    ----------
    scale
        Scaled parameters with their inequalities.
    target
        (p) Scaled parameters.
    metric
        (p, p) Positive definite matrix.

    """
    if is_consistent(scale, target):
        return target
    import clarabel
    from scipy import sparse

    count, first = len(target), scale.first_friction
    # min y' metric y / 2 - target' metric y, with A y + s = b and s in the cones.
    rows, bounds, cones = [], [], []
    for inequality in scale.inequalities:
        size = len(inequality.constant)
        columns, lines = np.tril_indices(size)
        root = np.where(lines == columns, 1.0, np.sqrt(2.0))
        rows.append(-(inequality.factors[:, lines, columns] * root).T)
        free = inequality.constant - _LEAST * np.eye(size)
        bounds.append(free[lines, columns] * root)
        cones.append(clarabel.PSDTriangleConeT(size))
    if first < count:
        rows.append(-scale.scale[first:])
        bounds.append(scale.nominal[first:])
        cones.append(clarabel.NonnegativeConeT(count - first))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    largest = float(np.abs(metric).max())
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(metric / largest)),
        -metric @ target / largest,
        sparse.csc_matrix(np.vstack(rows)),
        np.concatenate(bounds),
        cones,
        settings,
    )
    return np.array(solver.solve().x)
