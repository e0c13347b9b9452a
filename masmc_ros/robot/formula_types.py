# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of the arguments of a mechanism's formulas, as their callers see them.

The modules of a mechanism have the named tuples behind the opaque types, and `law/fields.py` has
all fields of laws. These types have no values: editors, mypy and the dry run of a mechanism
(`mechanism_dry_run.py`) read them.
"""

from __future__ import annotations

from typing import Annotated, Protocol

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters

Lengths = Annotated[tuple[object, ...], 'model']
"""Named tuple of a mechanism's constant lengths, the first argument of its formulas."""

MechanismPosture = Annotated[tuple[object, ...], 'posture']
"""Result of `mechanism.posture`, a named tuple of the mechanism."""

MechanismRegressor = Annotated[tuple[object, ...], 'regressor']
"""Result of `mechanism.regressor`, a named tuple of the mechanism."""

MechanismInertia = Annotated[object, 'inertia']
"""Result of `mechanism.inertia`, a named tuple or an array of the mechanism."""


class HasGeometry(Protocol):
    """One lane of any record with the lengths of a mechanism."""

    @property
    def geometry(self) -> Numbers:
        """Return the lengths as a vector."""
        ...


class RobotLane:
    """Fields of `robot.Robot.body`."""

    geometry: Numbers
    position: Numbers
    rates: Joints
    error: Axes


class LawSettings:
    """Settings of a law that formulas of mechanisms read."""

    nominal: Parameters
    period: float
    takes_rates: int
    gamma: Parameters
    projection_lower: float
    projection_upper: float


class LawMemory:
    """State of a law that formulas of mechanisms read and write."""

    drift: Joints
    drift_predicted: Joints
    drift_limited: Joints
    drift_gain: float
