# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of the arguments of a mechanism's formulas, as their callers see them.

The modules of a mechanism have the named tuples behind the opaque types, and `law/fields.py` has
all fields of laws. These types have no values: editors, mypy and the dry run of a mechanism
(`mechanism_dry_run.py`) read them.
"""

from __future__ import annotations

import math
from typing import Annotated, Protocol

from masmc_ros.aliases import Axes, Joints, Numbers, Parameters
from masmc_ros.jit.field import field, Fields

FIRST_DRIFT_GAIN = 0.5
"""Gain of the first estimate of the drift; later gains decrease."""

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


class MechanismParameters:
    """Values of parameters of laws that formulas of mechanisms read."""

    gamma: Parameters
    projection_lower: float
    projection_upper: float


class LawSettings(Fields, MechanismParameters):
    """Settings of a law that formulas of mechanisms read."""

    geometry: Numbers = field('Lengths of the robot', 'm', size='lengths')
    nominal: Parameters = field('theta of the nominal model')
    period: float = field('Control period T', 's')
    takes_rates: int = field('1 if joint velocities are commanded')


class LawMemory(Fields):
    """State of a law that formulas of mechanisms read and write."""

    drift: Joints = field('Estimated drift, in the velocities of the mechanism', '1/s²')
    drift_predicted: Joints = field(
        'sigma of the next tick without a change of the drift', '1/s', initial=math.nan
    )
    drift_limited: Joints = field('Time since torques are at a limit, with its sign', 's')
    drift_gain: float = field('Gain of the next estimate', initial=FIRST_DRIFT_GAIN)
