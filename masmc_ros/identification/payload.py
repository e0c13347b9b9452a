# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Payload of a robot: mass and centre of mass of a load, and the load as a change of the last link.

A load that is fixed to the last link adds its mass and moments to those of the link (Atkeson, An
and Hollerbach 1986). A fit of these changes alone is more accurate than an identification of the
whole robot, because the other parameters are known.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.identification.identify import Identified, Measured, Nominal, relative_error
import numpy as np

_HEAVIEST = 20.0
"""Expected size of a mass in kg."""

_FARTHEST = 0.3
"""Expected distance of a centre of mass from the frame of the link, in m."""

EXPECTED_MOMENTS = _HEAVIEST * np.repeat([1.0, _FARTHEST, _FARTHEST**2], [1, 3, 6])
"""(10) Expected sizes of the mass, and of the first and second moments, in kg, kg·m and kg·m²."""


class Load(NamedTuple):
    """
    Mass and centre of mass of a load.

    Attributes
    ----------
    mass, mass_error
        Mass in kg, and its standard error.
    centre, centre_error
        (3) Centre of mass in m, and its standard errors.

    """

    mass: float
    mass_error: float
    centre: Array
    centre_error: Array

    def margin(self, least: float) -> float:
        """Return three standard errors of the mass, at least `least`, in kg."""
        return max(3.0 * self.mass_error, least)


def load_of(
    moments: Array, covariance: Array, rotation: Array | None = None, origin: Array | None = None
) -> Load:
    """
    Return the mass and the centre of mass of a load with the given moments.

    Parameters
    ----------
    moments
        (10) Mass, first and second moments.
    covariance
        (10, 10) Covariance of the moments.
    rotation, origin
        Rotation (3, 3) and origin (3) in m of the frame of the centre of mass in the frame of the
        moments; None for the same frame.

    """
    turned = np.eye(3) if rotation is None else rotation.T
    mass, place = float(moments[0]), moments[1:4] / moments[0]
    slopes = np.zeros((3, len(moments)))
    slopes[:, 0], slopes[:, 1:4] = -place / mass, np.eye(3) / mass
    slopes = turned @ slopes
    centre = turned @ (place if origin is None else place - origin)
    errors = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return Load(mass, float(np.sqrt(covariance[0, 0])), centre, errors)


_LIGHTEST = 1.0e-3
"""Smallest mass in kg that is reported."""

_UNEXPLAINED = 0.03
"""Largest relative unexplained torque; above it, other parameters differ as well."""


class Payload(NamedTuple):
    """
    Payload in the frame of the last link.

    Attributes
    ----------
    load
        Mass in kg and centre of mass in m, with standard errors.
    residual
        (n) RMS of the torques that the payload does not explain, relative to the RMS torque.

    """

    load: Load
    residual: Array

    @property
    def is_significant(self) -> bool:
        """Return True if the mass exceeds three standard errors, and explains the torques."""
        explains = bool((self.residual < _UNEXPLAINED).all())
        return explains and self.load.mass > self.load.margin(_LIGHTEST)


def payload_of(
    nominal: Nominal, factors: Array, run: Measured, identified: Identified
) -> Payload:
    """
    Return the payload that explains the difference between a run and the nominal robot.

    Parameters
    ----------
    nominal
        Robot without payload.
    factors
        (q, 10) Changes of its q inertial parameters by mass, first and second moments of a payload
        in the frame of the last link; zero for moments without effect.
    run
        Run with the payload.
    identified
        Identification of the run; its timing and its noise are used.

    """
    before = np.concatenate([nominal.theta, nominal.friction])
    change = np.zeros((len(before), factors.shape[1]))
    change[:len(nominal.theta)] = factors
    expected = EXPECTED_MOMENTS
    timing = identified.timing
    torque = run.torque(timing.latency.value, timing.lag.value)
    missing = torque - run.predicted(before)
    columns = run.equations.matrix @ change
    # Friction that differs from the nominal one is not attributed to the payload.
    own = run.equations.matrix[:, :, len(nominal.theta):]
    friction_scale = np.diag(identified.scale.scale)[len(nominal.theta):]
    matrix = np.concatenate([columns * expected, own * friction_scale], axis=2)
    weighted = (matrix / identified.deviations[:, None]).reshape(-1, matrix.shape[2])
    right = (missing / identified.deviations).ravel()
    count = weighted.shape[1]
    orthogonal, triangle = np.linalg.qr(np.vstack([weighted, np.eye(count)]))
    solution = np.linalg.solve(triangle, orthogonal[:len(right)].T @ right)
    remaining = missing - matrix @ solution
    # The larger of the noise of the averaged torques and the unexplained torques.
    excess = max(1.0, float(np.mean((remaining / identified.deviations) ** 2)))
    size = len(expected)
    inverse = np.linalg.inv(triangle)[:size]
    covariance = inverse @ inverse.T * excess
    moments = solution[:size] * expected
    covariance *= np.outer(expected, expected)
    residual = relative_error(torque, torque - remaining)
    return Payload(load_of(moments, covariance), residual)
