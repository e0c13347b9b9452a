# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Combinations of parameters that a motion did not excite.

Combinations without an effect on any motion cannot be identified; the others are the base
parameters (Gautier 1991). A run excites a base parameter if it determines the parameter better
than the prior of the nominal robot.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.identification.consistent_parameters import Scale
from masmc_ros.identification.identify import EXCITED, Identified
from masmc_ros.identification.regressor import instantaneous
from masmc_ros.robot.robot import Robot
import numpy as np

_STATES = 200
"""Number of random states, enough to excite every base parameter."""

_RANK = 1.0e-9
"""Largest relative singular value of a combination without effect."""

_SHOWN = 0.2
"""Smallest factor of a named parameter in a combination."""

_MOST_NAMES = 4
"""Number of parameters that describe a combination."""


class Direction(NamedTuple):
    """Combination of parameters: names, and factors in units of their prior deviations."""

    names: tuple[str, ...]
    factors: tuple[float, ...]

    @property
    def text(self) -> str:
        """Return the combination as a sum, such as `mass - 0.5 offset`."""
        parts = [
            f'{"-" if factor < 0 else "+"} {abs(factor):.2g} {name}'
            for name, factor in zip(self.names, self.factors, strict=True)
        ]
        return ' '.join(parts).removeprefix('+ ').removeprefix('1 ')


def base_parameters(robot: Robot, scale: Scale) -> Array:
    """
    Return an orthonormal basis (p, r) of the scaled combinations that affect some motion.

    It is computed from random states, without a run. `scale` has p parameters.
    """
    random = np.random.default_rng(0)
    mechanism = robot.mechanism
    joints = len(mechanism.joints)
    low, high = np.array(mechanism.position_limits).T
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    position = np.zeros((_STATES, len(mechanism.positions)))
    position[:, -joints:] = random.uniform(low, high, (_STATES, joints))
    rates, accelerations = random.uniform(-1.0, 1.0, (2, _STATES, joints))
    matrix = instantaneous(robot, position, rates, accelerations).matrix
    # All rows of a joint have the same unit, so each joint is scaled by its RMS torque.
    matrix = matrix / np.sqrt(np.mean((matrix @ scale.scale) ** 2, axis=(0, 2)))[:, None]
    _, values, rows = np.linalg.svd(
        matrix.reshape(-1, matrix.shape[2]) @ scale.scale, full_matrices=False
    )
    return np.asarray(rows[values > _RANK * values[0]].T)


def unexcited(identified: Identified, base: Array) -> list[Direction]:
    """Return the combinations within the base (p, r) of a robot that the run did not excite."""
    scale = identified.scale
    prior = scale.prior()
    root = np.linalg.cholesky(base.T @ prior @ base)
    inside = np.linalg.solve(root, base.T @ identified.information @ base)
    inside = np.linalg.solve(root, inside.T)
    values, turned = np.linalg.eigh((inside + inside.T) / 2.0)
    weak = base @ np.linalg.solve(root.T, turned[:, values < 1.0 / EXCITED**2 - 1.0])
    expected = np.sqrt(np.diag(scale.scale @ np.linalg.inv(prior) @ scale.scale.T))
    rows = _sparse((scale.scale @ weak).T / expected)
    return [_direction(row, identified.names) for row in rows]


def _sparse(rows: Array) -> Array:
    """Return combinations of rows (d, p); each has a 1 in a column where the others have 0."""
    rows = rows.copy()
    free = np.ones(len(rows), bool)
    for _ in range(len(rows)):
        sizes = np.where(free[:, None], np.abs(rows), 0.0)
        i, j = np.unravel_index(int(np.argmax(sizes)), rows.shape)
        rows[i] /= rows[i, j]
        others = np.arange(len(rows)) != i
        rows[others] -= np.outer(rows[others, j], rows[i])
        free[i] = False
    return rows


def _direction(row: Array, names: tuple[str, ...]) -> Direction:
    order = np.argsort(-np.abs(row), kind='stable')[:_MOST_NAMES]
    shown = [int(i) for i in order if abs(row[i]) >= _SHOWN * abs(row[order[0]])]
    factors = row[shown] / row[shown[0]]
    return Direction(tuple(names[i] for i in shown), tuple(factors.tolist()))
