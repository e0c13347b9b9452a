# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mass and centre of mass of a load from its moments, and the expected size of the moments."""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array
import numpy as np

_HEAVIEST = 20.0
"""Expected size of a mass in kg."""

_FARTHEST = 0.3
"""Expected distance of a centre of mass from the frame of the link, in m."""

EXPECTED_MOMENTS = _HEAVIEST * np.repeat([1.0, _FARTHEST, _FARTHEST**2], [1, 3, 6])
"""(10) Expected sizes of the mass, and of the first and second moments, in kg, kg·m and kg·m²."""

COULOMB_SHARE = 0.1
"""Expected Coulomb friction, as a part of the RMS torque of the joint."""


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
