# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of the arguments of a mechanism's formulas, as their callers see them.

The modules of a mechanism have the named tuples behind the opaque types, and `law/fields.py` has
all fields of laws. These types have no values: editors and mypy read them.
"""

from __future__ import annotations

from typing import Protocol

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters

Lengths = tuple[object, ...]
"""Named tuple of a mechanism's constant lengths, the first argument of its formulas."""

MechanismPosture = tuple[object, ...]
"""Result of `mechanism.posture`, a named tuple of the mechanism."""

MechanismRegressor = tuple[object, ...]
"""Result of `mechanism.regressor`, a named tuple of the mechanism."""

MechanismInertia = object
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
