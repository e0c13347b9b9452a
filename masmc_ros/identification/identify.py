# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Identification of a robot from a run: timing, friction and inertial parameters.

The method is weighted least squares in scaled parameters y. The nominal robot is a prior with unit
variance of each of them, so parameters that the motion does not excite stay nominal. The weight of
a joint follows from its residual (Gautier 1997). Physically inconsistent results are moved to the
nearest consistent parameters in the metric of the data.

Shapes: n joints, q inertial parameters, p = q + 2 n parameters with viscous and Coulomb friction,
W windows.

Combinations of parameters without an effect on any motion cannot be identified; the others are
the base parameters (Gautier 1991). A run excites a base parameter if it determines the parameter
better than the prior of the nominal robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from masmc_ros.aliases import Array, Flags
from masmc_ros.errors import InputError
from masmc_ros.identification import regressor
from masmc_ros.identification.consistent_parameters import nearest_consistent, Scale, scaled
from masmc_ros.identification.latency_fit import fit_timing, LARGEST, LatencyFit
from masmc_ros.identification.samples import Samples
from masmc_ros.robot.robot import Robot
import numpy as np

_ROUNDS = 2
"""Number of iterations of the weights of the joints."""

_FINEST = 1.0e-6
"""Smallest standard deviation of a torque, relative to its RMS value."""

_SHARPEST = 1.0e10
"""Largest eigenvalue of the metric in which the nearest consistent parameters are computed."""

EXCITED = 0.1
"""Largest standard error of an excited parameter, relative to its prior deviation."""

_FEWEST_WINDOWS = 40
"""Smallest number of windows of an identification."""


class Nominal(NamedTuple):
    """Nominal robot, as the controller assumes it."""

    robot: Robot
    """Robot without friction."""
    theta: Array
    """(p) inertial parameters."""
    friction: Array
    """(2 n) viscous and Coulomb friction of the n joints."""


@dataclass(frozen=True)
class Measured:
    """
    Averaged equations of motion of a run.

    Attributes
    ----------
    equations
        Equations of motion, averaged over the windows.
    windows
        Windows in time.
    samples
        States and commands of the run.

    """

    equations: regressor.Equations
    windows: regressor.Windows
    samples: Samples

    def torque(self, latency: float, lag: float) -> Array:
        """Return the averages (W, n) of the acting torques for a latency and a motor lag in s."""
        times, commands = self.samples.command_times, self.samples.commands
        smoothing = self.samples.smoothing
        return regressor.average_of_held(times, commands, self.windows, latency, lag, smoothing)

    def predicted(self, parameters: Array) -> Array:
        """Return the averages (W, n) of the torques that parameters (p) explain."""
        return self.equations.known + self.equations.matrix @ parameters


@dataclass(frozen=True)
class Identified:
    """
    Results of an identification.

    Attributes
    ----------
    names, units
        (p) Names and units of the parameters: inertial ones, then viscous and Coulomb friction.
    nominal, values, errors
        (p) Nominal and identified parameters, and standard errors.
    is_excited
        (p) True if the motion determined the parameter, and not the prior.
    timing
        Latency and motor lag.
    residual
        (n) RMS of the torques that the identified robot does not explain, relative to the RMS
        torque of the joint.
    nominal_residual
        (n) The same for the nominal robot.
    deviations
        (n) Standard deviations of the averaged torques in N·m or N.
    information
        (p, p) Information of the data on the scaled parameters, without the prior.
    scale
        Scaled parameters.

    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    nominal: Array
    values: Array
    errors: Array
    is_excited: Flags
    timing: LatencyFit
    residual: Array
    nominal_residual: Array
    deviations: Array
    information: Array
    scale: Scale


def measured(robot: Robot, samples: Samples, where: str = 'run') -> Measured:
    """
    Return the averaged equations of motion of a run.

    Parameters
    ----------
    robot
        Robot without friction; its inertial parameters are not used.
    samples
        States and commands of the run.
    where
        Name of the run in messages.

    Raises
    ------
    InputError
        if there are too few windows without a gap.

    """
    half = samples.half
    windows = regressor.windows_in(samples.times, half, samples.valid, LARGEST + half)
    if len(windows.centres) < _FEWEST_WINDOWS:
        raise InputError(
            f'{where}: {len(windows.centres)} parts of {2000.0 * half:g} ms without a gap in '
            f'states and commands; expected at least {_FEWEST_WINDOWS}'
        )
    weights = regressor.sample_weights(samples.times, windows)
    equations = regressor.averaged(robot, samples.position, samples.rates, weights)
    return Measured(equations, windows, samples)


def identify(nominal: Nominal, run: Measured) -> Identified:
    """Return timing and parameters of the robot in a run, with the nominal robot as prior."""
    torque = run.torque(0.0, 0.0)
    size = np.sqrt(np.mean((torque - np.mean(torque, axis=0)) ** 2, axis=0))
    speed = np.sqrt(np.mean(run.samples.rates**2, axis=0)) + 1.0e-3
    size = np.maximum(size, 1.0e-6 * size.max() + 1.0e-9)
    friction_scale = np.concatenate([size / speed, regressor.COULOMB_SHARE * size])
    friction_scale = np.maximum(friction_scale, nominal.friction)
    scale = scaled(nominal.robot, nominal.theta, nominal.friction, friction_scale)
    prior = scale.prior()
    deviations = 0.05 * size
    problem = _Problem(run, scale, prior, deviations)
    timing = fit_timing(problem.residual)
    for _ in range(_ROUNDS):
        problem = _Problem(run, scale, prior, deviations)
        timing = fit_timing(problem.residual, timing)
        acting = run.torque(timing.latency.value, timing.lag.value)
        target = problem.solution(acting)
        missing = acting - run.predicted(scale.parameters(target))
        deviations = np.maximum(np.sqrt(np.mean(missing**2, axis=0)), _FINEST * size)
    information = problem.information
    sharp, turned = np.linalg.eigh(information + prior)
    metric = (turned * np.minimum(sharp, _SHARPEST)) @ turned.T
    values = scale.parameters(nearest_consistent(scale, target, metric))
    values[scale.first_friction:] = np.maximum(values[scale.first_friction:], 0.0)
    covariance = scale.scale @ np.linalg.inv(information + prior) @ scale.scale.T
    before = scale.scale @ np.linalg.inv(prior) @ scale.scale.T
    errors, expected = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(before))
    names, units = _names(nominal.robot)
    return Identified(
        names=names,
        units=units,
        nominal=scale.nominal,
        values=values,
        errors=errors,
        is_excited=errors < EXCITED * expected,
        timing=timing,
        residual=relative_error(acting, run.predicted(values)),
        nominal_residual=relative_error(acting, run.predicted(scale.nominal)),
        deviations=deviations,
        information=information,
        scale=scale,
    )


def relative_error(torque: Array, predicted: Array) -> Array:
    """Return the RMS (n) of torques (W, n) minus predictions, relative to the RMS torques."""
    missing, size = np.mean((torque - predicted) ** 2, axis=0), np.mean(torque**2, axis=0)
    return np.sqrt(missing / np.maximum(size, 1.0e-30))


def _names(robot: Robot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of all parameters."""
    names = [quantity.name for quantity in robot.mechanism.theta]
    units = [quantity.unit for quantity in robot.mechanism.theta]
    for friction in regressor.FRICTIONS:
        for joint in robot.mechanism.joints:
            names.append(f'{joint.name}_{friction}')
            per_speed = f'{joint.effort_unit}·s' if joint.unit != 'm' else 'N·s/m'
            units.append(per_speed if friction == 'viscous' else joint.effort_unit)
    return tuple(names), tuple(units)


class _Problem:
    """Weighted least squares with a prior, in scaled parameters."""

    def __init__(self, run: Measured, scale: Scale, prior: Array, deviations: Array) -> None:
        """Initialise the problem with the standard deviations (n) of the torques."""
        self._run, self._scale, self._deviations = run, scale, deviations
        matrix = run.equations.matrix / deviations[:, None]
        self._count = len(scale.nominal)
        data = matrix.reshape(-1, self._count) @ scale.scale
        root = np.linalg.cholesky(prior)
        self._orthogonal, self._triangle = np.linalg.qr(np.vstack([data, root.T]))
        self.information = data.T @ data

    def _right(self, torque: Array) -> Array:
        missing = torque - self._run.predicted(self._scale.nominal)
        rows = (missing / self._deviations).ravel()
        return np.concatenate([rows, np.zeros(self._count)])

    def residual(self, latency: float, lag: float) -> Array:
        """Return the weighted residuals with the best parameters, for a latency and a lag in s."""
        right = self._right(self._run.torque(latency, lag))
        return np.asarray(right - self._orthogonal @ (self._orthogonal.T @ right))

    def solution(self, torque: Array) -> Array:
        """Return the scaled parameters of the minimum, consistent or not."""
        return np.linalg.solve(self._triangle, self._orthogonal.T @ self._right(torque))


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
    matrix = regressor.instantaneous(robot, position, rates, accelerations).matrix
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
